//! The encoder: the field turns slowly, a whole turn of the motor forwards and one back, and the rotor with it.
//!
//! ```text
//! deviation = field - angle(place)                         of every tick, turns
//! offset = (mean deviation forwards + mean deviation backwards) / 2
//! lag    = (mean deviation forwards - mean deviation backwards) / 2        friction / holding torque
//! ```
//!
//! Whole turns, so that cogging and an encoder off its centre average out; both ways, so that friction and the loop's delay
//! cancel. Current is held by the current loop of the axis in a frame that the field defines, not the encoder: its
//! quadrature axis lies along the field.
//!
//! Field and rotor are a spring and a mass with hardly a damper: sqrt(pole pairs * holding torque / inertia), some 20 Hz. A field
//! that jumps to its speed leaves the rotor swinging by a tenth of an electrical turn and more, for as long as the way lasts; so
//! it takes and loses its speed evenly within one electrical turn at either end, in which nothing is measured.
//!
//! ```text
//! t_a = 2 run-in / v;     field = v t^2 / (2 t_a),  v (t - t_a / 2),  way - v (t_end - t)^2 / (2 t_a)
//! ```
//!
//! Judged in this order: the counter moved at all; with the field; by one turn's counts to an eighth of an electrical
//! turn; evenly (deviations within a third of a turn of their first, lag below a sixth); the index at one place.
//!
//! With a stored offset the field turns until the index has come, one turn forwards or else back, and the rotor must stand
//! where the offset says, to a sixth of an electrical turn.

use super::{Outcome, Reading, Refusal};
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::{CurrentGains, CurrentLoop, ElectricalAngle, Rotating, Sine};
use crate::units::Volt;

/// The field takes its speed at the beginning of each way and loses it at the end, electrical turns.
const RUN_IN_TURNS: f32 = 1.0;
const REST_TICKS: u32 = CURRENT_RATE_HZ / 5;
const FALL_TICKS: u32 = CURRENT_RATE_HZ / 20;
/// Electrical turns.
const GREATEST_TRAVEL_ERROR: f32 = 0.125;
const GREATEST_UNEVENNESS: f32 = 1.0 / 3.0;
const GREATEST_LAG: f32 = 1.0 / 6.0;
/// Less is vibration, electrical turns.
const LEAST_TRAVEL: f32 = 0.1;
/// How far pole pairs may be from a whole number to be named.
const WHOLE: f32 = 0.1;
/// Counts between index pulses read from either side.
const INDEX_WIDTH: i32 = 4;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ScanResult {
    /// At place zero.
    pub offset: ElectricalAngle,
    /// Of the last sample.
    pub place: i32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Leg {
    /// At the beginning and before the way back.
    Rest,
    Forwards,
    Backwards,
    /// At the place of the index, with a stored offset.
    Judge,
    /// The current falls to zero.
    Fall,
}

/// Mean deviation of field and rotor over one way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Deviation {
    first: ElectricalAngle,
    sum: f32,
    ticks: u32,
    uneven: bool,
}

impl Deviation {
    fn push(&mut self, deviation: ElectricalAngle) {
        if self.ticks == 0 {
            self.first = deviation;
        }
        let from_first = deviation.since(self.first);
        self.uneven |= from_first.abs() > GREATEST_UNEVENNESS;
        self.sum += from_first;
        self.ticks += 1;
    }

    fn mean(&self) -> ElectricalAngle {
        self.first.plus(ElectricalAngle::from_turns(self.sum / self.ticks.max(1) as f32))
    }
}

/// How far the field has come on a way of `length` turns after so many s.
fn travelled(seconds: f32, length: f32, turns_per_s: f32) -> f32 {
    let half_rise_s = RUN_IN_TURNS / turns_per_s;
    let end_s = length / turns_per_s + 2.0 * half_rise_s;
    let curved = |seconds: f32| 0.25 * turns_per_s / half_rise_s * seconds * seconds;
    if seconds < 2.0 * half_rise_s {
        curved(seconds)
    } else if seconds < end_s - 2.0 * half_rise_s {
        turns_per_s * (seconds - half_rise_s)
    } else if seconds < end_s {
        length - curved(end_s - seconds)
    } else {
        length
    }
}

/// The field has its speed there.
fn steadily(turned: f32, length: f32) -> bool {
    turned > RUN_IN_TURNS && turned <= length - RUN_IN_TURNS
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scan {
    gains: CurrentGains,
    current_loop: CurrentLoop,
    stored: Option<ElectricalAngle>,
    leg: Leg,
    /// Of this leg.
    ticks: u32,
    /// Field at the beginning of the leg and now, electrical turns, not reduced.
    begin_turns: f32,
    field_turns: f32,
    counter: Option<u16>,
    /// Counts from the beginning, growing with the field where all is well.
    way: i32,
    /// The way where measuring began and where it is now.
    measured: Option<[i32; 2]>,
    deviation: Deviation,
    forwards: Option<ElectricalAngle>,
    /// Where on the way the index came first.
    index: Option<i32>,
    /// A distance of two index pulses that is no whole number of turns.
    index_distance: Option<i32>,
    offset: ElectricalAngle,
}

impl Scan {
    /// `begin` is the voltage that holds the current along phase A so far.
    pub(super) fn new(gains: CurrentGains, begin: Volt, stored: Option<ElectricalAngle>) -> Self {
        Self {
            gains,
            current_loop: CurrentLoop::holding(Rotating { d: Volt::ZERO, q: begin }),
            stored,
            leg: Leg::Rest,
            ticks: 0,
            begin_turns: 0.0,
            field_turns: 0.0,
            counter: None,
            way: 0,
            measured: None,
            deviation: Deviation::default(),
            forwards: None,
            index: None,
            index_distance: None,
            offset: ElectricalAngle::ZERO,
        }
    }

    pub(super) fn tick(&mut self, reading: &Reading<'_>) -> Result<Outcome<ScanResult>, Refusal> {
        let bench = reading.bench;
        self.follow(reading);
        let pairs = f32::from(bench.pole_pairs);
        let length = pairs + 2.0 * RUN_IN_TURNS;
        let seconds = self.ticks as f32 * (1.0 / CURRENT_RATE_HZ as f32);
        self.ticks += 1;
        let mut share = 1.0;
        match self.leg {
            Leg::Rest if self.ticks < REST_TICKS => {}
            Leg::Rest if self.field_turns > 0.0 => self.begin(Leg::Backwards),
            Leg::Rest => self.begin(Leg::Forwards),
            Leg::Forwards => {
                let turned = travelled(seconds, length, bench.settings.turns_per_s);
                self.field_turns = turned;
                if self.searched() {
                    self.begin(Leg::Judge);
                } else {
                    self.measure(reading, steadily(turned, length));
                    if turned >= length {
                        self.end_forwards(reading)?;
                        self.begin(Leg::Rest);
                    }
                }
            }
            Leg::Backwards => {
                let length = if self.stored.is_some() { 2.0 * length } else { length };
                let turned = travelled(seconds, length, bench.settings.turns_per_s);
                self.field_turns = self.begin_turns - turned;
                if self.searched() {
                    self.begin(Leg::Judge);
                } else {
                    self.measure(reading, steadily(turned, length));
                    if turned >= length {
                        self.end_backwards(reading)?;
                        self.begin(Leg::Fall);
                    }
                }
            }
            Leg::Judge if self.ticks < REST_TICKS => {
                if self.ticks > REST_TICKS / 2 {
                    self.measure_from_index(reading);
                }
            }
            Leg::Judge => {
                self.judge_stored()?;
                self.begin(Leg::Fall);
            }
            Leg::Fall => {
                share = 1.0 - self.ticks as f32 / FALL_TICKS as f32;
                if self.ticks >= FALL_TICKS {
                    return Ok(Outcome::Passed(self.result(reading)));
                }
            }
        }
        let target = bench.settings.current * share;
        let frame = self.field().minus(ElectricalAngle::from_turns(0.25)).rotation(Sine::Exact);
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
        self.measured = None;
        self.deviation = Deviation::default();
    }

    fn field(&self) -> ElectricalAngle {
        ElectricalAngle::from_turns(self.field_turns)
    }

    /// The index has come and is all that is looked for.
    fn searched(&self) -> bool {
        self.stored.is_some() && self.index.is_some()
    }

    /// Moves the way on by what the counter did, and notes the index.
    fn follow(&mut self, reading: &Reading<'_>) {
        let sign = reading.bench.direction.sign();
        let now = reading.sample.encoder_count;
        let step = now.wrapping_sub(self.counter.unwrap_or(now)).cast_signed();
        self.counter = Some(now);
        self.way = self.way.wrapping_add(sign * i32::from(step));
        let Some(at) = reading.sample.index_count.filter(|_| reading.bench.index) else { return };
        let index = self.way.wrapping_sub(sign * i32::from(now.wrapping_sub(at).cast_signed()));
        let first = *self.index.get_or_insert(index);
        let distance = (index.wrapping_sub(first)).wrapping_abs();
        let turn = reading.bench.scale.counts_per_turn();
        let beyond = distance.rem_euclid(turn);
        if beyond.min(turn - beyond) > INDEX_WIDTH {
            self.index_distance = Some(distance);
        }
    }

    /// Place on the way within one turn.
    fn place(&self, reading: &Reading<'_>, way: i32) -> i32 {
        way.rem_euclid(reading.bench.scale.counts_per_turn())
    }

    fn measure(&mut self, reading: &Reading<'_>, measuring: bool) {
        if measuring {
            let [from, _] = self.measured.unwrap_or([self.way; 2]);
            self.measured = Some([from, self.way]);
            let rotor = reading.bench.scale.angle(self.place(reading, self.way));
            self.deviation.push(self.field().minus(rotor));
        }
    }

    fn end_forwards(&mut self, reading: &Reading<'_>) -> Result<(), Refusal> {
        if self.stored.is_some() {
            return Ok(());
        }
        let bench = reading.bench;
        let [from, to] = self.measured.unwrap_or_default();
        let travel = to.wrapping_sub(from);
        let turn = bench.scale.counts_per_turn() as f32;
        let pairs = f32::from(bench.pole_pairs);
        let electrical = travel as f32 * pairs / turn;
        if electrical.abs() < LEAST_TRAVEL {
            return Err(Refusal::NoCounts);
        }
        if electrical < 0.0 {
            return Err(Refusal::Direction);
        }
        if (electrical - pairs).abs() > GREATEST_TRAVEL_ERROR {
            let fitting = pairs * turn / travel as f32;
            let whole = (fitting + 0.5) as u8;
            return Err(match self.index_distance {
                Some(distance) => Refusal::CountsPerTurn(distance.unsigned_abs()),
                None if (fitting - f32::from(whole)).abs() < WHOLE => Refusal::PolePairs(whole),
                None => Refusal::CountsPerTurn(travel.unsigned_abs()),
            });
        }
        if self.deviation.uneven {
            return Err(Refusal::Slipped);
        }
        self.forwards = Some(self.deviation.mean());
        Ok(())
    }

    fn end_backwards(&mut self, reading: &Reading<'_>) -> Result<(), Refusal> {
        let index_missing = reading.bench.index && self.index.is_none();
        let Some(forwards) = self.forwards else { return Err(Refusal::NoIndex) };
        let backwards = self.deviation.mean();
        let lag = forwards.since(backwards) * 0.5;
        if self.deviation.uneven || lag.abs() > GREATEST_LAG {
            return Err(Refusal::Slipped);
        }
        if index_missing {
            return Err(Refusal::NoIndex);
        }
        if self.index_distance.is_some() {
            return Err(Refusal::IndexMoved);
        }
        self.offset = backwards.plus(ElectricalAngle::from_turns(lag));
        Ok(())
    }

    /// As `measure`, of places from the index on.
    fn measure_from_index(&mut self, reading: &Reading<'_>) {
        let Some(index) = self.index else { return };
        let rotor = reading.bench.scale.angle(self.place(reading, self.way.wrapping_sub(index)));
        self.deviation.push(self.field().minus(rotor));
    }

    fn judge_stored(&self) -> Result<(), Refusal> {
        let Some(offset) = self.stored.filter(|_| self.deviation.ticks > 0) else {
            return Err(Refusal::NoIndex);
        };
        if self.deviation.mean().since(offset).abs() > GREATEST_LAG {
            return Err(Refusal::StoredOffset);
        }
        Ok(())
    }

    /// Places from the index on, if there is one.
    fn result(&self, reading: &Reading<'_>) -> ScanResult {
        let scale = &reading.bench.scale;
        let Some(index) = self.index else {
            return ScanResult { offset: self.offset, place: self.place(reading, self.way) };
        };
        let moved = scale.angle(self.place(reading, index)).minus(scale.angle(0));
        let offset = self.stored.unwrap_or(self.offset.plus(moved));
        ScanResult { offset, place: self.place(reading, self.way.wrapping_sub(index)) }
    }
}
