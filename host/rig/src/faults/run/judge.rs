//! Comparison of a run's final state with the required one.

use scarab::safety::{DriveState, FaultCode};

use crate::faults::aftermath::leads_to;
use crate::faults::run::Watched;
use crate::faults::scenario::{Event, Expected};

impl<const B: usize> Watched<'_, B> {
    /// Returns whether the state is the catalogue's, or the firmware's alternative.
    pub(super) fn leads_to(&self, state: &str) -> bool {
        if self.scenario.expected == Expected::Damped {
            return state == "Damp";
        }
        self.row.fault.leads_to(|to| to.contains(state))
    }

    /// Returns whether the run contains only an external push and no broken part.
    pub(super) fn is_only_pushed(&self) -> bool {
        matches!(self.scenario.event, Event::Kick(..) | Event::Push(..) | Event::Hold(..) | Event::Touch(_))
    }

    /// Returns whether a push alone may cause this code; other codes report a healthy part as broken.
    pub(super) fn is_caused_by_a_push(code: FaultCode) -> bool {
        use FaultCode as Code;
        matches!(
            code,
            Code::PositionLimit
                | Code::Overspeed
                | Code::Overcurrent
                | Code::BusVoltage
                | Code::FollowingError
        )
    }

    /// Safe state of the machine, if it is in one.
    pub(super) fn safe_state(&self) -> Option<&'static str> {
        match self.scenario.expected {
            Expected::Restarted => return self.rig.is_restarted().then_some("Refuse"),
            Expected::Released if self.rig.is_switching() => return None,
            _ => {}
        }
        match (self.rig.is_switching(), self.rig.state()) {
            (false, _) => Some("Off"),
            (true, _) if self.rig.is_braking() => Some("Short"),
            (true, DriveState::FaultReactionActive { .. }) => Some("Damp"),
            (true, _) => None,
        }
    }

    /// Checks that the machine's state is allowed for the reported code, whichever detector reported it.
    pub(super) fn judge(&mut self, state: &'static str, code: FaultCode) {
        if !leads_to(code).contains(&state) {
            self.invariants.note(&self.rig, &format!("led to {state}"));
        }
    }
}
