//! First motion of an axis whose rotor angle was not measured but stored.
//!
//! Why: a check at standstill shows that the field along the assumed flux turns no rotor. Friction hides the
//! same, and a rotor half a turn off rests there too. Only the back-EMF of a rotor that turns proves the
//! angle. With an angle error e it differs from the expected one by
//!
//! ```text
//! |r| = |w| flux 2 sin(e / 2)            180 degrees: 2 |w| flux,   90: 1.41,   60: 1.00,   30: 0.52
//! T   = tolerance of the model watch     V + 0.35 R |i| + |w| (0.2 flux + 0.3 L |i|)
//!
//! counted   travel of servo periods with |w| flux > T: there 60 degrees and more show
//! proven    a quarter of a motor turn counted in total, without a period of |r| > T
//! lost      |r| > T for 8 ms (the model watch), or |w| flux > 3.5 (V + 0.35 R I / 4)
//! ```
//!
//! Until then the current is limited to a quarter of the axis' limit `I`. The speed limit is some 2 T, so an
//! angle that is wrong by 60 degrees shows well below it. A quarter of a turn takes longer than the 8 ms of
//! the watch: 14 ms at the speed limit of the default leg (2.2 rad/s of the joint), 50 ms at the lowest
//! counted speed (0.6 rad/s).
//!
//! Known limits: a flux 20 % lower than stated and other errors of the constants hide up to 75 degrees. Such
//! an angle may count as proven; its torque keeps the sign and at least a quarter of the size. The watch goes
//! on and finds smaller errors at more speed. The barrier and damping have no more current either. A motor
//! with `L I / 4` above 1.7 flux is never proven. Where the speed limit exceeds that of braking, the outputs
//! go off.

use crate::motor::ElectricalAngle;
use crate::real::abs;

/// Share of the axis' current limit that is permitted before the angle is proven.
pub const CURRENT_SHARE: f32 = 0.25;
/// Greatest speed until then, over that at which a frozen counter shows at the greatest permitted current.
pub const SPEED_SHARE: f32 = 3.5;
/// Travel that proves the angle, motor turns.
const PROOF_TURNS: f32 = 0.25;

/// State of the first motion; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FirstMotion {
    /// Travel still to be counted, electrical turns; zero once the angle is proven.
    left: f32,
    /// Angle in the last servo period.
    angle: ElectricalAngle,
}

impl FirstMotion {
    /// Whether the limits apply.
    #[inline(always)]
    pub(super) fn is_limited(&self) -> bool {
        self.left > 0.0
    }

    /// State of an axis whose angle is proven.
    pub(super) const PROVEN: Self = Self { left: 0.0, angle: ElectricalAngle::ZERO };

    /// State before the first motion of a motor with so many pole pairs.
    pub(super) fn before(pole_pairs: u8) -> Self {
        Self { left: PROOF_TURNS * f32::from(pole_pairs), ..Self::PROVEN }
    }

    /// Starts a motion at an angle: none of it is counted yet.
    pub(super) fn begin(&mut self, pole_pairs: u8, angle: ElectricalAngle) {
        *self = Self { angle, ..Self::before(pole_pairs) };
    }

    /// Runs one servo period with the back-EMF, the residual and the tolerance of the model watch, V.
    pub(super) fn look(
        &mut self,
        pole_pairs: u8,
        angle: ElectricalAngle,
        [back_emf, residual, tolerance]: [f32; 3],
    ) {
        let step = abs(angle.since(self.angle));
        // A residual that is not finite is beyond every tolerance.
        if !(residual <= tolerance) {
            return self.begin(pole_pairs, angle);
        }
        self.angle = angle;
        if back_emf > tolerance {
            self.left -= step;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Servo periods of a hundredth of an electrical turn each until 7 pole pairs are proven, of 400.
    fn proven_after(volts: impl Fn(u32) -> [f32; 3]) -> Option<u32> {
        let mut motion = FirstMotion::before(7);
        motion.begin(7, ElectricalAngle::from_turns(0.3));
        (1..=400).find(|period| {
            // To and fro: travel in either direction counts.
            let way = if *period <= 100 { *period } else { 200 - *period % 200 };
            motion.look(7, ElectricalAngle::from_turns(0.3 + 0.01 * way as f32), volts(*period));
            !motion.is_limited()
        })
    }

    #[test]
    fn a_quarter_of_a_motor_turn_in_a_row_proves_the_angle() {
        // 1.75 electrical turns.
        assert!(proven_after(|_| [1.0, 0.5, 0.9]).is_some_and(|period| (175..=177).contains(&period)));
        // The back-EMF does not exceed the tolerance.
        assert_eq!(proven_after(|_| [0.89, 0.5, 0.9]), None);
        // A single residual beyond it, or one that is not finite, starts anew.
        for residual in [0.91, f32::NAN] {
            let once = |period| [1.0, if period == 150 { residual } else { 0.5 }, 0.9];
            assert!(proven_after(once).is_some_and(|period| (325..=327).contains(&period)), "{residual}");
            let again = |period: u32| [1.0, if period.is_multiple_of(150) { residual } else { 0.5 }, 0.9];
            assert_eq!(proven_after(again), None, "{residual}");
        }
        // Slow periods in between count nothing and take nothing.
        let slow = |period: u32| [if period.is_multiple_of(2) { 1.0 } else { 0.5 }, 0.5, 0.9];
        assert!(proven_after(slow).is_some_and(|period| (349..=353).contains(&period)));
    }
}
