//! Rigid gear between motor and joint.
//!
//! motor angle = ratio * joint angle. Inertia on the motor side acts at the joint multiplied by the ratio
//! squared, and is described there (`rotor_inertia`). So the gear converts angles only, and
//! `torque_per_ampere` is stated at the joint.
//! Known limits: no elasticity, no backlash, no load-dependent loss.

/// Motor turns per joint turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gear {
    ratio: f64,
}

impl Gear {
    /// A gear of a ratio (motor turns per joint turn), not 0.
    #[must_use]
    pub const fn new(ratio: f64) -> Self {
        Self { ratio }
    }

    /// Motor angle, same unit as the joint's.
    #[must_use]
    pub fn motor_angle(&self, joint_angle: f64) -> f64 {
        self.ratio * joint_angle
    }
}
