//! Statusword (6041).
//!
//! ```text
//! bits 0-3, 5, 6  state          4 voltage, 9 remote       10 target reached   11 internal limit active
//! bit 12   profile position: set-point acknowledge; homing: attained; cyclic: the command is followed
//! bit 13   positions: following error; homing: error
//! bit 15   this joint is enabled, but the leg's bridges are off because another joint is not enabled
//! ```
//! Source: CiA 402, statusword; bit 15 is manufacturer-specific.

use crate::leg::DriveState;

/// Statusword bits of a state.
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
