//! Encoder scan: the field turns the rotor slowly, about one turn of the motor and back.
//!
//! ```text
//! deviation = field - angle(position)                      of every tick, turns
//! offset = (mean deviation forwards + mean deviation backwards) / 2
//! lag    = (mean deviation forwards - mean deviation backwards) / 2        asin(friction / holding torque)
//! ```
//!
//! Both ways cancel friction and the loop's delay, but not a load: [`super::refine`] removes its effect.
//! The path is one turn, or what the permitted travel leaves after run-in, run-out and the first alignment.
//!
//! Checks of the forward pass, in this order:
//!
//! 1. The counter moved at all, and in the field's direction.
//! 2. Equal travel in every electrical turn of the field. Otherwise the rotor slipped, and its
//!    counts mean nothing.
//! 3. Travel of the field's turns to 0.4 of an electrical turn: detects other pole pairs.
//! 4. Travel of the field's turns to a fifth of an electrical turn: detects other counts per turn.
//! 5. Deviations within 108 degrees of the first.
//!
//! The backward pass must be as even and as long; then lag and index position are checked. A rotor that moves
//! beyond the permitted travel is judged by the same checks at once.
//!
//! **Direction.** A leg that is lifted may become too heavy on the way. Two probes back and forth over one
//! electrical turn, with 1.25 and 1.1 of the calibration's current, tell which way the load pulls: their mean
//! deviations differ by 4.4 degrees at a load of 0.6. The scan goes with the load.
//!
//! **Current.** A quarter more than the calibration's: a load of 0.6, friction of 0.25 and the load's
//! growth on the way then leave the rotor held.
//!
//! **Limit of the lag.** Friction may take half of the torque that the calibration's current holds.

use super::field::FieldWay;
use super::track::Followed;
use super::{Bench, FieldCurrent, Outcome, Reading, Refusal, STRONG_SHARE};
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::{ElectricalAngle, Rotating, Stationary};
use crate::real::{clamp, min};
use crate::units::{Ampere, Volt};

/// Length of a probe, electrical turns, and its speed over the scan's: its run-in is short.
const PROBE_TURNS: f32 = 1.0;
const PROBE_SPEED_SHARE: f32 = 1.0 / 3.0;
/// Least difference of the probes' means that tells the load's direction, electrical turns.
const LEAST_PULL: f32 = 1.5 / 360.0;
const REST_TICKS: u32 = CURRENT_RATE_HZ / 5;
/// Shortest and longest run-in and run-out, electrical turns; the longest where the permitted travel
/// suffices.
const RUN_IN_TURNS: [f32; 2] = [0.25, 1.0];
/// Travel kept for the first alignment (half a turn), the turn from axis C to A (two thirds) and lag,
/// electrical turns.
pub(crate) const ALIGNMENT_TURNS: f32 = 1.4;
/// Greatest error of the forward travel, electrical turns. A load that changes on the way makes up to 0.15.
const GREATEST_TRAVEL_ERROR: f32 = 0.2;
/// Turns of the field are equal to one part in so many where only the counts are wrong.
const STEADY_SHARE: i32 = 8;
/// Above this error, a refinement that fails at the path's end names other counts per turn.
const DOUBTFUL_TRAVEL_ERROR: f32 = 0.1;
/// Lower bound of the error by wrong pole pairs, electrical turns: p and p + 1 differ by p / (p + 1).
const LEAST_MISTAKE: f32 = 0.4;
/// Greatest difference between both passes, electrical turns.
const GREATEST_DIFFERENCE: f32 = 0.25;
/// Greatest lag, electrical turns: asin(0.5 / 1.25).
const GREATEST_LAG: f32 = 23.6 / 360.0;
/// Current of the weaker probe over the calibration's.
const WEAK_SHARE: f32 = 1.1;
/// Less travel is vibration, electrical turns.
const LEAST_TRAVEL: f32 = 0.1;
/// Greatest distance from a whole number at which pole pairs are reported.
const WHOLE: f32 = 0.1;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ScanResult {
    /// Electrical angle at travel zero, without regard to a load.
    pub(crate) offset: ElectricalAngle,
    /// Travel of the last sample, counts, and the field that holds the rotor there.
    pub(crate) way: i32,
    pub(crate) field: ElectricalAngle,
    /// Half of the difference between both directions' deviations.
    pub(crate) lag: ElectricalAngle,
    /// Counts per turn that fit the travel better than the configured ones, if any do.
    pub(crate) fitting_counts: Option<u32>,
    /// Path that the rotor has passed from there, electrical turns, with its sign.
    pub(crate) path: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scan {
    current: FieldCurrent,
    /// Number of the pass: probe, weaker probe, scan, each forwards and back.
    pass: u8,
    /// The rotor rests before the pass.
    rests: bool,
    /// Direction of the forward passes, 1 or -1.
    direction: f32,
    /// Ticks of the rest or of the pass.
    ticks: u32,
    /// Angle of the field at the beginning of the pass and now, electrical turns, not reduced.
    begin_turns: f32,
    field_turns: f32,
    followed: Followed,
    forwards: Followed,
    fitting_counts: Option<u32>,
    /// Mean deviation of the first probe.
    probed: Option<ElectricalAngle>,
}

const FIRST_OF_SCAN: u8 = 4;

impl Scan {
    /// `current` holds the rotor along phase A.
    pub(super) fn new(current: FieldCurrent) -> Self {
        Self {
            current,
            pass: 0,
            rests: true,
            direction: 1.0,
            ticks: 0,
            begin_turns: 0.0,
            field_turns: 0.0,
            followed: Followed::default(),
            forwards: Followed::default(),
            fitting_counts: None,
            probed: None,
        }
    }

    /// Length of the present pass, and of its run-in, electrical turns.
    fn path(&self, bench: &Bench) -> [f32; 2] {
        let pairs = f32::from(bench.pole_pairs);
        let [least, most] = RUN_IN_TURNS;
        if self.pass < FIRST_OF_SCAN {
            return [PROBE_TURNS, least];
        }
        let possible = bench.settings.travel_turns * pairs - ALIGNMENT_TURNS;
        let run_in = clamp(0.5 * (possible - pairs), least, most);
        [min(pairs + 2.0 * run_in, possible), run_in]
    }

    pub(super) fn tick(
        &mut self,
        reading: &Reading<'_>,
    ) -> Result<Outcome<(ScanResult, FieldCurrent)>, Refusal> {
        let bench = reading.bench;
        self.ticks += 1;
        if reading.is_beyond && (self.rests || self.pass != FIRST_OF_SCAN) {
            return Err(Refusal::Travel);
        }
        if self.rests {
            if self.ticks >= REST_TICKS {
                (self.rests, self.ticks, self.begin_turns) = (false, 0, self.field_turns);
                self.followed = Followed::default();
            }
            return Ok(Outcome::Running(self.hold(reading)));
        }
        let ([path, run_in], is_back) = (self.path(bench), self.pass % 2 == 1);
        let share = if self.pass < FIRST_OF_SCAN { PROBE_SPEED_SHARE } else { 1.0 };
        let way = FieldWay::over(path, run_in, share * bench.settings.turns_per_s);
        let turned = way.travelled(self.ticks as f32 * (1.0 / CURRENT_RATE_HZ as f32));
        let steady = way.steady(turned);
        let sign = if is_back { -self.direction } else { self.direction };
        self.field_turns = self.begin_turns + sign * turned;
        if let Some(turns) = steady {
            self.followed.push(&bench.scale, reading.track.way, self.field(), turns);
        }
        if reading.is_beyond {
            if let Some(turns) = steady {
                self.judge(reading, turns)?;
            }
            return Err(Refusal::Travel);
        }
        if way.ended(turned) {
            if !is_back {
                if self.pass == FIRST_OF_SCAN {
                    self.judge(reading, path - 2.0 * run_in)?;
                }
                self.forwards = self.followed;
            } else if self.pass < FIRST_OF_SCAN {
                self.end_probe();
            } else {
                let (offset, lag) = self.end_backwards(reading)?;
                let (way, path) = (reading.track.way, self.direction * path);
                let fitting_counts = self.fitting_counts;
                let result = ScanResult { offset, way, field: self.field(), lag, fitting_counts, path };
                return Ok(Outcome::Passed((result, self.current)));
            }
            (self.pass, self.rests, self.ticks) = (self.pass + 1, true, 0);
        }
        Ok(Outcome::Running(self.hold(reading)))
    }

    /// Mean deviation of the last two passes.
    fn mean(&self) -> ElectricalAngle {
        let (there, back) = (self.forwards.deviation.mean(), self.followed.deviation.mean());
        back.plus(ElectricalAngle::from_turns(0.5 * there.since(back)))
    }

    /// Takes a probe; the second one decides the direction.
    fn end_probe(&mut self) {
        let mean = self.mean();
        // A rotor that a load pulls back lies further behind the weaker field.
        if self.probed.replace(mean).is_some_and(|stronger| mean.since(stronger) > LEAST_PULL) {
            self.direction = -1.0;
        }
    }

    /// Voltage that holds the current along the field.
    fn hold(&mut self, reading: &Reading<'_>) -> Stationary<Volt> {
        // The change takes the rest before the pass.
        let changed = if self.rests { self.ticks as f32 / REST_TICKS as f32 } else { 1.0 };
        let weaker = match self.pass {
            2 => changed,
            3 => 1.0,
            FIRST_OF_SCAN => 1.0 - changed,
            _ => 0.0,
        };
        let share = STRONG_SHARE + (WEAK_SHARE - STRONG_SHARE) * weaker;
        let target = Rotating { d: reading.bench.settings.current * share, q: Ampere::ZERO };
        self.current.voltage(reading, self.field(), target)
    }

    fn field(&self) -> ElectricalAngle {
        ElectricalAngle::from_turns(self.field_turns)
    }

    /// Judges the forward pass over so many turns of the field.
    fn judge(&mut self, reading: &Reading<'_>, turns: f32) -> Result<(), Refusal> {
        let bench = reading.bench;
        let counts = self.followed.travel.counts();
        let pairs = f32::from(bench.pole_pairs);
        let electrical = self.direction * bench.electrical(counts);
        if electrical.abs() < LEAST_TRAVEL {
            return Err(Refusal::NoCounts);
        }
        if electrical < 0.0 {
            return Err(Refusal::Direction);
        }
        self.followed.must_be_even()?;
        let fitting_counts = (self.direction * counts as f32 * pairs / turns) as u32;
        if (electrical - turns).abs() > LEAST_MISTAKE {
            let fitting = pairs * turns / electrical;
            let whole = (fitting + 0.5) as u8;
            return Err(match reading.track.index_distance {
                Some(distance) => bench.other_counts(distance.unsigned_abs()),
                None if (fitting - f32::from(whole)).abs() < WHOLE => {
                    Refusal::PolePairs { stated: bench.pole_pairs, found: whole }
                }
                None => bench.other_counts(fitting_counts),
            });
        }
        if (electrical - turns).abs() > GREATEST_TRAVEL_ERROR {
            // Other counts leave the turns of the field equal; cogging does not.
            let is_steady = self.followed.travel.is_even(STEADY_SHARE);
            return Err(if is_steady { bench.other_counts(fitting_counts) } else { Refusal::Slipped });
        }
        self.followed.must_keep_to_the_field()?;
        self.fitting_counts = ((electrical - turns).abs() > DOUBTFUL_TRAVEL_ERROR).then_some(fitting_counts);
        Ok(())
    }

    /// Judges the backward pass and returns offset and lag.
    fn end_backwards(&self, reading: &Reading<'_>) -> Result<(ElectricalAngle, ElectricalAngle), Refusal> {
        self.followed.must_be_even()?;
        self.followed.must_keep_to_the_field()?;
        let apart = self.forwards.travel.counts().wrapping_add(self.followed.travel.counts());
        // Positive where the rotor lags, whichever direction came first.
        let lag = self.forwards.deviation.mean().since(self.followed.deviation.mean()) * 0.5 * self.direction;
        if reading.bench.electrical(apart).abs() > GREATEST_DIFFERENCE || lag.abs() > GREATEST_LAG {
            return Err(Refusal::Slipped);
        }
        if reading.bench.index && reading.track.index.is_none() {
            return Err(Refusal::NoIndex);
        }
        if reading.track.index_distance.is_some() {
            return Err(Refusal::IndexMoved);
        }
        Ok((self.mean(), ElectricalAngle::from_turns(lag)))
    }
}
