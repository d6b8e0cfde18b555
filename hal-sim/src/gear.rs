//! Rigid gear between motor and joint.
//!
//! motor angle = ratio * joint angle. Whatever turns with the motor is felt at the joint multiplied by the
//! ratio squared, and is described there (`rotor_inertia`), so the gear carries angles only, and
//! `torque_per_ampere` is stated at the joint. Known limits: no elasticity, no backlash, no loss that depends
//! on load.

/// Motor turns per joint turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gear {
    ratio: f64,
}

impl Gear {
    /// Of a ratio (motor turns per joint turn), not 0.
    #[must_use]
    pub const fn new(ratio: f64) -> Self {
        Self { ratio }
    }

    /// Angle on the fast side, same unit as the joint's.
    #[must_use]
    pub fn motor_angle(&self, joint_angle: f64) -> f64 {
        self.ratio * joint_angle
    }
}
