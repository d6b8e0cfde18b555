//! Drive torque: rotor inertia, Coulomb and viscous friction, a constant offset.
//!
//! ```text
//! torque = IA qdd + FC sign(qd) + FV qd + OFF               sign(0) = 0
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | IA | rotor inertia at the joint | kg m2 |
//! | FC, FV, OFF | Coulomb, viscous friction; offset | N m, N m s/rad, N m |
//!
//! Linear in its four parameters. [`Stribeck`] adds the nonlinear part: friction that falls with speed.
//! Source: B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, A survey of models, 1994.
//! Limits: friction at rest takes any value up to FC that holds the joint; the model gives 0 there.

use super::parameter::{JointParameters, Parameter};
use crate::real::{Real, abs, exp, sign};

/// Columns IA, FC, FV, OFF of a regressor at this speed (rad/s) and acceleration (rad/s2).
#[inline]
pub(crate) fn drive_columns<T: Real>(qd: T, qdd: T) -> [T; 4] {
    [qdd, sign(qd), qd, T::one()]
}

/// Torque of the drive at this speed (rad/s) and acceleration (rad/s2), N m.
#[inline]
pub(crate) fn drive_torque<T: Real>(parameters: &JointParameters<T>, qd: T, qdd: T) -> T {
    parameters[Parameter::IA.index()] * qdd + friction_torque(parameters, qd)
}

/// Coulomb and viscous friction and offset at this speed (rad/s), N m.
#[inline]
pub(crate) fn friction_torque<T: Real>(parameters: &JointParameters<T>, qd: T) -> T {
    parameters[Parameter::FC.index()] * sign(qd)
        + parameters[Parameter::FV.index()] * qd
        + parameters[Parameter::OFF.index()]
}

/// Stribeck effect: near standstill Coulomb friction is larger by `excess`.
///
/// ```text
/// FC(qd) = FC (1 + excess exp(-(qd / velocity)^2))
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stribeck<T> {
    /// Breakaway friction over Coulomb friction, less one; 0 or more.
    pub excess: T,
    /// Speed at which the excess has fallen to 1/e, rad/s; more than 0.
    pub velocity: T,
}

impl<T: Real> Stribeck<T> {
    /// Factor on the Coulomb column at this speed (rad/s). NaN where `velocity` and `qd` are both 0.
    #[inline]
    pub fn factor(&self, qd: T) -> T {
        if self.excess == T::zero() {
            return T::one(); // without the exponential
        }
        let ratio = abs(qd) / self.velocity;
        T::one() + self.excess * exp(-(ratio * ratio))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_is_odd_about_its_offset_and_zero_at_rest() {
        let mut joint = [0.0_f64; 14];
        joint[Parameter::FC.index()] = 3.0;
        joint[Parameter::FV.index()] = 1.2;
        joint[Parameter::OFF.index()] = 0.4;
        assert_eq!(friction_torque(&joint, 0.0), 0.4);
        // Exactly 3 + 1.2 / 2 either way; one rounding each.
        assert!((friction_torque(&joint, 0.5) - 4.0).abs() < 1e-15);
        assert!((friction_torque(&joint, -0.5) + 3.2).abs() < 1e-15);
    }

    #[test]
    fn stribeck_excess_is_whole_at_rest_and_gone_at_speed() {
        let curve = Stribeck { excess: 0.6_f32, velocity: 0.1 };
        assert_eq!(curve.factor(0.0), 1.6);
        assert_eq!(curve.factor(3.0), 1.0);
        assert_eq!(curve.factor(0.1), curve.factor(-0.1));
    }
}
