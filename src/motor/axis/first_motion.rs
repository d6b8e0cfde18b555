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

use crate::motor::CountScale;

/// Share of the axis' current limit that is permitted before the angle is proven.
const CURRENT_SHARE: f32 = 0.25;
/// Greatest speed until then, over that at which a frozen counter shows at the greatest permitted current.
pub(super) const SPEED_SHARE: f32 = 3.5;
/// Travel that proves the angle, as part of a motor turn.
const PROOF_PART: i32 = 4;

/// State of the first motion; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FirstMotion {
    /// Travel still to be counted, counts; zero or less once the angle is proven.
    left: i32,
    /// Counts in the last servo period.
    counts: i32,
}

impl FirstMotion {
    /// Whether the limits apply.
    #[inline(always)]
    pub(super) fn is_limited(&self) -> bool {
        self.left > 0
    }

    /// Share of the axis' current limit that is permitted.
    pub(super) fn current_share(&self) -> f32 {
        if self.is_limited() { CURRENT_SHARE } else { 1.0 }
    }

    /// State of an axis whose angle is proven.
    pub(super) const PROVEN: Self = Self { left: 0, counts: 0 };

    /// State before the first motion, at these counts of the joint.
    pub(super) fn before(scale: &CountScale, counts: i32) -> Self {
        Self { left: scale.counts_per_turn() / PROOF_PART, counts }
    }

    /// Runs one servo period with the back-EMF, the residual and the tolerance of the model watch, V.
    pub(super) fn advance(
        &mut self,
        scale: &CountScale,
        counts: i32,
        [back_emf, residual, tolerance]: [f32; 3],
    ) {
        let step = counts.wrapping_sub(self.counts).wrapping_abs();
        // A residual that is not finite is beyond every tolerance.
        if !(residual <= tolerance) {
            *self = Self::before(scale, counts);
            return;
        }
        self.counts = counts;
        if back_emf > tolerance {
            self.left = self.left.saturating_sub(step);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Servo periods of a 700th of a motor turn each until the angle is proven, of 400.
    fn proven_after(volts: impl Fn(u32) -> [f32; 3]) -> Option<u32> {
        let scale = CountScale::new(7000, 7).expect("usual");
        let mut motion = FirstMotion::before(&scale, i32::MAX - 400);
        (1..=400_u32).find(|period| {
            // To and fro: travel in either direction counts. The counts wrap.
            let way = 100 - (*period % 200).abs_diff(100);
            motion.advance(&scale, (i32::MAX - 400).wrapping_add(10 * way as i32), volts(*period));
            !motion.is_limited()
        })
    }

    #[test]
    fn a_quarter_of_a_motor_turn_in_a_row_proves_the_angle() {
        assert!(proven_after(|_| [1.0, 0.5, 0.9]).is_some_and(|period| (175..=177).contains(&period)));
        // The back-EMF does not exceed the tolerance.
        assert_eq!(proven_after(|_| [0.89, 0.5, 0.9]), None);
        // A single residual beyond it, or one that is not finite, starts the count again.
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
