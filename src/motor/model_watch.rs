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
//! |r| > V + 0.35 R |i| + |w| (0.2 flux + 0.3 L |i|)       open or frozen: 32 more periods with than without
//! |mean of r in the stator's frame over an electrical turn| > 0.4 V + 0.06 R I    drifted offset
//! range of q, sustained extremes and now, > I / 2, while the counter moved by at most 2 counts,
//!     without the first 12 periods there        frozen: 64 more periods with than without
//! V = 2 * 4/3 t_d f V_bus                    twice the loss of dead time and switches; 0.44 V on the board
//! ```
//!
//! `i` measured current as |d| + |q|, `I` the axis' current limit, `w` electrical speed of the counts.
//! Shares: 0.35 for copper 90 K warmer than at the calibration; 0.2 for magnets 80 K warmer and the
//! nameplate's error; 0.3 for iron that saturates.
//!
//! **Frozen counter** (E1): r is the whole back-EMF, detected where `w flux > V + 0.35 R |i|`
//! ([`ModelLimits::frozen_speed`]). On the default leg that is 0.44 rad/s of the joint without current, 1.3
//! rad/s with the greatest current. Detection takes 8 ms after the loop's speed has followed the counts to
//! zero (1 ms). Counts at rest distinguish this fault from an open phase. A residual beyond the back-EMF of
//! the greatest speed is never a frozen counter.
//!
//! **Slower, or at rest**: a controller whose measured position no longer changes pulls harder and harder. A
//! change of the current by half of its limit moves a rotor by more than 2 counts within 16 ms. On the
//! default leg these are 28 A (42 N m) and 0.03 mrad of the joint. Exceptions:
//!
//! - An inertia above 100 kg m^2.
//! - Friction that takes more than 42 N m from one side to the other (9 here).
//! - A constraint stiffer than 1e6 N m/rad (gears have 1e4 to 1e5, a hand 2e3).
//! - A push that grows as the torque does, to within friction. With a third of the limit and 8 ms that
//!   happened once in 75 pushes of up to 70 N m.
//!
//! Up to that change, and so up to a torque that is wrong by 42 N m, a frozen counter is not detected. A
//! current that falls within the first 3 ms at rest does not count: a joint that comes to rest loses its
//! braking current then. Otherwise a hard-damped leg would show a frozen counter. A short pulse of current,
//! as a late target makes it, moves a joint by less than 2 counts, and stiction holds it there. The extremes
//! therefore follow the current by at most 1/64 of the limit per period. A rotor that is itself clamped, as
//! on a test bench, is reported as a frozen counter.
//!
//! **Open phase** (P1): the open phase's target current cannot flow, so the integral grows past any limit.
//! Without a target current nothing is detected. At rest the fault may be reported as a frozen counter: two
//! phases brake as well.
//!
//! **Drifted offset** (C1): an offset o of one shunt leaves a residual 2/sqrt(3) |R + j w L| o that rests in
//! the stator's frame. All errors of resistance, flux and dead time turn with the rotor and vanish from the
//! mean of a turn. The limit is 6.7 A on the default leg, 12 N m at most. Offsets below 3 A are not detected:
//! without target currents dead time alone looks like that. Turns longer than 25 ms, shorter than 3 ms or
//! with a reversal are not evaluated.
//!
//! False alarms: those of the simulated hours in docs/results/faults.md. The margin between a healthy motor's
//! residual and the limits has not been measured on a motor.
//! Source: parity equation of a linear model, Isermann, Fault-Diagnosis Systems (2006), chapter 10.
//! Cost: docs/results/motor.md, checks; 44 bytes.

use super::axis::AxisFault;
use super::configuration::AxisConfiguration;
use super::{CountScale, CurrentLoop, ElectricalAngle, MotorConstants, Rotating, Stationary};
use crate::hal::CURRENT_RATE_HZ;
use crate::real::{abs, clamp, max, min, sqrt};
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
/// Share of the greatest current whose change moves any rotor, and periods until it has moved: 16 ms.
const SWING_SHARE: f32 = 0.5;
const SWING_PATIENCE: u8 = 64;
/// Periods in which the sustained extremes of the current follow a change by that share: 8 ms.
const SWING_FOLLOWS: f32 = 32.0;
/// Periods in which a joint that came to rest loses its braking current: 3 ms.
const SETTLED: u8 = 12;
/// Length of the vector that dead time makes (4/3), with a margin of two.
const DEAD_VECTORS: f32 = 2.0 * 4.0 / 3.0;
/// Uncertainty of the constants, as shares.
const RESISTANCE_SHARE: f32 = 0.35;
const FLUX_SHARE: f32 = 0.2;
const INDUCTANCE_SHARE: f32 = 0.3;
/// Limit of the mean over a turn: shares of V, and of R times the greatest current, which changes
/// within the turn.
const MEAN_SHARE: f32 = 0.4;
const MEAN_RESISTANCE_SHARE: f32 = 0.06;

/// Expected voltages of an axis, and their tolerances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelLimits {
    resistance_ohm: f32,
    /// Inductances that the loop does not feed forward; zero with feedforward.
    inductance_h: Rotating<f32>,
    flux_vs: f32,
    still_v: f32,
    volt_per_ampere: f32,
    volt_per_speed: f32,
    volt_per_speed_ampere: f32,
    mean_square: f32,
    /// Square of the back-EMF at the greatest speed.
    back_emf_square: f32,
    scale: CountScale,
    back_emf_per_speed: f32,
    swing_a: f32,
}

impl ModelLimits {
    /// Limits of a motor as it was calibrated.
    #[must_use]
    pub fn new(configuration: &AxisConfiguration, motor: &MotorConstants, scale: CountScale) -> Self {
        let [_, bus] = configuration.bus;
        let still_v = DEAD_VECTORS * configuration.timing.dead_time.0 * CURRENT_RATE_HZ as f32 * bus.0;
        let resistance_ohm = motor.resistance.0;
        let left = if configuration.feedforward { 0.0 } else { 1.0 };
        let mean_v =
            MEAN_SHARE * still_v + MEAN_RESISTANCE_SHARE * resistance_ohm * configuration.current_limit.0;
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
            mean_square: mean_v * mean_v,
            back_emf_square: back_emf * back_emf,
            scale,
            back_emf_per_speed: motor.flux.0,
            swing_a: SWING_SHARE * configuration.current_limit.0,
        }
    }

    /// Electrical speed above which a frozen counter is detected at a current, rad/s.
    #[must_use]
    pub fn frozen_speed(&self, current: Ampere) -> f32 {
        (self.still_v + self.volt_per_ampere * current.0) / self.back_emf_per_speed
    }

    /// Change of the current above which a frozen counter is detected at any speed.
    #[must_use]
    pub fn frozen_swing(&self) -> Ampere {
        Ampere(self.swing_a)
    }

    /// Greatest residual of a sound axis, V.
    #[inline(always)]
    pub(super) fn tolerance(&self, now: &Shown<'_>) -> f32 {
        let speed = abs(now.speed_rad_per_s);
        let current = abs(now.current.d.0) + abs(now.current.q.0);
        self.still_v
            + current * (self.volt_per_ampere + self.volt_per_speed_ampere * speed)
            + self.volt_per_speed * speed
    }

    /// Back-EMF at the counts' speed, V.
    pub(super) fn back_emf(&self, now: &Shown<'_>) -> f32 {
        self.back_emf_per_speed * abs(now.speed_rad_per_s)
    }

    fn is_still(&self, position: i32, before: i32) -> bool {
        let distance = self.scale.within_turn(position - before);
        distance <= STANDSTILL || self.scale.counts_per_turn() - distance <= STANDSTILL
    }
}

/// State of an axis once per servo period while its bridge switches.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// Current loop after its last tick.
    pub current_loop: &'a CurrentLoop,
    /// Measured current.
    pub current: Rotating<Ampere>,
    /// Electrical speed of the counts, rad/s.
    pub speed_rad_per_s: f32,
    /// Rotor position within one turn, counts.
    pub position: i32,
    /// Electrical angle of that position.
    pub angle: ElectricalAngle,
}

/// Model check of one axis; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelWatch {
    /// Periods with too large a residual, less those without.
    suspicion: u8,
    /// Rotor position before the first of them.
    position: i32,
    /// Integral of the residual over the angle, stator's frame, V turns.
    sum: Stationary<f32>,
    /// Travel within the current electrical turn, turns, signed.
    way: f32,
    periods: u8,
    angle: Option<ElectricalAngle>,
    still: Still,
    /// Square of the last period's residual, V^2.
    square: f32,
}

/// A counter at rest, and the sustained range of currents since then.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Still {
    position: i32,
    /// Periods at that position, capped at the settling time.
    periods: u8,
    least_a: f32,
    most_a: f32,
    /// Periods with a current far from an extreme, less those near both.
    overdue: u8,
}

impl Still {
    const fn at(position: i32, current_a: f32) -> Self {
        Self { position, periods: 0, least_a: current_a, most_a: current_a, overdue: 0 }
    }

    /// Runs one servo period; returns whether the counter should have moved but did not.
    fn look(&mut self, limits: &ModelLimits, position: i32, current_a: f32) -> bool {
        if !limits.is_still(position, self.position) {
            *self = Self::at(position, current_a);
        }
        if self.periods < SETTLED {
            self.periods += 1;
            // Least current, by magnitude, since the counter came to rest.
            let least_a = if self.least_a < 0.0 {
                clamp(current_a, self.least_a, 0.0)
            } else {
                clamp(current_a, 0.0, self.least_a)
            };
            (self.least_a, self.most_a) = (least_a, least_a);
            return false;
        }
        let step = limits.swing_a / SWING_FOLLOWS;
        self.least_a = min(self.least_a, max(current_a, self.least_a - step));
        self.most_a = max(self.most_a, min(current_a, self.most_a + step));
        // The largest of three distances: between the extremes, and from the current to either.
        let range_a = max(self.most_a, current_a) - min(self.least_a, current_a);
        if range_a > limits.swing_a {
            self.overdue += 1;
        } else {
            self.overdue = self.overdue.saturating_sub(1);
        }
        self.overdue >= SWING_PATIENCE
    }
}

impl ModelWatch {
    /// State before the first servo period.
    pub const EMPTY: Self = Self {
        suspicion: 0,
        position: 0,
        sum: Stationary { alpha: 0.0, beta: 0.0 },
        way: 0.0,
        periods: 0,
        angle: None,
        still: Still::at(0, 0.0),
        square: 0.0,
    };

    /// Whether the counter has stood still since voltages and currents began to disagree. Any fault found
    /// then also makes the rotor position doubtful.
    #[must_use]
    pub fn doubts(&self, limits: &ModelLimits, position: i32) -> bool {
        self.suspicion > 0 && limits.is_still(position, self.position)
    }

    /// Residual of the last period, V.
    pub(super) fn residual(&self) -> f32 {
        sqrt(self.square)
    }

    /// Electrical speed whose back-EMF equals the last period's residual, rad/s.
    #[must_use]
    pub fn uncounted(&self, limits: &ModelLimits) -> f32 {
        sqrt(self.square) / limits.back_emf_per_speed
    }

    /// Runs one servo period and returns the fault, if any.
    #[must_use]
    pub fn look(&mut self, limits: &ModelLimits, now: &Shown<'_>) -> Option<AxisFault> {
        let residual = residual(limits, now);
        let square = residual.d * residual.d + residual.q * residual.q;
        self.square = square;
        let limit = limits.tolerance(now);
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
        if self.still.look(limits, now.position, now.current.q.0) {
            return Some(AxisFault::EncoderFrozen);
        }
        self.turn(limits, now, residual).then_some(AxisFault::CurrentOffset)
    }

    /// Updates the mean over an electrical turn; returns whether a turn ended with too large a mean.
    fn turn(&mut self, limits: &ModelLimits, now: &Shown<'_>, residual: Rotating<f32>) -> bool {
        let step = self.angle.map_or(0.0, |before| now.angle.since(before));
        self.angle = Some(now.angle);
        self.periods += 1;
        if step * self.way < 0.0 || self.periods > LONGEST_TURN {
            (self.sum, self.way, self.periods) = (Self::EMPTY.sum, 0.0, 0);
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
        self.periods = 0;
        self.sum = Stationary { alpha: seen.alpha * (way - left), beta: seen.beta * (way - left) };
        is_circle && alpha * alpha + beta * beta > limits.mean_square
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
    use crate::motor::testing::CONFIGURATION;
    use crate::units::{Henry, Ohm, Volt, Weber};

    const MOTOR: MotorConstants = MotorConstants {
        resistance: Ohm(0.05),
        direct_inductance: Henry(24e-6),
        quadrature_inductance: Henry(27e-6),
        flux: Weber(2.9e-3),
    };

    fn limits() -> ModelLimits {
        let scale = CountScale::new(8192, 7).expect("usual");
        ModelLimits::new(&CONFIGURATION, &MOTOR, scale)
    }

    /// A period at rest with this integral of the current loop and this current.
    fn shown<'a>(
        current_loop: &'a CurrentLoop,
        current: Rotating<Ampere>,
        angle: ElectricalAngle,
    ) -> Shown<'a> {
        Shown { current_loop, current, speed_rad_per_s: 0.0, position: 0, angle }
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
            let mut watch = ModelWatch::EMPTY;
            let now = shown(&current_loop, current, ElectricalAngle::default());
            // The counter moves: a change of the current at a standing one would be a fault of its own.
            let seen = (0..3 * i32::from(PATIENCE))
                .find_map(|period| watch.look(&limits, &Shown { position: 10 * period, ..now }));
            assert_eq!(seen, None, "{d} {q}");
        }
    }

    /// Servo period in which a counter at rest is reported as frozen, of 400, for the current in each.
    fn frozen_after(current_a: impl Fn(u32) -> f32) -> Option<u32> {
        let limits = limits();
        let mut still = Still::at(0, current_a(0));
        (0..400).find(|period| still.look(&limits, 0, current_a(*period)))
    }

    #[test]
    fn a_sustained_change_of_the_current_at_a_standing_counter_is_a_frozen_one() {
        let swing = limits().swing_a;
        let begin = u32::from(SETTLED) + 8;
        let step = |period: u32| if period < begin { 0.0 } else { -1.1 * swing };
        assert_eq!(frozen_after(step), Some(begin + u32::from(SWING_PATIENCE) - 1));
        // First to one side, then to the other: the range counts, not the distance from the first current.
        let there_and_back = |period: u32| match period {
            0..20 => 0.0,
            20..100 => 0.7 * swing,
            _ => -0.7 * swing,
        };
        assert_eq!(frozen_after(there_and_back), Some(100 + u32::from(SWING_PATIENCE) - 1));
        // A slow swing that exceeds the limit at its peak only.
        let slow = |period: u32| match period {
            0..20 => 0.0,
            20..160 => (period - 20) as f32 * 1.05 / 140.0 * swing,
            _ => (300 - period.min(300)) as f32 * 1.05 / 140.0 * swing,
        };
        assert!(frozen_after(slow).is_some_and(|period| period < 160 + u32::from(SWING_PATIENCE)));
        assert_eq!(frozen_after(|period| if period < begin { 0.0 } else { 0.9 * swing }), None);
    }

    #[test]
    fn short_pulses_of_the_current_that_a_sticking_joint_survives_show_no_frozen_counter() {
        let swing = limits().swing_a;
        // Full current for 2 ms in each direction, every 50 ms: targets that were late.
        let pulses = |period: u32| match period % 200 {
            40..48 => 2.0 * swing,
            48..56 => -2.0 * swing,
            _ => 0.1 * swing,
        };
        assert_eq!(frozen_after(pulses), None);
    }

    #[test]
    fn iron_that_saturates_is_no_fault_at_speed_and_would_be_one_at_rest() {
        let limits = limits();
        let current = Rotating { d: Ampere::ZERO, q: Ampere(50.0) };
        // 2.2 V across the current, of which 50 A, 27 uH and 1,500 rad/s make 2.0.
        let current_loop = CurrentLoop::holding(Rotating { d: Volt(2.2), q: Volt(0.05 * 50.0) });
        for (speed_rad_per_s, expected) in [(1500.0, None), (0.0, Some(AxisFault::OpenPhase))] {
            let now = Shown { speed_rad_per_s, ..shown(&current_loop, current, ElectricalAngle::default()) };
            let mut watch = ModelWatch::EMPTY;
            let seen = (0..3 * i32::from(PATIENCE))
                .find_map(|period| watch.look(&limits, &Shown { position: 10 * period, ..now }));
            assert_eq!(seen, expected, "{speed_rad_per_s}");
        }
    }

    #[test]
    fn a_drifted_zero_is_seen_after_the_same_turns_in_either_direction() {
        let limits = limits();
        let size = 1.5 * sqrt(limits.mean_square);
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
                watch.look(&limits, &shown(&current_loop, none, angle)) == Some(AxisFault::CurrentOffset)
            })
        });
        assert!(seen[0].is_some() && seen[0] == seen[1], "{seen:?}");
    }
}
