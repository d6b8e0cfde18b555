//! One leg, several joints: which step of the leg's power states the joints together ask for.
//!
//! ```text
//! the leg goes up a step    where every joint stands above it
//! the leg goes down         where any joint stands below it, or stops
//! the leg has gone down     no joint stays above it: whoever wants to go on asks again
//! ```
//!
//! Why the lowest: a joint whose host has not asked must not be powered because its neighbour was enabled. Why nobody stays
//! above: a leg that was stopped, by the other joint or by itself, must not start again with a word that was sent before.

use super::control::Axis;
use crate::leg::{DriveState, PowerRequest};

/// How far a state is towards enabled.
pub(super) const fn level(state: DriveState) -> u8 {
    match state {
        DriveState::ReadyToSwitchOn => 1,
        DriveState::SwitchedOn => 2,
        DriveState::OperationEnabled => 3,
        _ => 0,
    }
}

/// What is remembered of the leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coupling {
    before: u8,
}

impl Coupling {
    /// No host has the leg: every joint stands where it stands, and nothing that was asked is asked later.
    pub fn look_on<const N: usize>(&mut self, axes: [&mut Axis; N], drive: DriveState) {
        self.before = level(drive);
        for axis in axes {
            (axis.own, axis.resets) = (drive, false);
        }
    }

    /// The request for the leg's next tick, given where its drive stands and whether it refused the last one. To be called
    /// after [`Axis::update`] of every joint.
    pub fn power<const N: usize>(
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
                || has_gone_down && is_above
                // A stop with nothing to stop is off.
                || wants_stop && drive != DriveState::OperationEnabled;
            if follows {
                axis.own = drive;
            }
            stops |= wants_stop && drive == DriveState::OperationEnabled;
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
