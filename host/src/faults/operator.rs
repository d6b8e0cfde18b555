//! The operator who starts an identification, or what else the leg is configured for, by the contacts.

use scarab::hal::Contacts;
use scarab::leg::Activity;
use scarab::model::planar::{BASE, JOINTS};
use scarab::safety::DriveState;

use crate::base::error::ToolError;
use crate::formats::leg_file::LegFile;
use crate::rig::faulty_board::{PERIODS_PER_S, Rig};

/// Periods until the operator's contacts count, and until the drive has to be enabled.
const OPEN: u64 = PERIODS_PER_S / 5;
const ENABLED: u64 = PERIODS_PER_S;

/// Starts an identification or a session of assistance as an operator does: contacts open, the switch held
/// until the drive is enabled, the button.
pub fn begin(leg: &LegFile, rig: &mut Rig<JOINTS, BASE>) -> Result<(), ToolError> {
    for _ in 0..OPEN {
        rig.advance();
    }
    rig.hand.enabling = true;
    for _ in 0..ENABLED {
        rig.advance();
        if rig.state() == DriveState::OperationEnabled {
            break;
        }
    }
    rig.hand = Contacts { enabling: true, start: true };
    for _ in 0..ENABLED {
        rig.advance();
        if matches!(rig.leg.control().activity(), Activity::Identify(_) | Activity::Assist(_)) {
            rig.hand.start = false;
            return Ok(());
        }
    }
    Err(leg.error("the operator's contacts begin nothing").into())
}
