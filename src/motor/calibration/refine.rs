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
//! saliency: i_q counts (1 + (L_d - L_q) i_d / psi) times, psi as measured
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
//! **Flux linkage.** The same motions show the back-EMF, w (psi + L_d i_d), in the voltage across the flux:
//!
//! ```text
//! e   = v_q - R i_q - u_q                              u: dead time and diodes, by the signs of the currents
//! psi = sum of e / (f_PWM angle)                       Wb, whatever the speed does in between
//! ```
//!
//! The mean over +a and -a removes L_d i_d and an error of the angle. The mean over both directions removes
//! the rest of R i_q. At 6 electrical turns per second and 2 mWb e is 75 mV, and u_q up to 100 mV. So u is
//! taken from the resistance's measurement, as the voltage that does not grow with the current. v_q is the
//! current loop's integral: it is the voltage, delayed as much as L delays the current.
//!
//! **Friction.** Forwards the measured path lies further on than backwards. The load's growth from one end of
//! the path to the other removes what the load adds to the friction by that.
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
use super::found::MotorFindings;
use super::inductance::{Inductances, SeenInductances};
use super::repeated::Repeated;
use super::resistance::VoltageDrop;
use super::scan::ScanResult;
use super::{Bench, FieldCurrent, Outcome, Reading, Refusal, STRONG_SHARE};
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::{ElectricalAngle, Rotating, Rotation, SpeedTracker};
use crate::real::{abs, atan2, clamp, max, min, sign, sqrt};
use crate::units::{Ampere, Henry, Weber};
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
/// Least distance of both paths that shows the load's growth, electrical turns.
const LEAST_APART: f32 = 1.0;
/// Greatest difference of the offsets at both ends, electrical turns, beside the encoder's own errors.
const GREATEST_DRIFT: f32 = 6.0 / 360.0;

/// Sums over the path of one motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Work {
    /// Work of the quadrature current, ampere times counts.
    sum: f32,
    counts: i32,
    /// Back-EMF of all ticks, V.
    emf: f32,
    /// Work and counts without the run-out, which returns kinetic energy.
    steady_sum: f32,
    steady_counts: i32,
}

/// Results of one motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Motion {
    /// Mean quadrature current over the path, and without its run-out, A.
    mean: f32,
    steady: f32,
    /// Back-EMF over time by the angle, Wb.
    linkage: f32,
}

impl Work {
    /// Evaluates the motion; zero where the rotor did not move.
    #[inline(never)]
    fn motion(&self, bench: &Bench) -> Motion {
        if self.counts == 0 || self.steady_counts == 0 {
            return Motion::default();
        }
        Motion {
            mean: self.sum / self.counts as f32,
            steady: self.steady_sum / self.steady_counts as f32,
            linkage: self.emf * TICK_S / (TAU * bench.electrical(self.counts)),
        }
    }
}

/// Measurements of one round.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Round {
    /// Error of the assumed offset, electrical turns.
    error: f32,
    /// Half of the difference of that error between forward and backward motions. Weighted by counts, the
    /// rotor is half a count behind its mean position, so the difference has a constant part.
    one_way: f32,
    /// Flux linkage forwards and backwards, Wb.
    flux: [f32; 2],
    /// Friction with a positive and with a negative direct current, A.
    friction: [f32; 2],
    load: f32,
}

impl Round {
    /// Evaluates the motions of a round with this direct current. `difference_h` is L_d - L_q.
    fn new(works: &[[Work; 2]; 2], bench: &Bench, direct: f32, difference_h: f32) -> Self {
        let [plus, minus] = works.each_ref().map(|[forth, back]| [forth.motion(bench), back.motion(bench)]);
        let flux = [0.5 * (plus[0].linkage + minus[0].linkage), 0.5 * (plus[1].linkage + minus[1].linkage)];
        // A flux this wrong is refused at the end.
        let saliency = difference_h * direct / max(0.5 * (flux[0] + flux[1]), 0.5 * bench.flux.0);
        let (with_plus, with_minus) = (1.0 + saliency, 1.0 - saliency);
        let [forth, back] =
            [0, 1].map(|way: usize| [with_plus * plus[way].mean, with_minus * minus[way].mean]);
        let rises = [forth[1] - forth[0], back[1] - back[0]];
        let error = atan2(0.25 * (rises[0] + rises[1]), direct) / TAU;
        // An error of the angle makes the same torque with more current.
        let Rotation { cosine, .. } = ElectricalAngle::from_turns(error).rotation();
        let apart =
            |[forth, back]: [Motion; 2], share: f32| 0.5 * cosine * share * (forth.steady - back.steady);
        Self {
            error,
            one_way: 0.25 * (rises[0] - rises[1]) / (TAU * direct),
            flux,
            friction: [apart(plus, with_plus), apart(minus, with_minus)],
            load: 0.25 * cosine * (forth[0] + forth[1] + back[0] + back[1]),
        }
    }
}

/// Results of the rounds at both ends of the path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct BothEnds {
    flux: Repeated,
    friction: Repeated,
    load: f32,
    /// Electrical turns.
    offset_sigma: f32,
}

impl BothEnds {
    /// Evaluates two rounds `apart` electrical turns from each other. The path that is measured forwards lies
    /// `ahead` electrical turns of the one measured backwards.
    fn new([begin, end]: [Round; 2], apart: f32, ahead: f32) -> Self {
        let growth = if abs(apart) < LEAST_APART { 0.0 } else { (end.load - begin.load) / apart };
        let four = |[one, two]: [f32; 2], [three, four]: [f32; 2]| Repeated::new(&[one, two, three, four]);
        let mut friction = four(begin.friction, end.friction);
        friction.mean -= 0.5 * growth * ahead;
        let ways = end.one_way - begin.one_way;
        Self {
            flux: four(begin.flux, end.flux),
            friction,
            load: 0.5 * (begin.load + end.load),
            offset_sigma: sqrt((end.error * end.error + ways * ways) / 8.0),
        }
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
enum Waypoint {
    Low(Path),
    High(Path),
    /// Where the calibration began.
    Home,
}

/// One motion, or a ramp of the direct current at rest: position and direct current at its end. The current
/// is a share of the holding current.
type Action = (Waypoint, f32);

/// A round on a path: both ways with a positive direct current, both ways with a negative one, then without.
const fn round(path: Path, share: f32) -> [Action; 7] {
    let (low, high) = (Waypoint::Low(path), Waypoint::High(path));
    [(low, share), (high, share), (low, share), (low, -share), (high, -share), (low, -share), (low, 0.0)]
}

const ROUNDS: [[Action; 7]; 3] =
    [round(Path::First, FIRST_SHARE), round(Path::First, 1.0), round(Path::Last, 1.0)];
const ACTIONS_PER_ROUND: usize = 7;

/// Run-in and run-out of a motion of this length, electrical turns.
fn run_in(length: f32) -> f32 {
    min(RUN_IN_TURNS, 0.25 * length)
}

/// Part of a motion in which the gear passes its backlash, electrical turns.
fn approach(length: f32) -> f32 {
    APPROACH_TURNS / (APPROACH_TURNS + PATH_TURNS) * length
}

/// Results of the refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Refined {
    /// Electrical angle at travel zero.
    pub(crate) offset: ElectricalAngle,
    pub(crate) inductances: Inductances,
    /// `None` where the motor has not turned.
    pub(crate) findings: Option<MotorFindings>,
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
    /// Measurements of the preceding round.
    round: Round,
    both_ends: BothEnds,
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
            round: Round::default(),
            both_ends: BothEnds::default(),
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
            return Some((Waypoint::Home, 0.0));
        }
        ROUNDS.as_flattened().get(self.action).copied()
    }

    /// Length of a motion on a path, electrical turns.
    fn length(&self, bench: &Bench) -> f32 {
        min((APPROACH_TURNS + PATH_TURNS) * f32::from(bench.pole_pairs), abs(self.scan.path))
    }

    /// Position of a waypoint, electrical turns.
    fn position(&self, bench: &Bench, waypoint: Waypoint) -> f32 {
        let length = self.length(bench) * sign(self.scan.path);
        let begin = bench.electrical(self.scan.way);
        let end = begin + self.scan.path;
        match waypoint {
            Waypoint::Home => 0.0,
            Waypoint::Low(Path::First) => begin,
            Waypoint::High(Path::First) => begin + length,
            Waypoint::Low(Path::Last) => end - length,
            Waypoint::High(Path::Last) => end,
        }
    }

    /// `seen` are the inductances, and the travel at which they were measured along phase A.
    pub(super) fn tick(
        &mut self,
        reading: &Reading<'_>,
        seen: (&SeenInductances, i32),
        drop: &VoltageDrop,
    ) -> Result<Outcome<Refined>, Refusal> {
        let bench = reading.bench;
        let way = reading.track.way;
        let holding = bench.settings.current.0;
        let mut rotor = bench.angle(way).plus(self.offset);
        self.tracker.track(rotor);
        let seconds = self.ticks as f32 * TICK_S;
        self.ticks += 1;
        let (to, direct) = match self.action() {
            Some((waypoint, share)) => (self.position(bench, waypoint), holding * share),
            None => (self.from, 0.0),
        };
        let distance = to - self.from;
        let motion = FieldWay::over(abs(distance), run_in(abs(distance)), bench.settings.turns_per_s);
        let is_ramp = abs(distance) < LEAST_DISTANCE;
        let (moved, speed) =
            if is_ramp { (0.0, 0.0) } else { (motion.travelled(seconds), motion.speed(seconds)) };
        let sign = sign(distance);
        let error = TAU * (self.from + sign * moved - bench.electrical(way));
        if abs(error) > TAU * GREATEST_ERROR {
            // With wrong counts per turn the angle is lost on the way to the path's end.
            let is_last = self.action / ACTIONS_PER_ROUND + 1 == ROUNDS.len();
            let counts = self.scan.fitting_counts.filter(|_| is_last);
            return Err(counts.map_or(Refusal::Slipped, |found| bench.other_counts(found)));
        }
        self.measure(reading, drop, rotor.rotation(), (direct, distance));

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
                let findings = Some(self.findings(&inductances, drop));
                return Ok(Outcome::Passed(Refined { offset: self.offset, inductances, findings }));
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
    fn measure(
        &mut self,
        reading: &Reading<'_>,
        drop: &VoltageDrop,
        rotor: Rotation,
        (direct, distance): (f32, f32),
    ) {
        let (bench, way) = (reading.bench, reading.track.way);
        let step = way.wrapping_sub(self.way);
        self.way = way;
        let (length, travelled) = (abs(distance), abs(bench.electrical(way) - self.from));
        let is_measured = self.direct == direct && length >= LEAST_DISTANCE && travelled > approach(length);
        let (reversed, back) = (usize::from(direct < 0.0), usize::from(distance < 0.0));
        if let Some(work) = self.work.get_mut(reversed).and_then(|work| work.get_mut(back))
            && is_measured
        {
            let work_now = step as f32 * reading.current.to_rotating(rotor).q.0;
            work.sum += work_now;
            work.counts += step;
            work.emf += self.current.current_loop.integral_v().q - drop.across(reading.current, rotor).0;
            if travelled < length - run_in(length) {
                work.steady_sum += work_now;
                work.steady_counts += step;
            }
        }
    }

    fn inductances(&self, bench: &Bench, (seen, at): (&SeenInductances, i32)) -> Inductances {
        seen.along_flux(ElectricalAngle::ZERO.minus(bench.angle(at).plus(self.offset)))
    }

    /// Results beside the offset and the inductances.
    fn findings(&self, inductances: &Inductances, drop: &VoltageDrop) -> MotorFindings {
        let Inductances { direct, quadrature, residual } = *inductances;
        let BothEnds { flux, friction, load, offset_sigma } = self.both_ends;
        MotorFindings {
            flux: Weber(flux.mean),
            friction: Ampere(friction.mean),
            load: Ampere(load),
            resistance_sigma: drop.resistance_sigma,
            direct_sigma: Henry(residual * direct.0),
            quadrature_sigma: Henry(residual * quadrature.0),
            offset_sigma_turns: offset_sigma,
            flux_sigma: Weber(flux.sigma),
            friction_sigma: Ampere(friction.sigma),
        }
    }

    /// Corrects the offset by what a round found.
    fn evaluate(&mut self, bench: &Bench, seen: (&SeenInductances, i32)) -> Result<(), Refusal> {
        let works = core::mem::take(&mut self.work);
        let round = self.action / ACTIONS_PER_ROUND;
        let (is_first, is_last) = (round == 0, round + 1 == ROUNDS.len());
        let holding = bench.settings.current.0;
        let Inductances { direct, quadrature, .. } = self.inductances(bench, seen);
        let found = if is_first {
            // This round's error is too large for a correction by saliency.
            Round::new(&works, bench, holding * FIRST_SHARE, 0.0)
        } else {
            Round::new(&works, bench, holding, direct.0 - quadrature.0)
        };
        let before = core::mem::replace(&mut self.round, found);
        let Round { error, load, .. } = found;
        let [plus, minus] = found.friction;
        self.friction = 0.5 * (plus + minus);
        let [first, last] = GREATEST_LOADS;
        if abs(load) > holding * if is_last { last } else { first } {
            return Err(Refusal::Load((100.0 * abs(load) / holding) as u8));
        }
        let mut correction = error;
        if is_last {
            // Centres of both paths, electrical turns apart.
            let apart = self.position(bench, Waypoint::Low(Path::Last))
                - self.position(bench, Waypoint::Low(Path::First));
            if abs(error) > GREATEST_DRIFT + bench.encoder_error {
                let stated = bench.scale.counts_per_turn() as f32;
                let drift = error / apart;
                return Err(bench.other_counts((stated / (1.0 - drift) + 0.5) as u32));
            }
            correction = 0.5 * error;
            let length = self.length(bench);
            self.both_ends = BothEnds::new([before, found], apart, approach(length) - run_in(length));
        }
        let correction = ElectricalAngle::from_turns(correction);
        self.offset = self.offset.minus(correction);
        self.current = self.current.turned(correction);
        self.tracker = SpeedTracker::at(bench.angle(self.way).plus(self.offset));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_load_s_growth_on_the_path_is_no_friction() {
        // 0.5 A per electrical turn over 4 turns; forwards the load is measured 0.6 turns further on.
        let at = |load: f32, friction: f32| Round { load, friction: [friction; 2], ..Round::default() };
        let found = BothEnds::new([at(1.0, 2.15), at(3.0, 2.15)], 4.0, 0.6);
        assert!((found.friction.mean - 2.0).abs() < 1e-6 && found.load == 2.0, "{found:?}");
        // Paths too close to each other show no growth.
        let found = BothEnds::new([at(1.0, 2.15), at(3.0, 2.15)], 0.9, 0.6);
        assert!((found.friction.mean - 2.15).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn the_offset_s_sigma_is_that_of_the_ends_and_directions() {
        let round = |error, one_way| Round { error, one_way, ..Round::default() };
        // A difference between the directions that both rounds share says nothing.
        let found = BothEnds::new([round(0.3, 0.01), round(0.004, 0.01)], 4.0, 0.6);
        assert!((found.offset_sigma - 0.004 / sqrt(8.0)).abs() < 1e-7, "{found:?}");
        let found = BothEnds::new([round(0.3, 0.01), round(0.0, 0.014)], 4.0, 0.6);
        assert!((found.offset_sigma - 0.004 / sqrt(8.0)).abs() < 1e-7, "{found:?}");
    }
}
