//! All kinds of motion of a leg, as one type.

use super::{HARMONICS, JointEnvelope, LimitViolation, MotionState, Periodic, Proof, Ramp, bounds};
use crate::units::{Radian, RadianPerSecond, RadianPerSecondSquared};

/// Motion of `N` joints with at most `H` harmonics; starts and ends at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion<const N: usize, const H: usize = HARMONICS> {
    /// Hold a pose, rad, until another command.
    Hold([f32; N]),
    /// Move from a pose to a pose.
    Ramp(Ramp<N>),
    /// Move in whole cycles of a curve, an excitation or a gait, between two blends.
    Periodic(Periodic<N, H>),
}

impl<const N: usize, const H: usize> Motion<N, H> {
    /// State `tick` ticks after the start; before and after the motion at rest at its ends.
    pub fn state_at(&self, tick: u32) -> MotionState<N> {
        match self {
            Self::Hold(pose_rad) => MotionState::at_rest(*pose_rad),
            Self::Ramp(ramp) => ramp.state_at(tick),
            Self::Periodic(periodic) => periodic.state_at(tick),
        }
    }

    /// Ticks until the joints are at rest at the motion's end; `None` for a held pose.
    pub fn duration_ticks(&self) -> Option<u32> {
        match self {
            Self::Hold(_) => None,
            Self::Ramp(ramp) => Some(ramp.duration_ticks()),
            Self::Periodic(periodic) => Some(periodic.duration_ticks()),
        }
    }

    /// Pose at rest before the motion, rad.
    pub fn start_rad(&self) -> [f32; N] {
        self.state_at(0).position_rad
    }

    /// Pose at rest after the motion, rad.
    pub fn end_rad(&self) -> [f32; N] {
        self.state_at(u32::MAX).position_rad
    }

    /// Proven bounds of the whole motion.
    pub fn envelope(&self) -> [JointEnvelope; N] {
        match self {
            Self::Hold(pose_rad) => pose_rad.map(|angle| JointEnvelope {
                low: Radian(angle),
                high: Radian(angle),
                speed: RadianPerSecond::ZERO,
                acceleration: RadianPerSecondSquared::ZERO,
            }),
            Self::Ramp(ramp) => ramp.envelope(),
            Self::Periodic(periodic) => periodic.envelope(),
        }
    }

    /// Proves that the whole motion stays within limits; the error names the first
    /// joint and quantity that may not.
    pub fn prove(&self, limits: &[JointEnvelope; N]) -> Result<Proof<N>, LimitViolation> {
        bounds::prove(self.envelope(), limits)
    }
}

#[cfg(test)]
mod tests {
    use super::super::fourier::tests::random_curve;
    use super::*;
    use crate::units::Second;

    #[test]
    fn approach_excitation_and_hold_join_without_a_step() {
        let periodic = Motion::<2>::Periodic(
            Periodic::new(random_curve(4), Second(1.0), 1, 4000).expect("positive times"),
        );
        let speed = [RadianPerSecond(1.0); 2];
        let acceleration = [RadianPerSecondSquared(3.0); 2];
        let ramp = Ramp::between([0.0; 2], periodic.start_rad(), speed, acceleration, 4000);
        let approach = Motion::<2>::Ramp(ramp.expect("positive limits"));
        assert_eq!(approach.end_rad(), periodic.start_rad());
        let hold = Motion::<2>::Hold(periodic.end_rad());
        let last = periodic.duration_ticks().expect("it ends");
        assert_eq!(periodic.state_at(last), hold.state_at(0));
        assert_eq!(hold.duration_ticks(), None);
    }

    #[test]
    fn a_blend_too_short_for_the_acceleration_limit_is_refused() {
        let curve = random_curve(4);
        let mut limits = curve.envelope();
        for joint in &mut limits {
            joint.acceleration.0 *= 1.2;
        }
        let motion = |blend| {
            Motion::<2>::Periodic(Periodic::new(curve, Second(blend), 1, 4000).expect("positive times"))
        };
        assert!(motion(20.0).prove(&limits).is_ok());
        let violation = motion(0.1).prove(&limits).expect_err("1.5 qd / 0.1 s");
        assert_eq!(violation.quantity, super::super::Quantity::Acceleration);
    }
}
