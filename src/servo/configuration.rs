//! Configuration of the servo's joints, and its checks.

use super::{ControllerGains, JointScale};
use crate::safety::{JointLimits, LimitsError};
use crate::units::{Ampere, Hertz, KilogramMetreSquared, NewtonMetre, Radian, RadianPerSecond};

/// One joint of the servo. Range and signs are those of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointConfiguration {
    /// Conversion of counts and currents to the model's angles and torques.
    pub scale: JointScale,
    /// Smallest angle.
    pub low: Radian,
    /// Largest angle.
    pub high: Radian,
    /// Largest commanded speed.
    pub speed: RadianPerSecond,
    /// Largest commanded torque.
    pub torque: NewtonMetre,
    /// Largest commanded motor current.
    pub current: Ampere,
    /// Largest inertia that the joint moves, including the rotor and the links beyond it.
    pub inertia: KilogramMetreSquared,
    /// Bandwidth of the position loop, 0.5..=8 Hz; see `ControllerGains`.
    pub bandwidth: Hertz,
}

/// Reason why a configuration is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoError {
    /// A limit is invalid.
    Limits(LimitsError),
    /// The scale of this joint is invalid.
    Scale {
        /// Joint, counted from 0.
        joint: usize,
    },
    /// The bandwidth of this joint is out of range.
    Bandwidth {
        /// Joint, counted from 0.
        joint: usize,
    },
}

impl JointConfiguration {
    /// Limits in the form of the monitor.
    pub fn limits(&self) -> JointLimits {
        JointLimits {
            low: self.low,
            high: self.high,
            speed: self.speed,
            torque: self.torque,
            current: self.current,
            torque_per_ampere: self.scale.signed_torque_per_ampere(),
            inertia: self.inertia,
        }
    }

    /// Stiffness (N m/rad) and damping (N m s/rad) of the position control: the largest that a host may ask
    /// of the joint, because the margins of the loop are proved for them.
    pub fn stiffest_impedance(&self) -> [f32; 2] {
        let gains = ControllerGains::new(self.inertia, self.bandwidth, self.torque);
        [gains.stiffness_nm_per_rad(), gains.damping_nm_s_per_rad()]
    }

    pub(super) fn check(&self, joint: usize) -> Result<(), ServoError> {
        if !self.scale.is_sensible() {
            return Err(ServoError::Scale { joint });
        }
        if !(0.5..=8.0).contains(&self.bandwidth.0) {
            return Err(ServoError::Bandwidth { joint });
        }
        Ok(())
    }
}
