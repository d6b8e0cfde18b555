//! Limits of each joint, and the refusal of implausible ones.

use crate::checksum::Checksum;
use crate::real::{abs, is_finite, min};
use crate::units::{
    Ampere, KilogramMetreSquared, NewtonMetre, NewtonMetrePerAmpere, Radian, RadianPerSecond,
    RadianPerSecondSquared,
};

/// Share of the torque cap assumed for braking; the rest is left to gravity. Gravity is largest on a raised
/// leg: 64 of 100 N m for the default leg held level, 49 at the end of its range.
const BRAKING_SHARE: f32 = 0.5;

/// Limits of one joint, in the model's angle and sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Smallest angle.
    pub low: Radian,
    /// Largest angle.
    pub high: Radian,
    /// Largest commanded speed; 1.1 times as much is a fault.
    pub speed: RadianPerSecond,
    /// Largest commanded torque.
    pub(crate) torque: NewtonMetre,
    /// Largest commanded motor current.
    pub(crate) current: Ampere,
    /// Joint torque per motor current; negative where the model's sign is opposite to the drive's.
    pub torque_per_ampere: NewtonMetrePerAmpere,
    /// Largest inertia that the joint moves, with rotor and distal links.
    pub inertia: KilogramMetreSquared,
}

/// Validated limits of a whole leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<const N: usize> {
    joints: [JointLimits; N],
}

/// Names a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitQuantity {
    /// The range: each end within -2 pi..=2 pi, and at least 2 degrees between them.
    Range,
    /// Speed: above 0, at most 50 rad/s.
    Speed,
    /// Torque: above 0, at most 1,000 N m.
    Torque,
    /// Current: above 0, at most 300 A.
    Current,
    /// Torque per current: 0.001..=100 N m/A of either sign.
    TorquePerAmpere,
    /// Inertia: above 0.0001, at most 100 kg m^2.
    Inertia,
}

/// An implausible limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitsError {
    /// Counted from 0.
    pub joint: usize,
    /// The refused limit.
    pub quantity: LimitQuantity,
}

impl JointLimits {
    /// Largest torque that respects both the torque and the current limit.
    pub fn torque_cap(&self) -> NewtonMetre {
        NewtonMetre(min(self.torque.0, self.current.0 * abs(self.torque_per_ampere.0)))
    }

    /// Assumed deceleration of the joint. A motion with less acceleration is never limited on its way to the
    /// end of the range.
    pub(crate) fn braking_acceleration(&self) -> RadianPerSecondSquared {
        RadianPerSecondSquared(BRAKING_SHARE * self.torque_cap().0 / self.inertia.0)
    }

    /// Adds all values to a checksum.
    pub(crate) fn add_to(&self, sum: Checksum) -> Checksum {
        let Self { low, high, speed, torque, current, torque_per_ampere, inertia } = *self;
        sum.numbers([low.0, high.0, speed.0, torque.0, current.0, torque_per_ampere.0, inertia.0])
    }

    fn absurd(&self) -> Option<LimitQuantity> {
        const LARGEST_ANGLE: f32 = core::f32::consts::TAU;
        const SMALLEST_RANGE: f32 = 0.034_9;
        let between = |value: f32, low: f32, high: f32| value > low && value <= high;
        let range = self.low.0 >= -LARGEST_ANGLE
            && self.high.0 <= LARGEST_ANGLE
            && is_finite(self.low.0)
            && is_finite(self.high.0)
            && self.high.0 - self.low.0 >= SMALLEST_RANGE;
        [
            (range, LimitQuantity::Range),
            (between(self.speed.0, 0.0, 50.0), LimitQuantity::Speed),
            (between(self.torque.0, 0.0, 1000.0), LimitQuantity::Torque),
            (between(self.current.0, 0.0, 300.0), LimitQuantity::Current),
            (between(abs(self.torque_per_ampere.0), 0.000_999, 100.0), LimitQuantity::TorquePerAmpere),
            (between(self.inertia.0, 0.0001, 100.0), LimitQuantity::Inertia),
        ]
        .into_iter()
        .find_map(|(sensible, quantity)| (!sensible).then_some(quantity))
    }
}

impl<const N: usize> Limits<N> {
    /// Validates the limits; the error names the first refused joint and quantity.
    pub fn new(joints: [JointLimits; N]) -> Result<Self, LimitsError> {
        for (joint, limits) in joints.iter().enumerate() {
            if let Some(quantity) = limits.absurd() {
                return Err(LimitsError { joint, quantity });
            }
        }
        Ok(Self { joints })
    }

    /// Per joint, proximal first.
    pub fn joints(&self) -> &[JointLimits; N] {
        &self.joints
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// The default leg's hip: 100 N m, 4.5 rad/s, the paper's working range.
    pub(crate) const HIP: JointLimits = JointLimits {
        low: Radian(0.038),
        high: Radian(0.876),
        speed: RadianPerSecond(3.125),
        torque: NewtonMetre(100.0),
        current: Ampere(80.0),
        torque_per_ampere: NewtonMetrePerAmpere(1.5),
        inertia: KilogramMetreSquared(5.5),
    };

    /// The default leg's knee, with the opposite sign of its drive.
    pub(crate) const KNEE: JointLimits = JointLimits {
        low: Radian(-1.667),
        high: Radian(-0.12),
        inertia: KilogramMetreSquared(2.53),
        torque_per_ampere: NewtonMetrePerAmpere(-1.5),
        ..HIP
    };

    #[test]
    fn implausible_limits_are_refused_with_joint_and_quantity() {
        assert!(Limits::new([HIP, KNEE]).is_ok());
        let unknown = NewtonMetrePerAmpere(0.0);
        let implausible = [
            (LimitQuantity::Range, JointLimits { low: Radian(1.0), ..HIP }),
            (LimitQuantity::Range, JointLimits { high: Radian(f32::NAN), ..HIP }),
            (LimitQuantity::Range, JointLimits { low: Radian(-100.0), ..HIP }),
            (LimitQuantity::Range, JointLimits { low: Radian(0.87), ..HIP }),
            (LimitQuantity::Speed, JointLimits { speed: RadianPerSecond(0.0), ..HIP }),
            (LimitQuantity::Speed, JointLimits { speed: RadianPerSecond(f32::INFINITY), ..HIP }),
            (LimitQuantity::Torque, JointLimits { torque: NewtonMetre(-5.0), ..HIP }),
            (LimitQuantity::Torque, JointLimits { torque: NewtonMetre(1e6), ..HIP }),
            (LimitQuantity::Current, JointLimits { current: Ampere(f32::NAN), ..HIP }),
            (LimitQuantity::TorquePerAmpere, JointLimits { torque_per_ampere: unknown, ..HIP }),
            (LimitQuantity::Inertia, JointLimits { inertia: KilogramMetreSquared(0.0), ..HIP }),
        ];
        for (quantity, limits) in implausible {
            assert_eq!(Limits::new([HIP, limits]), Err(LimitsError { joint: 1, quantity }), "{limits:?}");
            assert_eq!(Limits::new([limits, HIP]), Err(LimitsError { joint: 0, quantity }), "{limits:?}");
        }
    }

    #[test]
    fn the_torque_cap_respects_the_current_limit_of_either_sign() {
        assert_eq!(HIP.torque_cap(), NewtonMetre(100.0));
        let weak = JointLimits { current: Ampere(40.0), ..KNEE };
        assert_eq!(weak.torque_cap(), NewtonMetre(60.0));
    }
}
