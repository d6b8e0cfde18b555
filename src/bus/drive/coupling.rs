//! Coupling of the joints of one leg: the power request that follows from their states.
//!
//! ```text
//! the leg steps up        if every joint's state is higher
//! the leg steps down      if any joint's state is lower, or a joint stops
//! the leg has stepped down: joints above it follow and must be enabled again
//! ```
//!
//! Why the lowest: a joint whose host has not requested it must not be powered because its neighbour is
//! enabled. Why no joint stays above: a leg that was stopped must not restart with a controlword sent before.

use super::control::Axis;
use crate::leg::{DriveState, PowerRequest};

/// Rank of a state on the way to enabled.
pub(super) const fn level(state: DriveState) -> u8 {
    match state {
        DriveState::ReadyToSwitchOn => 1,
        DriveState::SwitchedOn => 2,
        DriveState::OperationEnabled => 3,
        _ => 0,
    }
}

/// Rank of the leg's state at the last call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Coupling {
    before: u8,
}

impl Coupling {
    /// Without a host: every joint takes the leg's state, and pending requests are discarded.
    pub(crate) fn follow_leg<const N: usize>(&mut self, axes: [&mut Axis; N], drive: DriveState) {
        self.before = level(drive);
        for axis in axes {
            (axis.own, axis.resets) = (drive, false);
        }
    }

    /// Returns the power request for the leg's next tick. `drive` is the state of the leg's drive; `refused`
    /// says whether it refused the last request. Call [`Axis::update`] of every joint before.
    pub(crate) fn power<const N: usize>(
        &mut self,
        axes: [&mut Axis; N],
        drive: DriveState,
        refused: bool,
    ) -> Option<PowerRequest> {
        use PowerRequest::{
            DisableOperation, DisableVoltage, EnableOperation, QuickStop, ResetFault, Shutdown, SwitchOn,
        };
        let now = level(drive);
        let has_gone_down = now < core::mem::replace(&mut self.before, now) || refused;
        let is_stopping = matches!(drive, DriveState::QuickStopActive { .. });
        let (mut lowest, mut resets, mut stops) = (3, false, false);
        for axis in axes {
            resets |= core::mem::take(&mut axis.resets);
            let is_above = level(axis.own) > now;
            let wants_stop = matches!(axis.own, DriveState::QuickStopActive { .. });
            let follows = drive.fault().is_some()
                || drive == DriveState::NotReadyToSwitchOn
                || axis.own == DriveState::NotReadyToSwitchOn
                || axis.own.fault().is_some()
                || is_stopping
                || has_gone_down && is_above;
            if follows {
                axis.own = drive;
            } else if wants_stop && !drive.is_enabled() {
                // A quick stop without power ends at once.
                axis.own = DriveState::SwitchOnDisabled;
            }
            stops |= wants_stop && drive.is_enabled();
            lowest = lowest.min(level(axis.own));
        }
        match drive {
            DriveState::Fault { .. } => resets.then_some(ResetFault),
            DriveState::OperationEnabled if stops => Some(QuickStop),
            DriveState::QuickStopActive { .. } | DriveState::FaultReactionActive { .. } => None,
            _ if lowest < now => Some(match lowest {
                2 => DisableOperation,
                1 => Shutdown,
                _ => DisableVoltage,
            }),
            DriveState::SwitchOnDisabled if lowest > 0 => Some(Shutdown),
            DriveState::ReadyToSwitchOn if lowest > 1 => Some(SwitchOn),
            DriveState::SwitchedOn if lowest > 2 => Some(EnableOperation),
            _ => None,
        }
    }
}
