//! Assistance that the start button of an enabled leg begins and ends.

use serde::{Deserialize, Serialize};

use scarab::assist::AssistShares;

/// Shares of the model's torques, 0..1; `periodic` -0.5..0.5, `inertia` at most 0.8.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AssistFile {
    /// Friction's lower bound.
    pub friction: f64,
    /// Inertia of the empty leg.
    pub inertia: f64,
    /// Weight of the wearer's leg.
    pub weight: f64,
    /// Torque of the wearer's periodic motion; negative resists.
    pub periodic: f64,
}

impl AssistFile {
    /// Shares of a campaign and of the chip model's session: those of `cargo sim assist` unless given.
    pub const USUAL: Self = Self { friction: 1.0, inertia: 0.5, weight: 0.5, periodic: 0.3 };

    /// Shares for the firmware.
    pub fn shares(&self) -> AssistShares {
        AssistShares {
            friction: self.friction as f32,
            inertia: self.inertia as f32,
            weight: self.weight as f32,
            periodic: self.periodic as f32,
        }
    }
}
