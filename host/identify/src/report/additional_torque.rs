//! Springs and friction by load, as data and in words.

use scarab::real::sign;
use serde::{Deserialize, Serialize};

/// Kind of an additional torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AdditionalKind {
    /// Spring beside the drive.
    Spring,
    /// Gear friction that grows with the transmitted torque.
    LoadFriction,
}

impl AdditionalKind {
    /// Both kinds.
    pub(crate) const ALL: [Self; 2] = [Self::Spring, Self::LoadFriction];

    /// Key in leg files, and name of the cause.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Spring => "spring",
            Self::LoadFriction => "load_friction",
        }
    }
}

/// An additional torque of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdditionalTorque {
    /// Joint, from 1.
    pub joint: usize,
    /// What causes it.
    pub kind: AdditionalKind,
    /// Stiffness, N m/rad, or friction as a share of the load.
    pub value: f64,
    /// Standard deviation of the value.
    pub sigma: f64,
    /// Change of each base parameter with one standard deviation of the value: their covariance over `sigma`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shift: Vec<f64>,
}

impl AdditionalTorque {
    /// Torque for a value of 1, where the bodies, gravity and rotor make this load.
    pub(crate) fn slope(&self, load_nm: f64, angle_rad: f64, speed_rad_s: f64) -> f64 {
        match self.kind {
            AdditionalKind::Spring => angle_rad,
            AdditionalKind::LoadFriction => sign(speed_rad_s) * load_nm.abs(),
        }
    }

    /// Kind and joint in words.
    pub fn subject(&self) -> String {
        match self.kind {
            AdditionalKind::Spring => format!("spring at joint {}", self.joint),
            AdditionalKind::LoadFriction => format!("friction by load of joint {}", self.joint),
        }
    }

    /// Value and standard deviation in words.
    pub fn words(&self) -> String {
        let Self { value, sigma, .. } = self;
        match self.kind {
            AdditionalKind::Spring => {
                format!(
                    "{value:.2} +- {sigma:.2} N m/rad; its torque at angle zero is {}",
                    rest_name(self.joint - 1)
                )
            }
            AdditionalKind::LoadFriction => {
                format!("{:.2} +- {:.2} % of the load", 100.0 * value, 100.0 * sigma)
            }
        }
    }
}

/// Name of the torque of a joint's spring (from 0) at angle zero: minus stiffness times angle at rest. Torque
/// determines its sum with the offset only.
pub(crate) fn rest_name(joint: usize) -> String {
    format!("REST{}", joint + 1)
}
