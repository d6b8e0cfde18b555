//! What the leg tells about one joint, and the statusword (6041) made of it.
//!
//! ```text
//! bits 0-3, 5, 6  state          4 voltage, 9 remote       10 target reached   11 a limit acts
//! bit 12   profile position: set-point taken; homing: attained; cyclic: the command is followed
//! bit 13   positions: following error; homing: error
//! bit 15   enabled as far as this joint is concerned, but the leg's bridges are off: the other joint is not enabled (yet)
//! ```
//! Source: CiA 402, statusword; bit 15 is Scarab's.

use crate::leg::DriveState;
use crate::units::{NewtonMetre, Radian, RadianPerSecond};

/// One joint at one tick; angles and torques with the anatomical sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisStatus {
    /// Where the leg's drive stands.
    pub drive: DriveState,
    /// Measured.
    pub position: Radian,
    /// Measured.
    pub velocity: RadianPerSecond,
    /// Measured: of the motor's current.
    pub torque: NewtonMetre,
    /// Commanded after profile and interpolation.
    pub position_demand: Radian,
    /// Commanded after profile and interpolation.
    pub velocity_demand: RadianPerSecond,
    /// Commanded, as it was let through.
    pub torque_demand: NewtonMetre,
    /// The mode the leg is in (6061); 0 is none.
    pub mode: i8,
    /// The target of that mode is reached, or the joint stands after a halt.
    pub reached: bool,
    /// Less is commanded than was asked for.
    pub limited: bool,
    /// Homing has been done.
    pub homed: bool,
    /// The following error has been too large for too long; of homing: it failed.
    pub deviates: bool,
    /// Digital inputs, CiA 402's bits.
    pub inputs: u32,
}

impl AxisStatus {
    /// Before the leg's first tick.
    pub const NONE: Self = Self {
        drive: DriveState::NotReadyToSwitchOn,
        position: Radian::ZERO,
        velocity: RadianPerSecond::ZERO,
        torque: NewtonMetre::ZERO,
        position_demand: Radian::ZERO,
        velocity_demand: RadianPerSecond::ZERO,
        torque_demand: NewtonMetre::ZERO,
        mode: 0,
        reached: false,
        limited: false,
        homed: false,
        deviates: false,
        inputs: 0,
    };
}

/// The bits of a state.
pub(super) const fn state_bits(state: DriveState) -> u16 {
    match state {
        DriveState::NotReadyToSwitchOn => 0x00,
        DriveState::SwitchOnDisabled => 0x40,
        DriveState::ReadyToSwitchOn => 0x21,
        DriveState::SwitchedOn => 0x23,
        DriveState::OperationEnabled => 0x27,
        DriveState::QuickStopActive { .. } => 0x07,
        DriveState::FaultReactionActive { .. } => 0x0F,
        DriveState::Fault { .. } => 0x08,
    }
}
