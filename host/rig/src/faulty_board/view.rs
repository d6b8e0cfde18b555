//! Access of a run to the machine's state and requests.

use scarab::hal::AxisCommand;
use scarab::leg::{ControlRequest, DriveState};
use scarab::safety::{FaultCode, InhibitReason};

use crate::faulty_board::{Edges, Rig};

impl<const N: usize, const B: usize> Rig<N, B> {
    /// Requests something that the contacts do not offer, at the next servo tick.
    pub(crate) fn ask(&mut self, request: ControlRequest) {
        self.board.ask(request);
    }

    /// Returns whether a request waits for the servo's next tick.
    #[must_use]
    pub(crate) fn is_requested(&mut self) -> bool {
        !self.board.queues().requests().is_empty()
    }

    /// Inhibit word.
    pub(crate) fn causes(&self) -> u32 {
        self.board.signals.inhibit.causes()
    }

    /// Commands of the last period.
    pub fn commands(&self) -> &[AxisCommand; N] {
        &self.board.registers.commands
    }

    /// Actions of the operator that may lead to an enabled drive.
    pub(crate) fn edges(&self) -> Edges {
        self.edges
    }

    /// Encoder counts of the joints at the servo's last tick.
    pub(crate) fn counts(&self) -> [i32; N] {
        self.board.signals.statistics.counts.each_ref().map(|count| count.get().cast_signed())
    }

    /// State of the drive.
    pub fn state(&self) -> DriveState {
        if self.board.signals.has_begun() {
            self.leg.control().state()
        } else {
            DriveState::NotReadyToSwitchOn
        }
    }

    /// Fault reported by the firmware: an axis' fault, another inhibit reason, or the leg's fault.
    pub(crate) fn alarm(&self) -> Option<FaultCode> {
        let cause = || InhibitReason::ALL.into_iter().find(|cause| self.causes() & cause.bit() != 0);
        self.axis_fault
            .or_else(|| cause().and_then(InhibitReason::code))
            .or_else(|| self.state().fault().map(|fault| fault.code))
    }

    /// Requested current of a joint, A; zero while the drive is off.
    pub(crate) fn requested(&self, joint: usize) -> f64 {
        let target = self.board.signals.target(joint);
        if target.enabled { f64::from(target.current.0) } else { 0.0 }
    }

    /// Returns whether both motors brake.
    pub(crate) fn is_braking(&self) -> bool {
        self.board.registers.commands.iter().all(|command| *command == AxisCommand::BRAKE)
    }

    /// Returns whether any bridge switches.
    pub(crate) fn is_switching(&self) -> bool {
        self.board.registers.commands.iter().any(|command| command.enabled)
    }
}
