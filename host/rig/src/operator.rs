//! The operator of a simulated leg, who acts by the contacts.

use scarab::hal::Contacts;
use scarab::leg::Activity;
use scarab::safety::{DriveState, Permission};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::faulty_board::{PERIODS_PER_S, Rig};

/// Periods until the operator's contacts count, and until the drive has to be off or enabled.
const OPEN: u64 = PERIODS_PER_S / 5;
const ENABLED: u64 = PERIODS_PER_S;

/// Opens both contacts until the drive is off, then holds the enabling switch until it is enabled; returns
/// whether it is.
pub(crate) fn enable<const N: usize, const B: usize>(rig: &mut Rig<N, B>) -> bool {
    rig.hand = Contacts::default();
    for period in 0..ENABLED {
        if period >= OPEN && rig.state().permission() == Permission::Off {
            break;
        }
        rig.advance();
    }
    rig.hand.enabling = true;
    for _ in 0..ENABLED {
        rig.advance();
        if rig.state() == DriveState::OperationEnabled {
            return true;
        }
    }
    false
}

/// Starts an identification, or what else the leg is configured for, as an operator does: enables the drive,
/// then presses the button.
pub(crate) fn begin<const N: usize, const B: usize>(
    leg: &LegFile,
    rig: &mut Rig<N, B>,
) -> Result<(), ToolError> {
    enable(rig);
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
