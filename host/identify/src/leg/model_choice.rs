//! Model terms that a leg file requests, as choices of the firmware.

use scarab::ident::{Choice, Constant, DriveChoice};

use crate::formats::leg_file::{JointFile, Switch};

/// Model requested for one joint by the leg file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TermSwitches {
    pub(crate) rotor: Switch,
    pub(crate) offset: Switch,
    pub(crate) stribeck: Switch,
    pub(crate) asymmetric: Switch,
}

impl TermSwitches {
    /// Reads the request of a joint.
    pub(crate) fn from_joint(joint: &JointFile) -> Self {
        Self {
            rotor: joint.rotor,
            offset: joint.offset,
            stribeck: joint.stribeck_model,
            asymmetric: joint.asymmetric_coulomb,
        }
    }
}

fn choice(switch: Switch) -> Choice {
    match switch {
        Switch::Auto => Choice::Auto,
        Switch::On | Switch::Within(_) => Choice::On,
        Switch::Off => Choice::Off,
    }
}

/// Choice for a joint's rotor and constant column.
pub(crate) fn drive_choice(joint: &JointFile) -> DriveChoice {
    let (constant, meaning) = match (joint.offset, joint.asymmetric_coulomb) {
        (Switch::Off | Switch::Auto, Switch::On) => (Choice::On, Constant::Asymmetry),
        (Switch::Off, Switch::Auto) => (Choice::Auto, Constant::Asymmetry),
        (offset, _) => (choice(offset), Constant::Offset),
    };
    let within_nm = match joint.offset {
        Switch::Within(within) => Some(within as f32),
        _ => None,
    };
    DriveChoice { rotor: choice(joint.rotor), constant, meaning, within_nm }
}

/// Choice for a joint's Stribeck friction.
pub(crate) fn stribeck_choice(joint: &JointFile) -> Choice {
    choice(joint.stribeck_model)
}
