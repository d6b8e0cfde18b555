//! Exact offset of a rotor that carries a load: the rotor turns slowly while the direct current is reversed.
//!
//! Why: a field that drags the rotor lags by asin(load / holding torque), and gravity acts the same way in
//! both directions. The scan's offset may therefore be wrong by 46 degrees (0.9 of 1.25). Here a position
//! loop turns the rotor over the same path with direct currents of +a and -a. An offset error e turns part
//! of it into torque:
//!
//! ```text
//! torque = k (i_q cos e + i_d sin e)                   the same path and direction need the same torque:
//! tan e  = (i_q(-a) - i_q(+a)) / (2 a)                 30 A tan e: 1.05 A for 2 degrees at 15 A
//!
//! i_q    = work over the path / angle                  the sum of i_q times counts, over the counts
//! saliency: i_q counts (1 + (L_d - L_q) i_d / flux) times
//! load = mean of i_q forwards and backwards,   friction = half of their difference
//! ```
//!
//! The work over a path is what friction, gravity and cogging take on it, whatever the speed does in between.
//!
//! | round | at the path's | direct current | removes |
//! | --- | --- | --- | --- |
//! | 1 | beginning | a sixth of the holding current | the scan's error |
//! | 2 | beginning | holding current | the rest |
//! | 3 | end | holding current | nothing: it shows wrong counts per turn, whose error grows with the path |
//!
//! The offset is the mean of both ends. Each path begins with a part in which nothing is measured, so that
//! the gear has passed its backlash.
//!
//! Position loop: PI on the angle, damped by the speed. With the stated inertia J its poles lie at -1.42 w_n
//! and, with a damping of 0.69, at 0.42 w_n:
//!
//! ```text
//! b = pole pairs k / J          angular acceleration per ampere, electrical
//! K = w_n^2 / b,   D = 2 w_n / b,   integral K w_n / 4          w_n = sqrt(2 b a / 1 rad), at most 140 rad/s
//! ```
//!
//! The friction that the scan's lag shows is fed forward.
//!
//! Source: the torque of a salient machine, for instance D. W. Novotny and T. A. Lipo, Vector Control and
//! Dynamics of AC Drives, 1996. Limit: friction must not change while the direct current is reversed.

use super::field::FieldWay;
use super::inductance::{Inductances, SeenInductances};
use super::scan::ScanResult;
use super::{Bench, FieldCurrent, Outcome, Reading, Refusal, STRONG_SHARE};
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::{ElectricalAngle, Rotating, Rotation, SpeedTracker};
use crate::real::{abs, atan2, clamp, min, sign, sqrt};
use crate::units::Ampere;
use core::f32::consts::TAU;

const TICK_S: f32 = 1.0 / CURRENT_RATE_HZ as f32;
const RAMP_TICKS: u32 = CURRENT_RATE_HZ / 4;
const FALL_TICKS: u32 = CURRENT_RATE_HZ / 20;
/// Share of the holding current used as direct current in the first round.
const FIRST_SHARE: f32 = 1.0 / 6.0;
/// Greatest quadrature current over the calibration's: a load of 0.9 and friction of 0.25 take 1.15, and an
/// angle that is 46 degrees off makes 1.6 of it. The axis' own limit applies to the whole vector.
pub(super) const QUADRATURE_SHARE: f32 = 1.6;
/// Measured part of a path, and the part before it, turns of the motor.
const PATH_TURNS: f32 = 0.22;
const APPROACH_TURNS: f32 = 0.1;
/// Run-in and run-out of each motion, electrical turns.
const RUN_IN_TURNS: f32 = 0.25;
/// Bound for light rotors: at a third of the stated inertia the damping's crossover, 6 w_n, must stay below
/// the speed tracking, 1000 rad/s, and the current loop.
const GREATEST_FREQUENCY: f32 = 140.0;
/// A shorter motion is none, electrical turns.
const LEAST_DISTANCE: f32 = 1e-3;
/// Greatest distance from the commanded position, electrical turns.
const GREATEST_ERROR: f32 = 0.75;
/// Greatest load at the beginning and at the end of the path, over the torque that the calibration's current
/// holds. A pose of 0.6 is permitted. On the path the load may grow up to the second value.
const GREATEST_LOADS: [f32; 2] = [0.63, 0.9];
/// Greatest distance from home at the end, electrical turns.
const GREATEST_DISTANCE: f32 = 0.2;
/// Greatest difference of the offsets at both ends, electrical turns, beside the encoder's own errors.
const GREATEST_DRIFT: f32 = 6.0 / 360.0;

/// Work of the quadrature current over a path: sums of ampere times counts, and of counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Work {
    sum: f32,
    counts: i32,
}

impl Work {
    /// Mean current; zero where the rotor did not move.
    fn mean(&self) -> f32 {
        if self.counts == 0 { 0.0 } else { self.sum / self.counts as f32 }
    }
}

/// Path on which a round turns the rotor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Path {
    /// At the beginning of the scan's path.
    First,
    /// At its end.
    Last,
}

/// Position at the end of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Low(Path),
    High(Path),
    /// Where the calibration began.
    Home,
}

/// One motion, or a ramp of the direct current at rest: position and direct current at its end. The current
/// is a share of the holding current.
type Action = (Place, f32);

/// A round on a path: both ways with a positive direct current, both ways with a negative one, then without.
const fn round(path: Path, share: f32) -> [Action; 7] {
    let (low, high) = (Place::Low(path), Place::High(path));
    [(low, share), (high, share), (low, share), (low, -share), (high, -share), (low, -share), (low, 0.0)]
}

const ROUNDS: [[Action; 7]; 3] =
    [round(Path::First, FIRST_SHARE), round(Path::First, 1.0), round(Path::Last, 1.0)];
const ACTIONS_PER_ROUND: usize = 7;

/// Results of the refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Refined {
    /// Electrical angle at travel zero.
    pub offset: ElectricalAngle,
    pub inductances: Inductances,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Refine {
    current: FieldCurrent,
    stiffness: f32,
    damping: f32,
    integral_gain: f32,
    scan: ScanResult,
    /// Angle at travel zero as now assumed.
    offset: ElectricalAngle,
    tracker: SpeedTracker,
    /// Number of the present action.
    action: usize,
    ticks: u32,
    /// Position at the present action's beginning, electrical turns, and direct current, A.
    from: f32,
    direct: f32,
    integral: f32,
    way: i32,
    /// By sign of the direct current (positive first), then by direction (forwards first).
    work: [[Work; 2]; 2],
    /// Quadrature current that friction takes.
    friction: f32,
}

impl Refine {
    /// Takes over a rotor that rests in the field of a scan.
    pub(super) fn new(bench: &Bench, current: FieldCurrent, scan: ScanResult) -> Self {
        let holding = bench.settings.current.0;
        let pairs = f32::from(bench.pole_pairs);
        let gain = 1.5 * pairs * pairs * bench.flux.0 / bench.settings.inertia.0;
        let frequency = min(sqrt(2.0 * gain * holding), GREATEST_FREQUENCY);
        let stiffness = frequency * frequency / gain;
        let rotor = bench.angle(scan.way).plus(scan.offset);
        let ahead = scan.field.minus(rotor);
        let Rotation { sine, cosine } = ahead.rotation();
        Self {
            current: current.turned(ahead),
            stiffness,
            damping: 2.0 * frequency / gain,
            integral_gain: stiffness * frequency / 4.0,
            scan,
            offset: scan.offset,
            tracker: SpeedTracker::at(rotor),
            action: 0,
            ticks: 0,
            from: bench.electrical(scan.way),
            direct: STRONG_SHARE * holding * cosine,
            integral: STRONG_SHARE * holding * sine,
            way: scan.way,
            work: [[Work::default(); 2]; 2],
            friction: STRONG_SHARE * holding * scan.lag.rotation().sine,
        }
    }

    /// Number of the present action.
    #[cfg(test)]
    pub(super) fn number(&self) -> usize {
        self.action
    }

    /// The present action; `None` when the current falls at the end.
    fn action(&self) -> Option<Action> {
        if self.action == ROUNDS.len() * ACTIONS_PER_ROUND {
            return Some((Place::Home, 0.0));
        }
        ROUNDS.as_flattened().get(self.action).copied()
    }

    /// Position of a place, electrical turns.
    fn place(&self, bench: &Bench, place: Place) -> f32 {
        let pairs = f32::from(bench.pole_pairs);
        let length = min((APPROACH_TURNS + PATH_TURNS) * pairs, abs(self.scan.path)) * sign(self.scan.path);
        let begin = bench.electrical(self.scan.way);
        let end = begin + self.scan.path;
        match place {
            Place::Home => 0.0,
            Place::Low(Path::First) => begin,
            Place::High(Path::First) => begin + length,
            Place::Low(Path::Last) => end - length,
            Place::High(Path::Last) => end,
        }
    }

    /// `seen` are the inductances, and the travel at which they were measured along phase A.
    pub(super) fn tick(
        &mut self,
        reading: &Reading<'_>,
        seen: (&SeenInductances, i32),
    ) -> Result<Outcome<Refined>, Refusal> {
        let bench = reading.bench;
        let way = reading.track.way;
        let holding = bench.settings.current.0;
        let mut rotor = bench.angle(way).plus(self.offset);
        self.tracker.track(rotor);
        let seconds = self.ticks as f32 * TICK_S;
        self.ticks += 1;
        let (to, direct) = match self.action() {
            Some((place, share)) => (self.place(bench, place), holding * share),
            None => (self.from, 0.0),
        };
        let distance = to - self.from;
        let motion = FieldWay::over(
            abs(distance),
            min(RUN_IN_TURNS, 0.25 * abs(distance)),
            bench.settings.turns_per_s,
        );
        let is_ramp = abs(distance) < LEAST_DISTANCE;
        let (moved, speed) =
            if is_ramp { (0.0, 0.0) } else { (motion.travelled(seconds), motion.speed(seconds)) };
        let sign = sign(distance);
        let error = TAU * (self.from + sign * moved - bench.electrical(way));
        if abs(error) > TAU * GREATEST_ERROR {
            // With wrong counts per turn the angle is lost on the way to the path's end.
            let is_last = self.action / ACTIONS_PER_ROUND + 1 == ROUNDS.len();
            let counts = self.scan.fitting_counts.filter(|_| is_last);
            return Err(counts.map_or(Refusal::Slipped, Refusal::CountsPerTurn));
        }
        let measured = reading.current.to_rotating(rotor.rotation());
        self.measure(bench, way, direct, distance, measured.q.0);

        let most = bench.quadrature_a;
        self.integral = clamp(self.integral + self.integral_gain * error * TICK_S, -most, most);
        let late = TAU * sign * speed - self.tracker.rad_per_s();
        let friction = self.friction * sign * speed / bench.settings.turns_per_s;
        let wanted = self.stiffness * error + self.damping * late + self.integral + friction;
        let share = min(self.ticks as f32 / RAMP_TICKS as f32, 1.0);
        let mut target = Rotating {
            d: Ampere(self.direct + share * (direct - self.direct)),
            q: Ampere(clamp(wanted, -most, most)),
        };
        let is_over = if is_ramp { self.ticks >= RAMP_TICKS } else { motion.ended(moved) };
        if self.action().is_none() {
            let left = 1.0 - self.ticks as f32 / FALL_TICKS as f32;
            target = Rotating { d: target.d * left, q: target.q * left };
            // A counter that froze on the last stretch has not arrived.
            if self.ticks == 1 && abs(error) > TAU * GREATEST_DISTANCE {
                return Err(Refusal::Slipped);
            }
            if self.ticks >= FALL_TICKS {
                let inductances = self.inductances(bench, seen);
                return Ok(Outcome::Passed(Refined { offset: self.offset, inductances }));
            }
        } else if is_over {
            if self.direct != 0.0 && direct == 0.0 {
                self.evaluate(bench, seen)?;
                rotor = bench.angle(way).plus(self.offset);
            }
            (self.action, self.ticks, self.from, self.direct) = (self.action + 1, 0, to, direct);
        }
        Ok(Outcome::Running(self.current.voltage(reading, rotor, target)))
    }

    /// Adds this tick's work. The approach of each motion is left out, and motions in which the direct
    /// current changes.
    fn measure(&mut self, bench: &Bench, way: i32, direct: f32, distance: f32, quadrature: f32) {
        let step = way.wrapping_sub(self.way);
        self.way = way;
        let approach = APPROACH_TURNS / (APPROACH_TURNS + PATH_TURNS) * abs(distance);
        let begun = abs(bench.electrical(way) - self.from) > approach && self.direct == direct;
        let (reversed, back) = (usize::from(direct < 0.0), usize::from(distance < 0.0));
        if let Some(work) = self.work.get_mut(reversed).and_then(|work| work.get_mut(back))
            && begun
            && abs(distance) >= LEAST_DISTANCE
        {
            work.sum += step as f32 * quadrature;
            work.counts += step;
        }
    }

    fn inductances(&self, bench: &Bench, (seen, at): (&SeenInductances, i32)) -> Inductances {
        seen.along_flux(ElectricalAngle::ZERO.minus(bench.angle(at).plus(self.offset)))
    }

    /// Corrects the offset by what a round found.
    fn evaluate(&mut self, bench: &Bench, seen: (&SeenInductances, i32)) -> Result<(), Refusal> {
        let [[forth, back], [forth_reversed, back_reversed]] = core::mem::take(&mut self.work);
        let round = self.action / ACTIONS_PER_ROUND;
        let holding = bench.settings.current.0;
        let direct = holding * if round == 0 { FIRST_SHARE } else { 1.0 };
        let Inductances { direct: along, quadrature: across } = self.inductances(bench, seen);
        // The first round's error is too large for a correction by saliency.
        let saliency = if round == 0 { 0.0 } else { (along.0 - across.0) * direct / bench.flux.0 };
        let [forth, back] = [forth, back].map(|work| work.mean() * (1.0 + saliency));
        let [forth_reversed, back_reversed] =
            [forth_reversed, back_reversed].map(|work| work.mean() * (1.0 - saliency));
        let rise = 0.5 * (forth_reversed - forth + back_reversed - back);
        let error = atan2(0.5 * rise, direct) / TAU;
        let (forth, back) = (0.5 * (forth + forth_reversed), 0.5 * (back + back_reversed));
        // An error of the angle makes the same torque with more current.
        let Rotation { cosine, .. } = ElectricalAngle::from_turns(error).rotation();
        self.friction = 0.5 * (forth - back) * cosine;
        let load = 0.5 * abs(forth + back) * cosine;
        let [first, last] = GREATEST_LOADS;
        let is_last = round + 1 == ROUNDS.len();
        if load > holding * if is_last { last } else { first } {
            return Err(Refusal::Load((100.0 * load / holding) as u8));
        }
        let mut correction = error;
        if is_last {
            // Centres of both paths, electrical turns apart.
            let apart =
                self.place(bench, Place::Low(Path::Last)) - self.place(bench, Place::Low(Path::First));
            if abs(error) > GREATEST_DRIFT + bench.encoder_error {
                let stated = bench.scale.counts_per_turn() as f32;
                let drift = error / apart;
                return Err(Refusal::CountsPerTurn((stated / (1.0 - drift) + 0.5) as u32));
            }
            correction = 0.5 * error;
        }
        let correction = ElectricalAngle::from_turns(correction);
        self.offset = self.offset.minus(correction);
        self.current = self.current.turned(correction);
        self.tracker = SpeedTracker::at(bench.angle(self.way).plus(self.offset));
        Ok(())
    }
}
