//! Checks an axis' voltages against its current and speed.
//!
//! Detected are a frozen counter, an open phase and a drifted current-sensor offset.
//!
//! Why no term with di/dt: the current loop's integral `s` is the realised voltage less feedforward,
//! low-passed with the motor's own time constant. That is the resistance times the current that this voltage
//! produces. Subtracting the measured current leaves the errors: back-EMF of an uncounted speed, a phase that
//! does not conduct, a current that does not flow.
//!
//! ```text
//! r = s - R i - (coupling and back-EMF, where they are not fed forward)          d and q, each servo period
//! |r| > V + 0.35 R I1 + |w| (0.2 flux + 0.3 L I1)       open or frozen: 32 more periods with than without
//! counts >= 4 a period in one direction, 4 periods in a row; from the next period on within 2 counts for
//!     32 periods                             frozen
//! |mean of r in the stator's frame over an electrical turn| > 0.4 V + R max(0.06 I, 0.17 range of i_q)
//!                                           drifted offset
//! V  = 2 * 4/3 t_d f V_bus                   twice the loss of dead time and switches; 0.44 V on the board
//! I1 = max(|i_d| + |i_q|, 3/4 of the last period's I1)
//! ```
//!
//! `i` measured current, `I` the axis' current limit, `w` electrical speed of the counts. Shares: 0.35 for
//! copper 90 K warmer than at the calibration; 0.2 for magnets 80 K warmer and the nameplate's error; 0.3 for
//! iron that saturates. `I1` falls to a third within 1 ms: errors of R and L reach the integral with the
//! delay L/R.
//!
//! **Why no current alone decides.** A rotor that is held, or that a fast torque only shakes, obeys
//!
//! ```text
//! v = R i + L di/dt,   so r = 0 within the errors of R, L and dead time, whatever the current does
//! ```
//!
//! Its counter rests rightly: torque of +-22 N m with half waves of 4 ms moves a joint by a count or two.
//!
//! **Frozen counter** (E1), first sign: voltages and currents are seen in the frame of the counter. If the
//! rotor is ahead of it by an angle e, the residual is the back-EMF,
//!
//! ```text
//! r_d = -w flux sin e        r_q = w flux cos e
//! ```
//!
//! detected where `w flux > V + 0.35 R I1` ([`ModelLimits::frozen_speed`]). On the default leg that is 0.44
//! rad/s of the joint without current, 1.3 rad/s with the greatest current. Detection takes 8 ms after the
//! loop's speed has followed the counts to zero (1 ms). Counts at rest distinguish this fault from an open
//! phase. A residual beyond the back-EMF of the greatest speed is never a frozen counter.
//!
//! Second sign: a counter that stops as no rotor can. From 4 counts a period (0.25 rad/s of a joint of the
//! default leg) to rest within 3 + 2 counts takes 390 rad/s^2 of the joint, or 750 N m at its rotor. The
//! drive makes 85 N m. A stop at the end of the range, behind gears of 1e5 N m/rad, moves a rotor by 70
//! counts; this motor alone needs 44 at full current. Then the counter must rest for 8 ms: a rotor that was
//! struck bounces. One that is clamped at speed, as on a test bench, is reported as a frozen counter. Four
//! periods exclude wrong readings, which come back, and lost counts, which come once.
//!
//! **Slower, or at rest**, a frozen counter is not detected: it looks like a rotor that is held. The current
//! then stands still in the stator, and holds the rotor like a detent in each electrical turn (1.0 degrees of
//! the joint), against the torque that is asked for. What turns the joint against it, as gravity while that
//! torque changes its sign, moves the rotor from pole to pole, with the back-EMF of such jumps. An absolute
//! encoder shows a loss of 14 counts.
//!
//! **Open phase** (P1): the open phase's target current cannot flow, so the integral grows past any limit.
//! Without a target current nothing is detected. At rest the fault may be reported as a frozen counter: two
//! phases brake as well.
//!
//! **Drifted offset** (C1): an offset o of one shunt leaves a residual 2/sqrt(3) |R + j w L| o that rests in
//! the stator's frame. All errors of resistance, flux and dead time turn with the rotor and vanish from the
//! mean of a turn, unless the current changes with the turn: then up to 0.35 R range / pi of a wrong R is
//! left. The limit allows half more, for dead time and steps. With changes below a third of `I`, an offset of
//! 6.7 A is detected on the default leg, 12 N m at most. Offsets below 3 A are not detected: without target
//! currents dead time alone looks like that. Turns longer than 25 ms, shorter than 3 ms or with a reversal
//! are not evaluated.
//!
//! False alarms: those of the simulated hours in docs/results/faults.md. The margin between a healthy motor's
//! residual and the limits has not been measured on a motor.
//! Source: parity equation of a linear model, Isermann, Fault-Diagnosis Systems (2006), chapter 10.
//! Cost: docs/results/motor.md, checks; 60 bytes.

use super::axis::AxisFault;
use super::configuration::AxisConfiguration;
use super::{CountScale, CurrentLoop, ElectricalAngle, MotorConstants, Rotating, Stationary};
use crate::hal::CURRENT_RATE_HZ;
use crate::real::{abs, max, min, sqrt};
use crate::units::Ampere;

/// Servo periods by which those with too large a residual must outnumber the others: 8 ms.
const PATIENCE: u8 = 32;
/// Longest electrical turn that is evaluated, servo periods: 25 ms.
const LONGEST_TURN: u8 = 100;
/// Shortest electrical turn that is evaluated, servo periods. Fewer samples do not cover a circle: above
/// 2,094 rad/s, or 6 rad/s of a joint of the default leg.
const SHORTEST_TURN: u8 = 12;
/// Counts within which a counter counts as standing still: an edge on which a sensor rests.
const STANDSTILL: i32 = 2;
/// Counts per servo period from which a rotor cannot come to rest within [`STANDSTILL`], and periods for
/// which it must have moved so.
const MOVING: i32 = 4;
/// Counts per turn for each count of [`MOVING`]: finer encoders need as many more, for the same speed.
const FINE: i32 = 2048;
const RUN: i8 = 4;
/// Length of the vector that dead time makes (4/3), with a margin of two.
const DEAD_VECTORS: f32 = 2.0 * 4.0 / 3.0;
/// Uncertainty of the constants, as shares.
const RESISTANCE_SHARE: f32 = 0.35;
const FLUX_SHARE: f32 = 0.2;
const INDUCTANCE_SHARE: f32 = 0.3;
/// Share of the greatest current that is left after a servo period.
const MEMORY: f32 = 0.75;
/// Limit of the mean over a turn: shares of V, and of R times the greatest current, which changes
/// within the turn. A larger change counts by its range, as a wrong resistance shows it.
const MEAN_SHARE: f32 = 0.4;
const MEAN_RESISTANCE_SHARE: f32 = 0.06;
const MEAN_RANGE_SHARE: f32 = 1.5 * RESISTANCE_SHARE / core::f32::consts::PI;

/// Expected voltages of an axis, and their tolerances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ModelLimits {
    resistance_ohm: f32,
    /// Inductances that the loop does not feed forward; zero with feedforward.
    inductance_h: Rotating<f32>,
    flux_vs: f32,
    still_v: f32,
    volt_per_ampere: f32,
    volt_per_speed: f32,
    volt_per_speed_ampere: f32,
    /// Limit of the mean over a turn without current, V, and the least change of current that it allows, A.
    mean_v: f32,
    mean_range_a: f32,
    /// Square of the back-EMF at the greatest speed.
    back_emf_square: f32,
    scale: CountScale,
    back_emf_per_speed: f32,
}

impl ModelLimits {
    /// Limits of a motor as it was calibrated.
    pub fn new(configuration: &AxisConfiguration, motor: &MotorConstants, scale: CountScale) -> Self {
        let [_, bus] = configuration.bus;
        let still_v = DEAD_VECTORS * configuration.timing.dead_time.0 * CURRENT_RATE_HZ as f32 * bus.0;
        let resistance_ohm = motor.resistance.0;
        let left = if configuration.feedforward { 0.0 } else { 1.0 };
        let greatest = f32::from(configuration.pole_pairs) * configuration.greatest_speed.0;
        let back_emf = greatest * motor.flux.0;
        Self {
            resistance_ohm,
            inductance_h: Rotating {
                d: left * motor.direct_inductance.0,
                q: left * motor.quadrature_inductance.0,
            },
            flux_vs: left * motor.flux.0,
            still_v,
            volt_per_ampere: RESISTANCE_SHARE * resistance_ohm,
            volt_per_speed: FLUX_SHARE * motor.flux.0,
            volt_per_speed_ampere: INDUCTANCE_SHARE * motor.quadrature_inductance.0,
            mean_v: MEAN_SHARE * still_v,
            mean_range_a: MEAN_RESISTANCE_SHARE / MEAN_RANGE_SHARE * configuration.current_limit.0,
            back_emf_square: back_emf * back_emf,
            scale,
            back_emf_per_speed: motor.flux.0,
        }
    }

    /// Electrical speed above which a frozen counter is detected at a current, rad/s.
    pub(crate) fn frozen_speed(&self, current: Ampere) -> f32 {
        (self.still_v + self.volt_per_ampere * current.0) / self.back_emf_per_speed
    }

    /// Greatest residual of a sound axis, V.
    #[inline(always)]
    fn tolerance(&self, current_a: f32, speed_rad_per_s: f32) -> f32 {
        let speed = abs(speed_rad_per_s);
        self.still_v
            + current_a * (self.volt_per_ampere + self.volt_per_speed_ampere * speed)
            + self.volt_per_speed * speed
    }

    /// Back-EMF at the counts' speed, V.
    pub(super) fn back_emf(&self, now: &Shown<'_>) -> f32 {
        self.back_emf_per_speed * abs(now.speed_rad_per_s)
    }

    /// Greatest mean over a turn in which the quadrature current has changed by so much, V.
    fn mean(&self, range_a: f32) -> f32 {
        self.mean_v + MEAN_RANGE_SHARE * self.resistance_ohm * max(range_a, self.mean_range_a)
    }

    fn is_still(&self, position: i32, before: i32) -> bool {
        let distance = self.scale.within_turn(position - before);
        distance <= STANDSTILL || self.scale.counts_per_turn() - distance <= STANDSTILL
    }
}

/// State of an axis once per servo period while its bridge switches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shown<'a> {
    /// Current loop after its last tick.
    pub(crate) current_loop: &'a CurrentLoop,
    /// Measured current.
    pub(crate) current: Rotating<Ampere>,
    /// Electrical speed of the counts, rad/s.
    pub(crate) speed_rad_per_s: f32,
    /// Rotor position within one turn, counts.
    pub(crate) position: i32,
    /// Electrical angle of that position.
    pub(crate) angle: ElectricalAngle,
}

/// Model check of one axis; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ModelWatch {
    /// Periods with too large a residual, less those without.
    suspicion: u8,
    /// Rotor position before the first of them.
    position: i32,
    /// Integral of the residual over the angle, stator's frame, V turns.
    sum: Stationary<f32>,
    /// Travel within the current electrical turn, turns, signed.
    way: f32,
    periods: u8,
    /// Least and greatest quadrature current within that turn, A.
    range_a: [f32; 2],
    angle: Option<ElectricalAngle>,
    stop: Stop,
    /// Greatest current of the last periods, A.
    current_a: f32,
    /// Square of the last period's residual, V^2, and its tolerance, V.
    square: f32,
    tolerance: f32,
}

/// A counter that moves, and how it comes to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stop {
    /// Position in the last period.
    before: i32,
    /// Periods of fast motion in one direction, signed.
    run: i8,
    /// Position one period after them, and periods there.
    rests_at: i32,
    rests: u8,
}

impl Stop {
    /// Runs one servo period; returns whether the counter has stopped as no rotor can.
    fn check(&mut self, limits: &ModelLimits, position: i32) -> bool {
        let turn = limits.scale.counts_per_turn();
        let way = limits.scale.within_turn(position - self.before);
        let step = if 2 * way > turn { way - turn } else { way };
        self.before = position;
        if step.abs() >= (turn / FINE).max(MOVING) {
            let sign = if step > 0 { 1 } else { -1 };
            self.run = if self.run * sign > 0 { (self.run + sign).clamp(-RUN, RUN) } else { sign };
            self.rests = 0;
            return false;
        }
        if self.rests == 0 {
            // The counter may have stopped within this period.
            self.rests_at = position;
        }
        if self.run.abs() < RUN || !limits.is_still(position, self.rests_at) {
            (self.run, self.rests) = (0, 0);
            return false;
        }
        self.rests += 1;
        self.rests > PATIENCE
    }
}

impl ModelWatch {
    /// State before the first servo period.
    pub(crate) const EMPTY: Self = Self {
        suspicion: 0,
        position: 0,
        sum: Stationary { alpha: 0.0, beta: 0.0 },
        way: 0.0,
        periods: 0,
        range_a: [0.0; 2],
        angle: None,
        stop: Stop { before: 0, run: 0, rests_at: 0, rests: 0 },
        current_a: 0.0,
        square: 0.0,
        tolerance: 0.0,
    };

    /// Whether the counter has stood still since voltages and currents began to disagree. Any fault found
    /// then also makes the rotor position doubtful.
    pub(crate) fn doubts(&self, limits: &ModelLimits, position: i32) -> bool {
        self.suspicion > 0 && limits.is_still(position, self.position)
    }

    /// Residual of the last period, V.
    pub(super) fn residual(&self) -> f32 {
        sqrt(self.square)
    }

    /// Greatest residual of a sound axis in the last period, V.
    pub(super) fn tolerance(&self) -> f32 {
        self.tolerance
    }

    /// Electrical speed whose back-EMF equals the last period's residual, rad/s.
    pub(crate) fn uncounted(&self, limits: &ModelLimits) -> f32 {
        sqrt(self.square) / limits.back_emf_per_speed
    }

    /// Runs one servo period and returns the fault, if any.
    #[must_use]
    pub fn check(&mut self, limits: &ModelLimits, now: &Shown<'_>) -> Option<AxisFault> {
        let residual = residual(limits, now);
        let square = residual.d * residual.d + residual.q * residual.q;
        self.square = square;
        self.current_a = max(abs(now.current.d.0) + abs(now.current.q.0), MEMORY * self.current_a);
        let limit = limits.tolerance(self.current_a, now.speed_rad_per_s);
        self.tolerance = limit;
        if self.suspicion == 0 {
            self.position = now.position;
        }
        // A residual that is not finite exceeds every limit.
        if square <= limit * limit {
            self.suspicion = self.suspicion.saturating_sub(1);
        } else {
            self.suspicion += 1;
            if self.suspicion >= PATIENCE {
                self.suspicion = 0;
                let frozen = limits.is_still(now.position, self.position) && square <= limits.back_emf_square;
                return Some(if frozen { AxisFault::EncoderFrozen } else { AxisFault::OpenPhase });
            }
        }
        if self.stop.check(limits, now.position) {
            self.stop = Self::EMPTY.stop;
            return Some(AxisFault::EncoderFrozen);
        }
        self.turn(limits, now, residual).then_some(AxisFault::CurrentOffset)
    }

    /// Updates the mean over an electrical turn; returns whether a turn ended with too large a mean.
    fn turn(&mut self, limits: &ModelLimits, now: &Shown<'_>, residual: Rotating<f32>) -> bool {
        let step = self.angle.map_or(0.0, |before| now.angle.since(before));
        self.angle = Some(now.angle);
        self.periods += 1;
        let [least_a, most_a] = self.range_a;
        self.range_a = [min(least_a, now.current.q.0), max(most_a, now.current.q.0)];
        if step * self.way < 0.0 || self.periods > LONGEST_TURN {
            (self.sum, self.way, self.periods) = (Self::EMPTY.sum, 0.0, 0);
            self.range_a = [now.current.q.0; 2];
        }
        let seen = residual.to_stationary(now.angle.rotation());
        let left = 1.0 - abs(self.way);
        let way = abs(step);
        let add = |sum: f32, part: f32, share: f32| sum + part * share;
        if way < left {
            self.way += step;
            self.sum = Stationary {
                alpha: add(self.sum.alpha, seen.alpha, way),
                beta: add(self.sum.beta, seen.beta, way),
            };
            return false;
        }
        let (alpha, beta) = (add(self.sum.alpha, seen.alpha, left), add(self.sum.beta, seen.beta, left));
        self.way = if step < 0.0 { left - way } else { way - left };
        let is_circle = self.periods >= SHORTEST_TURN;
        let most_v = limits.mean(self.range_a[1] - self.range_a[0]);
        (self.periods, self.range_a) = (0, [now.current.q.0; 2]);
        self.sum = Stationary { alpha: seen.alpha * (way - left), beta: seen.beta * (way - left) };
        is_circle && alpha * alpha + beta * beta > most_v * most_v
    }
}

fn residual(limits: &ModelLimits, now: &Shown<'_>) -> Rotating<f32> {
    let Rotating { d, q } = now.current;
    let integral = now.current_loop.integral_v();
    let (r, l, speed) = (limits.resistance_ohm, limits.inductance_h, now.speed_rad_per_s);
    Rotating {
        d: integral.d - r * d.0 + speed * l.q * q.0,
        q: integral.q - r * q.0 - speed * (l.d * d.0 + limits.flux_vs),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motor::testing::{CONFIGURATION, MOTOR};
    use crate::units::Volt;

    fn limits() -> ModelLimits {
        let scale = CountScale::new(8192, 7).expect("usual");
        ModelLimits::new(&CONFIGURATION, &MOTOR, scale)
    }

    /// A period at rest with this integral of the current loop and this current.
    fn shown(current_loop: &CurrentLoop, current: Rotating<Ampere>, angle: ElectricalAngle) -> Shown<'_> {
        Shown { current_loop, current, speed_rad_per_s: 0.0, position: 0, angle }
    }

    /// Fault found in periods like this one. The counter moves, because a change of the current at a standing
    /// one is a fault of its own.
    fn found(limits: &ModelLimits, now: Shown<'_>) -> Option<AxisFault> {
        let mut watch = ModelWatch::EMPTY;
        let mut periods = 0..3 * i32::from(PATIENCE);
        periods.find_map(|period| watch.check(limits, &Shown { position: 10 * period, ..now }))
    }

    #[test]
    fn a_position_is_doubted_only_while_voltages_disagree_and_the_counter_stands() {
        let limits = limits();
        let suspicious = ModelWatch { suspicion: 1, ..ModelWatch::EMPTY };
        assert!(!ModelWatch::EMPTY.doubts(&limits, 0) && !suspicious.doubts(&limits, 100));
        assert!(suspicious.doubts(&limits, 0));
    }

    #[test]
    fn warm_copper_is_no_fault_whatever_the_direction_of_the_current() {
        let limits = limits();
        for (d, q) in [(50.0, 50.0), (50.0, -50.0), (-50.0, 50.0), (70.0, 0.0), (0.0, -70.0)] {
            let current = Rotating { d: Ampere(d), q: Ampere(q) };
            // 30 % more resistance than was measured.
            let held = Rotating { d: Volt(1.3 * 0.05 * d), q: Volt(1.3 * 0.05 * q) };
            let current_loop = CurrentLoop::holding(held);
            let now = shown(&current_loop, current, ElectricalAngle::default());
            assert_eq!(found(&limits, now), None, "{d} {q}");
        }
    }

    #[test]
    fn only_a_counter_that_stops_at_once_from_motion_is_frozen_before_voltages_show_it() {
        type Way = fn(i32) -> i32;
        let limits = limits();
        // Positions by servo period; the motion ends at 20.
        let cases: [(Way, Option<i32>); 9] = [
            (|period| 4 * period.min(20), Some(53)),
            (|period| -40 * period.min(20), Some(53)),
            // Stops within a period, rests on an edge, or wraps.
            (|period| 5 * period.min(20) + if period > 20 { 2 + period % 2 } else { 0 }, Some(53)),
            (|period| 8192 - 50 + 5 * period.min(20), Some(53)),
            (|period| 3 * period.min(20), None),
            // Braked with 250 rad/s^2 of the joint, a count a period less in each; a rotor that creeps on.
            (
                |period| {
                    8 * period.min(20) + (0..(period - 20).clamp(0, 8)).map(|done| 7 - done).sum::<i32>()
                },
                None,
            ),
            (|period| 4 * period.min(20) + (period - 20).max(0) / 5, None),
            // Counts that are lost, a wrong reading, and a shake.
            (|period| if period < 20 { 0 } else { 26 }, None),
            (|period| if period == 20 { 26 } else { 5 * (period & 1) }, None),
        ];
        for (case, (way, expected)) in cases.into_iter().enumerate() {
            let mut stop = ModelWatch::EMPTY.stop;
            let seen = (1..400).find(|period| stop.check(&limits, 8191 & way(*period)));
            assert_eq!(seen, expected, "case {case}");
        }
    }

    #[test]
    fn iron_that_saturates_is_no_fault_at_speed_and_would_be_one_at_rest() {
        let limits = limits();
        let current = Rotating { d: Ampere::ZERO, q: Ampere(50.0) };
        // 2.2 V across the current, of which 50 A, 27 uH and 1,500 rad/s make 2.0.
        let current_loop = CurrentLoop::holding(Rotating { d: Volt(2.2), q: Volt(0.05 * 50.0) });
        for (speed_rad_per_s, expected) in [(1500.0, None), (0.0, Some(AxisFault::OpenPhase))] {
            let now = Shown { speed_rad_per_s, ..shown(&current_loop, current, ElectricalAngle::default()) };
            assert_eq!(found(&limits, now), expected, "{speed_rad_per_s}");
        }
    }

    #[test]
    fn a_drifted_zero_is_seen_after_the_same_turns_in_either_direction() {
        let limits = limits();
        let size = 1.5 * limits.mean(0.0);
        // 90 periods at rest, then 40 a turn; the drift begins within the second turn.
        let seen = [1.0_f32, -1.0].map(|sign| {
            let mut watch = ModelWatch::EMPTY;
            (0_u32..400).find(|period| {
                let turns = sign * period.saturating_sub(90) as f32 * 0.024_9;
                let angle = ElectricalAngle::from_turns(turns);
                let drift = if *period < 150 { 0.0 } else { size };
                let residual = Stationary { alpha: drift, beta: 0.0 }.to_rotating(angle.rotation());
                let held = Rotating { d: Volt(residual.d), q: Volt(residual.q) };
                let none = Rotating { d: Ampere::ZERO, q: Ampere::ZERO };
                let current_loop = CurrentLoop::holding(held);
                watch.check(&limits, &shown(&current_loop, none, angle)) == Some(AxisFault::CurrentOffset)
            })
        });
        assert!(seen[0].is_some() && seen[0] == seen[1], "{seen:?}");
    }
}
