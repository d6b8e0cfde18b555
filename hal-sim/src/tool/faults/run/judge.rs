//! What a run led to, and whether that is where it had to lead.

use scarab::safety::{DriveState, FaultCode};

use super::super::aftermath::leads_to;
use super::super::catalogue::{Event, Expected};
use super::super::entry::instead;
use super::Watched;

impl<const B: usize> Watched<'_, B> {
    /// The catalogue's state, or what the firmware does instead.
    pub(super) fn leads_to(&self, state: &str) -> bool {
        if self.scenario.expected == Expected::Damped {
            return state == "Damp";
        }
        self.row.state.contains(state) || instead(self.row.id).is_some_and(|to| to.contains(state))
    }

    /// Nothing of the machine is broken.
    pub(super) fn is_only_pushed(&self) -> bool {
        matches!(self.scenario.event, Event::Kick(..) | Event::Push(..) | Event::Hold(..) | Event::Touch(_))
    }

    /// What a push alone may lead to; anything else says that a sound part is broken. A kick may hold the other joint where it is while its
    /// torque grows, and that looks like a frozen counter.
    pub(super) fn tells_of_a_push(&self, code: FaultCode) -> bool {
        use FaultCode as Code;
        match code {
            Code::PositionLimit
            | Code::Overspeed
            | Code::Overcurrent
            | Code::BusVoltage
            | Code::FollowingError => true,
            Code::EncoderFrozen => matches!(self.scenario.event, Event::Kick(..)),
            _ => false,
        }
    }

    /// What the machine does, unless it goes on.
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

    /// Whatever found the fault, the machine is in the state of what it says is wrong.
    pub(super) fn judge(&mut self, state: &'static str, code: FaultCode) {
        if !leads_to(code).contains(&state) {
            self.invariants.note(&self.rig, &format!("led to {state}"));
        }
    }
}
