//! What the voltage of an axis says about its current and its speed: a frozen counter, an open phase, a drifted zero.
//!
//! Why no term with di/dt: the current loop's integral `s` is the voltage that was given, less what is fed forward, through a
//! low-pass with the motor's own time constant. That is resistance times the current that this voltage makes, so what is left
//! when the measured current is taken away is wrong: the back-EMF of a speed that was not counted, a phase that does not conduct, a
//! current that does not flow.
//!
//! ```text
//! r = s - R i - (coupling and back-EMF, where they are not fed forward)                       d and q, each servo period
//! |r| > V + 0.35 R |i| + |w| (0.2 flux + 0.3 L |i|)     32 periods more often than not         open, or frozen
//! |mean of r, turned back to the stator, over an electrical turn| > 0.4 V + 0.06 R I           drifted zero
//! max q - min q > I / 2 since the counter last moved by more than 2 counts, less what fell within 12 periods      64 periods later: frozen
//! V = 2 * 4/3 t_d f V_bus                               what dead time and switches take, twice; 0.44 V on the board
//! ```
//!
//! `i` measured current as |d| + |q|, `I` the axis' limit, `w` electrical speed of the counts. 0.35: copper 90 K warmer than at
//! the calibration; 0.2: magnets 80 K warmer, and the nameplate; 0.3: iron that saturates.
//!
//! **Frozen counter** (E1): r is the whole back-EMF, seen where `w flux > V + 0.35 R |i|` ([`ModelLimits::frozen_speed`]): on the
//! default leg 0.44 rad/s of the joint without current, 1.3 rad/s with the greatest, 8 ms after the loop's speed has followed
//! the counts to zero (1 ms). It is told apart by counts that stand still; a residual beyond the back-EMF of the greatest speed is
//! none.
//!
//! **Slower, or at rest**: whoever controls a place that no longer changes pulls harder and harder. A current that has changed by
//! half of its limit (28 A, 42 N m on the default leg) moves a rotor by more than 2 counts (0.03 mrad of that joint) within
//! 16 ms, unless it has more than 100 kg m^2 to move, friction takes more than 42 N m from one side to the other (9 here), what
//! holds it is stiffer than 1e6 N m/rad (gears have 1e4 to 1e5, a hand 2e3), or a push grows as the torque does, to within friction: with
//! a third of the limit and 8 ms that happened once in 75 pushes of up to 70 N m. Up to that change, and so up to a torque that is wrong by
//! 42 N m, a frozen counter is not seen. In the first 3 ms a current that falls does not count: that of a joint that is brought to rest is
//! given back then, and a leg that was damped hard was taken for one with a frozen counter by that. A rotor that is clamped itself, as on a test bench, is taken for a frozen counter.
//!
//! **Open phase** (P1): what is asked of the open phase cannot flow, the integral runs away and passes any limit; without current
//! nothing is asked and nothing is seen. At rest it may be taken for a frozen counter: two phases brake as well. **Drifted zero** (C1): an offset o of one shunt leaves 2/sqrt(3) |R + j w L| o, at rest in the
//! stator, while all that is wrong with resistance, flux and dead time turns with the rotor and is gone from the mean of a
//! turn: 6.7 A on the default leg, 12 N m at most. Below 3 A, which dead time alone
//! looks like while nothing is asked of the phases, none is seen. Turns that take longer than 25 ms or less than
//! 3 ms, or turn back, are not judged.
//!
//! False alarms: those of the simulated hours in docs/safety.md; the margin between a healthy motor's residual and the limits has not been
//! measured on a motor. Source: parity equation of a linear model, Isermann, Fault-Diagnosis Systems (2006), chapter 10. Cost: `scripts/count-instructions`, joint sample; 44 bytes.

use super::axis::AxisFault;
use super::configuration::AxisConfiguration;
use super::{CountScale, CurrentLoop, ElectricalAngle, MotorConstants, Rotating, Sine, Stationary};
use crate::hal::CURRENT_RATE_HZ;
use crate::real::{abs, clamp, max, min, sqrt};
use crate::units::Ampere;

/// Periods of the servo that a residual has to be too large more often than not: 8 ms.
const PATIENCE: u8 = 32;
/// Longest electrical turn that is judged, servo periods: 25 ms.
const LONGEST_TURN: u8 = 100;
/// Fewer servo periods than this are no circle: from 2,094 rad/s on, 6 rad/s of a joint of the default leg.
const SHORTEST_TURN: u8 = 12;
/// Counts within which a counter stands still: an edge that a sensor sits on.
const STANDSTILL: i32 = 2;
/// Of the greatest current: a change that no rotor takes without moving, and periods in which it has moved: 16 ms.
const SWING_SHARE: f32 = 0.5;
const SWING_PATIENCE: u8 = 64;
/// Periods within which a joint that came to rest gives back the current that braked it: 3 ms.
const SETTLED: u8 = 12;
/// Both halves of the vector that dead time makes, and as much again.
const DEAD_VECTORS: f32 = 2.0 * 4.0 / 3.0;
/// Shares by which constants may be off.
const RESISTANCE_SHARE: f32 = 0.35;
const FLUX_SHARE: f32 = 0.2;
const INDUCTANCE_SHARE: f32 = 0.3;
/// Of the mean over a turn: share of V, and of R times the greatest current, which changes within the turn.
const MEAN_SHARE: f32 = 0.4;
const MEAN_RESISTANCE_SHARE: f32 = 0.06;

/// What is expected of an axis' voltages, and how far they may be from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelLimits {
    resistance_ohm: f32,
    /// What the loop does not feed forward.
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
    /// Of a motor as it was calibrated.
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

    /// Electrical speed above which a counter that stands still is seen with so much current, rad/s.
    #[must_use]
    pub fn frozen_speed(&self, current: Ampere) -> f32 {
        (self.still_v + self.volt_per_ampere * current.0) / self.back_emf_per_speed
    }

    /// Change of the current above which a counter that stands still is seen at any speed.
    #[must_use]
    pub fn frozen_swing(&self) -> Ampere {
        Ampere(self.swing_a)
    }

    fn is_still(&self, place: i32, before: i32) -> bool {
        let distance = self.scale.within_turn(place - before);
        distance <= STANDSTILL || self.scale.counts_per_turn() - distance <= STANDSTILL
    }
}

/// What an axis shows once per servo period while its bridge switches.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// After its last tick.
    pub current_loop: &'a CurrentLoop,
    /// Measured.
    pub current: Rotating<Ampere>,
    /// Of the counts, electrical, rad/s.
    pub speed_rad_per_s: f32,
    /// Within one turn.
    pub place: i32,
    /// Of that place.
    pub angle: ElectricalAngle,
    /// Of the axis.
    pub sine: Sine,
}

/// Watches one axis; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelWatch {
    /// Periods with too large a residual, less those without.
    suspicion: u8,
    /// Where the counter stood before the first of them.
    place: i32,
    /// Integral of the residual over the angle, stator's frame, V turns.
    sum: Stationary<f32>,
    /// Of the turn under way, turns; of either sign.
    way: f32,
    periods: u8,
    angle: Option<ElectricalAngle>,
    still: Still,
    /// Of the last period's residual, V^2.
    square: f32,
}

/// A counter that stands still, and what its motor was given meanwhile.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Still {
    place: i32,
    /// Periods at that place, no more than it takes to settle.
    periods: u8,
    least_a: f32,
    most_a: f32,
    /// Periods since the current changed too much.
    overdue: u8,
}

impl Still {
    const fn at(place: i32, current_a: f32) -> Self {
        Self { place, periods: 0, least_a: current_a, most_a: current_a, overdue: 0 }
    }

    /// One servo period: whether nothing moved although it should have.
    fn look(&mut self, limits: &ModelLimits, place: i32, current_a: f32) -> bool {
        if !limits.is_still(place, self.place) {
            *self = Self::at(place, current_a);
        }
        if self.periods < SETTLED {
            self.periods += 1;
            // As near to nothing as it has come.
            let least_a = if self.least_a < 0.0 {
                clamp(current_a, self.least_a, 0.0)
            } else {
                clamp(current_a, 0.0, self.least_a)
            };
            (self.least_a, self.most_a) = (least_a, least_a);
            return false;
        }
        self.least_a = min(self.least_a, current_a);
        self.most_a = max(self.most_a, current_a);
        if self.most_a - self.least_a > limits.swing_a {
            self.overdue += 1;
        }
        self.overdue >= SWING_PATIENCE
    }
}

impl ModelWatch {
    /// Nothing seen yet.
    pub const EMPTY: Self = Self {
        suspicion: 0,
        place: 0,
        sum: Stationary { alpha: 0.0, beta: 0.0 },
        way: 0.0,
        periods: 0,
        angle: None,
        still: Still::at(0, 0.0),
        square: 0.0,
    };

    /// Whether the counter has stood still since voltages and currents no longer agreed: whatever else is found then, the place cannot be
    /// believed.
    #[must_use]
    pub fn doubts(&self, limits: &ModelLimits, place: i32) -> bool {
        self.suspicion > 0 && limits.is_still(place, self.place)
    }

    /// Electrical speed of which the last period's residual would be the back-EMF, rad/s.
    #[must_use]
    pub fn uncounted(&self, limits: &ModelLimits) -> f32 {
        sqrt(self.square) / limits.back_emf_per_speed
    }

    /// One servo period: what is wrong, if anything.
    #[must_use]
    pub fn look(&mut self, limits: &ModelLimits, now: &Shown<'_>) -> Option<AxisFault> {
        let residual = residual(limits, now);
        let square = residual.d * residual.d + residual.q * residual.q;
        self.square = square;
        let speed = abs(now.speed_rad_per_s);
        let current = abs(now.current.d.0) + abs(now.current.q.0);
        let limit = limits.still_v
            + current * (limits.volt_per_ampere + limits.volt_per_speed_ampere * speed)
            + limits.volt_per_speed * speed;
        if self.suspicion == 0 {
            self.place = now.place;
        }
        // What is no number is no model either.
        if square <= limit * limit {
            self.suspicion = self.suspicion.saturating_sub(1);
        } else {
            self.suspicion += 1;
            if self.suspicion >= PATIENCE {
                self.suspicion = 0;
                let frozen = limits.is_still(now.place, self.place) && square <= limits.back_emf_square;
                return Some(if frozen { AxisFault::EncoderFrozen } else { AxisFault::OpenPhase });
            }
        }
        if self.still.look(limits, now.place, now.current.q.0) {
            return Some(AxisFault::EncoderFrozen);
        }
        self.turn(limits, now, residual).then_some(AxisFault::CurrentZero)
    }

    /// Goes on with the mean over an electrical turn; whether one ended with too large a mean.
    fn turn(&mut self, limits: &ModelLimits, now: &Shown<'_>, residual: Rotating<f32>) -> bool {
        let step = self.angle.map_or(0.0, |before| now.angle.since(before));
        self.angle = Some(now.angle);
        self.periods += 1;
        if step * self.way < 0.0 || self.periods > LONGEST_TURN {
            (self.sum, self.way, self.periods) = (Self::EMPTY.sum, 0.0, 0);
        }
        let seen = residual.to_stationary(now.angle.rotation(now.sine));
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
