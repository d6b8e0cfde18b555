//! The drive states of CiA 402, one for the whole leg, and their transitions as a pure function.
//!
//! ```text
//!   NotReadyToSwitchOn
//!          | first tick without a fault
//!          v                 disable voltage, quick stop
//!   SwitchOnDisabled <---------------------------------------+----------------+
//!     |         ^  ^                                         |                |
//!     | shut-   |  | disable voltage, quick stop             |                | disable voltage,
//!     | down    |  |                                         |                | 300 ms over
//!     v         |  |        switch on           enable       |                |
//!   ReadyToSwitchOn ---------------> SwitchedOn ------> OperationEnabled --> QuickStopActive
//!          ^   ^     <--------------    |   ^  <------      |     quick stop   (damping)
//!          |   |        shutdown        |   |    disable    |
//!          |   +------------------------+   +-- operation --+
//!          +------------ shutdown ---------------------------
//!
//!   any ---- fault, drive off or reaction Off -----------------------> Fault --- reset ---> SwitchOnDisabled
//!   OperationEnabled, QuickStopActive --- fault ---> FaultReactionActive --- 300 ms over ---^
//! ```
//!
//! Source: CiA 402-2 (IEC 61800-7-201), the state machine of the power drive system. Its optional transition
//! from QuickStopActive back to OperationEnabled is not offered: after a quick stop the operator starts over.
//! A request without an arrow from the present state changes nothing.

use super::fault::{Fault, Reaction};

/// State of a leg's drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// Before the first tick without a fault.
    NotReadyToSwitchOn,
    /// Off; waits for shutdown, the first of the three requests that enable.
    SwitchOnDisabled,
    /// Off; may be switched on.
    ReadyToSwitchOn,
    /// Still off; may be enabled.
    SwitchedOn,
    /// The joints follow their commands.
    OperationEnabled,
    /// Damps on request, then turns off.
    QuickStopActive {
        /// Ticks of damping left, this one included.
        remaining_ticks: u32,
    },
    /// Damps because of a fault, then turns off.
    FaultReactionActive {
        /// The first fault.
        fault: Fault,
        /// Ticks of damping left, this one included.
        remaining_ticks: u32,
    },
    /// Off until reset.
    Fault {
        /// The first fault.
        fault: Fault,
    },
}

/// Request of the operator, effective at one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerRequest {
    /// Control word 6.
    Shutdown,
    /// Control word 7.
    SwitchOn,
    /// Control word F, from 7.
    EnableOperation,
    /// Control word 7, from F.
    DisableOperation,
    /// Control word 0.
    DisableVoltage,
    /// Control word 2.
    QuickStop,
    /// Rising edge of bit 7.
    ResetFault,
}

impl PowerRequest {
    /// Returns whether the request is a step towards enabled.
    pub(crate) const fn enables(self) -> bool {
        matches!(self, Self::Shutdown | Self::SwitchOn | Self::EnableOperation)
    }
}

/// Event that may change the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// A tick without a new fault.
    Tick,
    /// A request of the operator.
    Requested(PowerRequest),
    /// A detected fault.
    Failed(Fault),
}

/// Operation that a state permits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Permission {
    /// Outputs off.
    Off = 0,
    /// Follow the request within the limits.
    Follow = 1,
    /// Damp regardless of the request.
    Damp = 2,
}

impl DriveState {
    /// Operation that this state permits.
    #[inline]
    pub const fn permission(self) -> Permission {
        match self {
            Self::OperationEnabled => Permission::Follow,
            Self::QuickStopActive { .. } | Self::FaultReactionActive { .. } => Permission::Damp,
            _ => Permission::Off,
        }
    }

    /// Whether the joints follow their commands.
    #[inline]
    pub const fn is_enabled(self) -> bool {
        matches!(self, Self::OperationEnabled)
    }

    /// The latched fault, or the one being reacted to.
    pub const fn fault(self) -> Option<Fault> {
        match self {
            Self::FaultReactionActive { fault, .. } | Self::Fault { fault } => Some(fault),
            _ => None,
        }
    }

    /// State of a drive whose joints have no valid readings: off, and a fault stays until its reset.
    pub const fn at_rest(self) -> Self {
        match self.fault() {
            Some(fault) => Self::Fault { fault },
            None => Self::NotReadyToSwitchOn,
        }
    }

    /// The state after an event; damping lasts `damp_ticks`.
    pub(crate) const fn after(self, event: Event, damp_ticks: u32) -> Self {
        match event {
            Event::Tick => self.after_tick(),
            Event::Requested(request) => self.after_request(request, damp_ticks),
            Event::Failed(fault) => self.after_fault(fault, damp_ticks),
        }
    }

    const fn after_tick(self) -> Self {
        match self {
            Self::NotReadyToSwitchOn => Self::SwitchOnDisabled,
            Self::QuickStopActive { remaining_ticks } if remaining_ticks > 1 => {
                Self::QuickStopActive { remaining_ticks: remaining_ticks - 1 }
            }
            Self::QuickStopActive { .. } => Self::SwitchOnDisabled,
            Self::FaultReactionActive { fault, remaining_ticks } if remaining_ticks > 1 => {
                Self::FaultReactionActive { fault, remaining_ticks: remaining_ticks - 1 }
            }
            Self::FaultReactionActive { fault, .. } => Self::Fault { fault },
            state => state,
        }
    }

    const fn after_request(self, request: PowerRequest, damp_ticks: u32) -> Self {
        use PowerRequest as Request;
        match (self, request) {
            (Self::SwitchOnDisabled | Self::SwitchedOn | Self::OperationEnabled, Request::Shutdown) => {
                Self::ReadyToSwitchOn
            }
            (Self::ReadyToSwitchOn, Request::SwitchOn) => Self::SwitchedOn,
            (Self::SwitchedOn, Request::EnableOperation) => Self::OperationEnabled,
            (Self::OperationEnabled, Request::DisableOperation) => Self::SwitchedOn,
            (Self::OperationEnabled, Request::QuickStop) => {
                Self::QuickStopActive { remaining_ticks: damp_ticks }
            }
            (Self::ReadyToSwitchOn | Self::SwitchedOn, Request::DisableVoltage | Request::QuickStop)
            | (Self::OperationEnabled | Self::QuickStopActive { .. }, Request::DisableVoltage)
            | (Self::Fault { .. }, Request::ResetFault) => Self::SwitchOnDisabled,
            (state, _) => state,
        }
    }

    /// The first fault remains the reported one. Damping is never prolonged: a fault during a quick stop or
    /// during another fault's reaction uses the remaining ticks.
    const fn after_fault(self, fault: Fault, damp_ticks: u32) -> Self {
        let first = match self.fault() {
            Some(first) => first,
            None => fault,
        };
        let ticks = match self {
            Self::OperationEnabled => damp_ticks,
            Self::QuickStopActive { remaining_ticks } | Self::FaultReactionActive { remaining_ticks, .. } => {
                remaining_ticks.saturating_sub(1)
            }
            _ => 0,
        };
        match fault.code.reaction() {
            Reaction::Damp if ticks > 0 => Self::FaultReactionActive { fault: first, remaining_ticks: ticks },
            _ => Self::Fault { fault: first },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fault::FaultCode;
    use super::*;

    const DAMP_TICKS: u32 = 1200;
    const OVERSPEED: Fault = Fault { code: FaultCode::Overspeed, joint: 1 };
    const NOT_FINITE: Fault = Fault { code: FaultCode::NotFinite, joint: 0 };
    const STATES: [DriveState; 8] = [
        DriveState::NotReadyToSwitchOn,
        DriveState::SwitchOnDisabled,
        DriveState::ReadyToSwitchOn,
        DriveState::SwitchedOn,
        DriveState::OperationEnabled,
        DriveState::QuickStopActive { remaining_ticks: 7 },
        DriveState::FaultReactionActive { fault: OVERSPEED, remaining_ticks: 7 },
        DriveState::Fault { fault: OVERSPEED },
    ];
    const REQUESTS: [PowerRequest; 7] = [
        PowerRequest::Shutdown,
        PowerRequest::SwitchOn,
        PowerRequest::EnableOperation,
        PowerRequest::DisableOperation,
        PowerRequest::DisableVoltage,
        PowerRequest::QuickStop,
        PowerRequest::ResetFault,
    ];

    #[test]
    fn every_request_in_every_state_follows_cia_402() {
        // Rows: the states above. Columns: the requests above. Entries: index of the next state, "." for no
        // change.
        let table = [
            ". . . . . . .", //
            "2 . . . . . .",
            ". 3 . . 1 1 .",
            "2 . 4 . 1 1 .",
            "2 . . 3 1 5 .",
            ". . . . 1 . .",
            ". . . . . . .",
            ". . . . . . 1",
        ];
        for (state, row) in STATES.into_iter().zip(table) {
            for (request, entry) in REQUESTS.into_iter().zip(row.split(' ')) {
                let expected = match entry {
                    "." => state,
                    "5" => DriveState::QuickStopActive { remaining_ticks: DAMP_TICKS },
                    index => STATES[index.parse::<usize>().expect("a digit")],
                };
                let after = state.after(Event::Requested(request), DAMP_TICKS);
                assert_eq!(after, expected, "{state:?} {request:?}");
            }
        }
    }

    #[test]
    fn a_fault_damps_an_enabled_drive_and_keeps_a_disabled_one_off() {
        for state in STATES {
            let failed = state.after(Event::Failed(OVERSPEED), DAMP_TICKS);
            use DriveState::{FaultReactionActive, OperationEnabled, QuickStopActive};
            let damps =
                matches!(state, OperationEnabled | QuickStopActive { .. } | FaultReactionActive { .. });
            let expected = if damps { Permission::Damp } else { Permission::Off };
            assert_eq!(failed.permission(), expected, "{state:?}");
            assert_eq!(failed.fault(), Some(OVERSPEED));
            let off = state.after(Event::Failed(NOT_FINITE), DAMP_TICKS);
            assert_eq!(off.permission(), Permission::Off, "{state:?}");
        }
        let mut state = DriveState::OperationEnabled.after(Event::Failed(OVERSPEED), DAMP_TICKS);
        let mut damped = 0;
        while state.permission() == Permission::Damp {
            damped += 1;
            // A second fault neither prolongs the damping nor replaces the first.
            let later = Fault { code: FaultCode::PositionLimit, joint: 0 };
            let event = if damped == 100 { Event::Failed(later) } else { Event::Tick };
            state = state.after(event, DAMP_TICKS);
        }
        assert_eq!((damped, state), (DAMP_TICKS, DriveState::Fault { fault: OVERSPEED }));
    }
}
