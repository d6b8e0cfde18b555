//! Encoder scan: the field turns the rotor slowly, a whole turn of the motor forwards and one back.
//!
//! ```text
//! deviation = field - angle(position)                      of every tick, turns
//! offset = (mean deviation forwards + mean deviation backwards) / 2
//! lag    = (mean deviation forwards - mean deviation backwards) / 2        asin(friction / holding torque)
//! ```
//!
//! Whole turns average out cogging and an eccentric encoder; both ways cancel friction and the loop's delay.
//! The axis' current loop holds the current in a frame that the field defines, not the encoder. Its
//! quadrature axis lies along the field, which moves as `field.rs` describes.
//!
//! Checks of the forward pass, in this order:
//!
//! 1. The counter moved at all, and in the field's direction.
//! 2. Equal travel in every electrical turn of the field. Otherwise the rotor slipped, and its
//!    counts mean nothing.
//! 3. Travel of one turn's counts to 0.4 of an electrical turn: detects other pole pairs.
//! 4. Drift of the deviation: detects slightly different counts per turn.
//! 5. Deviations within 90 degrees of the first.
//! 6. Travel of one turn's counts to an eighth of an electrical turn.
//!
//! The backward pass must be as even and as long; then lag and index position are checked.
//!
//! **Limit of the lag.** Friction cancels where it is equal both ways. A lag of 30 degrees takes half of the
//! holding torque: the rotor still has a margin of two before it slips. Friction that differs by an eighth
//! between the ways then shifts the offset by tan 30 / 16 rad: 2 degrees. At a lag of 60 degrees it would be
//! 6, with hardly any holding torque left.
//!
//! **With a stored offset** the scan is the same. The measured offset must agree with the stored one to 5
//! degrees (0.4 % of the torque). The stored offset, from the commissioning, is then used. So reversed
//! wiring, other pole pairs or counts and a moved index are detected at every power-up.

use super::field::FieldWay;
use super::track::{Followed, Track};
use super::{Outcome, Reading, Refusal};
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::{CurrentGains, CurrentLoop, ElectricalAngle, Rotating};
use crate::units::Volt;

const REST_TICKS: u32 = CURRENT_RATE_HZ / 5;
const FALL_TICKS: u32 = CURRENT_RATE_HZ / 20;
/// Greatest error of the forward travel, electrical turns.
const GREATEST_TRAVEL_ERROR: f32 = 0.125;
/// Lower bound of the error by wrong pole pairs, electrical turns: p and p + 1 differ by p / (p + 1).
const LEAST_MISTAKE: f32 = 0.4;
/// Greatest drift of the deviation, electrical turns per turn of the motor: 18 degrees. 100 simulated motors
/// swing by up to 13. With 4 pole pairs, 4,000 counts configured for 4,096 make 34.
const GREATEST_DRIFT: f32 = 0.05;
/// Greatest difference between both passes, electrical turns.
const GREATEST_DIFFERENCE: f32 = 0.125;
/// Greatest lag, electrical turns: see the module.
const GREATEST_LAG: f32 = 1.0 / 12.0;
/// Greatest difference of measured and stored offset, electrical turns.
const GREATEST_STORED_ERROR: f32 = 5.0 / 360.0;
/// Less travel is vibration, electrical turns.
const LEAST_TRAVEL: f32 = 0.1;
/// Greatest distance from a whole number at which pole pairs are reported.
const WHOLE: f32 = 0.1;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ScanResult {
    /// Electrical angle at rotor position zero.
    pub offset: ElectricalAngle,
    /// Rotor position of the last sample.
    pub position: i32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Leg {
    /// At the beginning and before the backward pass.
    Rest,
    Forwards,
    Backwards,
    /// The current falls to zero.
    Fall,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scan {
    gains: CurrentGains,
    current_loop: CurrentLoop,
    stored: Option<ElectricalAngle>,
    leg: Leg,
    /// Ticks of this leg.
    ticks: u32,
    /// Angle of the field at the beginning of the leg and now, electrical turns, not reduced.
    begin_turns: f32,
    field_turns: f32,
    track: Track,
    followed: Followed,
    forwards: Option<Followed>,
    offset: ElectricalAngle,
}

impl Scan {
    /// `begin` is the present voltage that holds the current along phase A.
    pub(super) fn new(gains: CurrentGains, begin: Volt, stored: Option<ElectricalAngle>) -> Self {
        Self {
            gains,
            current_loop: CurrentLoop::holding(Rotating { d: Volt::ZERO, q: begin }),
            stored,
            leg: Leg::Rest,
            ticks: 0,
            begin_turns: 0.0,
            field_turns: 0.0,
            track: Track::default(),
            followed: Followed::default(),
            forwards: None,
            offset: ElectricalAngle::ZERO,
        }
    }

    pub(super) fn tick(&mut self, reading: &Reading<'_>) -> Result<Outcome<ScanResult>, Refusal> {
        let bench = reading.bench;
        self.track.follow(reading);
        let way = FieldWay::over(f32::from(bench.pole_pairs), bench.settings.turns_per_s);
        let turned = way.travelled(self.ticks as f32 * (1.0 / CURRENT_RATE_HZ as f32));
        self.ticks += 1;
        let mut share = 1.0;
        match self.leg {
            Leg::Rest if self.ticks < REST_TICKS => {}
            Leg::Rest if self.forwards.is_some() => self.begin(Leg::Backwards),
            Leg::Rest => self.begin(Leg::Forwards),
            Leg::Forwards => {
                self.field_turns = turned;
                self.measure(reading, way.steady(turned));
                if way.ended(turned) {
                    self.end_forwards(reading)?;
                    self.begin(Leg::Rest);
                }
            }
            Leg::Backwards => {
                self.field_turns = self.begin_turns - turned;
                self.measure(reading, way.steady(turned));
                if way.ended(turned) {
                    self.end_backwards(reading)?;
                    self.begin(Leg::Fall);
                }
            }
            Leg::Fall => {
                share = 1.0 - self.ticks as f32 / FALL_TICKS as f32;
                if self.ticks >= FALL_TICKS {
                    return Ok(Outcome::Passed(self.result(reading)));
                }
            }
        }
        let target = bench.settings.current * share;
        let frame = self.field().minus(ElectricalAngle::from_turns(0.25)).rotation();
        let voltage = self.current_loop.voltage(
            &self.gains,
            target,
            reading.current.to_rotating(frame),
            0.0,
            bench.settings.voltage,
        );
        Ok(Outcome::Running(voltage.to_stationary(frame)))
    }

    fn begin(&mut self, leg: Leg) {
        self.leg = leg;
        self.ticks = 0;
        self.begin_turns = self.field_turns;
        self.followed = Followed::default();
    }

    fn field(&self) -> ElectricalAngle {
        ElectricalAngle::from_turns(self.field_turns)
    }

    fn measure(&mut self, reading: &Reading<'_>, steady_turns: Option<f32>) {
        if let Some(turns) = steady_turns {
            let field = self.field();
            let turns = [turns, f32::from(reading.bench.pole_pairs)];
            self.followed.push(&reading.bench.scale, self.track.way, field, turns);
        }
    }

    /// Converts counts to electrical turns by the configured scale.
    fn electrical(reading: &Reading<'_>, counts: i32) -> f32 {
        let turn = reading.bench.scale.counts_per_turn() as f32;
        counts as f32 * f32::from(reading.bench.pole_pairs) / turn
    }

    fn end_forwards(&mut self, reading: &Reading<'_>) -> Result<(), Refusal> {
        let counts = self.followed.travel.counts();
        let pairs = f32::from(reading.bench.pole_pairs);
        let electrical = Self::electrical(reading, counts);
        if electrical.abs() < LEAST_TRAVEL {
            return Err(Refusal::NoCounts);
        }
        if electrical < 0.0 {
            return Err(Refusal::Direction);
        }
        self.followed.must_be_even()?;
        if (electrical - pairs).abs() > LEAST_MISTAKE {
            let fitting = pairs * pairs / electrical;
            let whole = (fitting + 0.5) as u8;
            return Err(match self.track.index_distance {
                Some(distance) => Refusal::CountsPerTurn(distance.unsigned_abs()),
                None if (fitting - f32::from(whole)).abs() < WHOLE => Refusal::PolePairs(whole),
                None => Refusal::CountsPerTurn(counts.unsigned_abs()),
            });
        }
        let drift = self.followed.deviation.drift_per_turn();
        if drift.abs() * pairs > GREATEST_DRIFT {
            let stated = reading.bench.scale.counts_per_turn() as f32;
            return Err(Refusal::CountsPerTurn((stated * (1.0 - drift) + 0.5) as u32));
        }
        self.followed.must_keep_to_the_field()?;
        if (electrical - pairs).abs() > GREATEST_TRAVEL_ERROR {
            return Err(Refusal::Slipped);
        }
        self.forwards = Some(self.followed);
        Ok(())
    }

    fn end_backwards(&mut self, reading: &Reading<'_>) -> Result<(), Refusal> {
        let Some(forwards) = self.forwards else { return Err(Refusal::Slipped) };
        self.followed.must_be_even()?;
        self.followed.must_keep_to_the_field()?;
        let apart = forwards.travel.counts().wrapping_add(self.followed.travel.counts());
        let (there, back) = (forwards.deviation.mean(), self.followed.deviation.mean());
        let lag = there.since(back) * 0.5;
        if Self::electrical(reading, apart).abs() > GREATEST_DIFFERENCE || lag.abs() > GREATEST_LAG {
            return Err(Refusal::Slipped);
        }
        if reading.bench.index && self.track.index.is_none() {
            return Err(Refusal::NoIndex);
        }
        if self.track.index_distance.is_some() {
            return Err(Refusal::IndexMoved);
        }
        self.offset = back.plus(ElectricalAngle::from_turns(lag)).plus(self.index_angle(reading));
        match self.stored {
            Some(stored) if self.offset.since(stored).abs() > GREATEST_STORED_ERROR => {
                Err(Refusal::StoredOffset)
            }
            Some(stored) => {
                self.offset = stored;
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// Angle to add to the offset because rotor positions count from the index; zero without an index.
    fn index_angle(&self, reading: &Reading<'_>) -> ElectricalAngle {
        let scale = &reading.bench.scale;
        let index = self.track.index.unwrap_or(0);
        scale.angle(scale.within_turn(index)).minus(scale.angle(0))
    }

    fn result(&self, reading: &Reading<'_>) -> ScanResult {
        let from_index = self.track.way.wrapping_sub(self.track.index.unwrap_or(0));
        ScanResult { offset: self.offset, position: reading.bench.scale.within_turn(from_index) }
    }
}
