//! The statusword (6041).
//!
//! ```text
//! bits 0-3, 5, 6  state          4 voltage, 9 remote       10 target reached   11 a limit acts
//! bit 12   profile position: set-point taken; homing: attained; cyclic: the command is followed
//! bit 13   positions: following error; homing: error
//! bit 15   enabled as far as this joint is concerned, but the leg's bridges are off: the other joint is not enabled (yet)
//! ```
//! Source: CiA 402, statusword; bit 15 is Scarab's.

use crate::leg::DriveState;

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
