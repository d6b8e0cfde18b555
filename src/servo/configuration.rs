//! What the servo must be told about each joint, and the refusal of what makes no sense.

use super::JointScale;
use crate::safety::{JointLimits, LimitsError};
use crate::units::{Ampere, Hertz, KilogramMetreSquared, NewtonMetre, Radian, RadianPerSecond};

/// One joint of the servo. Range and signs are the model's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointConfiguration {
    /// Counts and currents to the model's angles and torques.
    pub scale: JointScale,
    /// Smallest angle.
    pub low: Radian,
    /// Largest angle.
    pub high: Radian,
    /// Largest speed that is commanded.
    pub speed: RadianPerSecond,
    /// Largest torque that is commanded.
    pub torque: NewtonMetre,
    /// Largest motor current that is commanded.
    pub current: Ampere,
    /// Largest inertia the joint moves, rotor and the links beyond it included.
    pub inertia: KilogramMetreSquared,
    /// Bandwidth of the position loop, 0.5..=8 Hz; see [`super::ControllerGains`].
    pub bandwidth: Hertz,
}

/// Why a configuration is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ServoError {
    /// A limit makes no sense.
    Limits(LimitsError),
    /// The scale of this joint (from 0) makes no sense.
    Scale {
        /// Counted from 0.
        joint: usize,
    },
    /// The bandwidth of this joint (from 0) is out of range.
    Bandwidth {
        /// Counted from 0.
        joint: usize,
    },
}

impl JointConfiguration {
    /// The limits as the monitor wants them.
    #[must_use]
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
