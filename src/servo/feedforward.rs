//! Feedforward torque from the commanded motion.
//!
//! Why from the command: commanded angles and their derivatives are exact and free of noise. A torque that
//! does not depend on measurements cannot make the loop unstable. Feedback corrects the model's error.

use crate::motion::MotionState;
use crate::real::clamp;
use crate::units::RadianPerSecond;

/// Commanded speed below which Coulomb friction fades to zero: 0.02 rad/s (1.1 degrees/s). Without it the
/// torque would jump by twice the Coulomb torque at every reversal. With it the rise lasts 2 * 0.02 rad/s
/// over the acceleration there (40 ms at 1 rad/s^2), and the drive is quiet while a pose is held.
pub(crate) const COULOMB_BAND: RadianPerSecond = RadianPerSecond(0.02);

/// Interface of a model for the servo: torques that move `N` joints as commanded, model's angles and signs.
pub trait TorqueModel<const N: usize> {
    /// Joint torques, N m, for angles `q` (rad), velocities `qd` (rad/s) and accelerations `qdd` (rad/s^2)
    /// with `gravity` in the base frame (m/s^2); friction included, its Coulomb part with `smoothed_sign`.
    fn torques(&self, q: &[f32; N], qd: &[f32; N], qdd: &[f32; N], gravity: [f32; 3]) -> [f32; N];
}

/// Absent model: feedback does all the work.
#[cfg(test)]
pub(crate) struct NoModel;

#[cfg(test)]
impl<const N: usize> TorqueModel<N> for NoModel {
    fn torques(&self, _: &[f32; N], _: &[f32; N], _: &[f32; N], _: [f32; 3]) -> [f32; N] {
        [0.0; N]
    }
}

/// Sign of a commanded velocity, smooth within [`COULOMB_BAND`]: `x (3 - x^2) / 2`, x = velocity / band,
/// limited to -1 and 1 outside; value and slope are continuous.
pub(crate) fn smoothed_sign(velocity: RadianPerSecond) -> f32 {
    let x = clamp(velocity.0 * (1.0 / COULOMB_BAND.0), -1.0, 1.0);
    x * (1.5 - 0.5 * x * x)
}

/// Torques of the model for a commanded motion, N m; zero without a model.
pub(crate) fn feedforward_nm<const N: usize, M: TorqueModel<N>>(
    model: Option<&M>,
    motion: &MotionState<N>,
    gravity: [f32; 3],
) -> [f32; N] {
    model.map_or([0.0; N], |model| {
        model.torques(
            &motion.position_rad,
            &motion.velocity_rad_per_s,
            &motion.acceleration_rad_per_s2,
            gravity,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smoothed_sign_is_odd_monotonous_and_one_outside_its_band() {
        let sign = |velocity: f32| smoothed_sign(RadianPerSecond(velocity));
        assert_eq!((sign(0.0), sign(0.02), sign(-5.0), sign(f32::INFINITY)), (0.0, 1.0, -1.0, 1.0));
        // No kink at the edge: at 99 % of the band 1.5e-4 are missing.
        assert!(sign(0.0198) > 0.9998);
        let mut before = sign(-0.03);
        for step in -300..=300 {
            let velocity = step as f32 * 1e-4;
            let here = sign(velocity);
            assert!(here >= before - 1e-7 && (here + sign(-velocity)).abs() < 1e-7);
            // Slope at most 1.5 / 0.02.
            assert!(here - before < 1.51 * 1e-4 / 0.02);
            before = here;
        }
    }
}
