//! What a run sees of the machine, and asks of it.

use scarab::hal::AxisCommand;
use scarab::leg::{ControlRequest, DriveState};
use scarab::safety::{Cause, FaultCode};

use super::{Edges, Rig};

impl<const N: usize, const B: usize> Rig<N, B> {
    /// Asks for something that the operator's contacts do not, at the next servo tick.
    pub fn ask(&mut self, request: ControlRequest<N>) {
        self.board.ask(request);
    }

    /// A request waits for the servo's next tick.
    #[must_use]
    pub fn is_asked(&mut self) -> bool {
        !self.board.queues().requests().is_empty()
    }

    /// What forbids to enable, as the interlock's bits.
    #[must_use]
    pub fn causes(&self) -> u32 {
        self.board.signals.inhibit.causes()
    }

    /// Commands of the period that is over.
    #[must_use]
    pub fn commands(&self) -> &[AxisCommand; N] {
        &self.board.registers.commands
    }

    /// What the operator did that may lead to an enabled drive.
    #[must_use]
    pub fn edges(&self) -> Edges {
        self.edges
    }

    /// Encoder counts of the joints at the servo's last tick.
    #[must_use]
    pub fn counts(&self) -> [i32; N] {
        self.board.signals.statistics.counts.each_ref().map(|count| count.get().cast_signed())
    }

    /// The brake resistor's duty.
    #[must_use]
    pub fn brake(&self) -> f32 {
        self.board.registers.brake
    }

    /// Where the drive stands.
    #[must_use]
    pub fn state(&self) -> DriveState {
        if self.board.signals.has_begun() {
            self.leg.control().state()
        } else {
            DriveState::NotReadyToSwitchOn
        }
    }

    /// What the firmware says is wrong: an axis' fault, another cause, or the leg's fault.
    #[must_use]
    pub fn alarm(&self) -> Option<FaultCode> {
        let cause = || Cause::ALL.into_iter().find(|cause| self.causes() & cause.bit() != 0);
        self.axis_fault
            .or_else(|| cause().and_then(Cause::code))
            .or_else(|| self.state().fault().map(|fault| fault.code))
    }

    /// Current that is asked of a joint, A; nothing while the drive is off.
    #[must_use]
    pub fn asked(&self, joint: usize) -> f64 {
        let target = self.board.signals.target(joint);
        if target.enabled { f64::from(target.current.0) } else { 0.0 }
    }

    /// Both motors brake themselves.
    #[must_use]
    pub fn is_braking(&self) -> bool {
        self.board.registers.commands.iter().all(|command| *command == AxisCommand::BRAKE)
    }

    /// Any bridge switches.
    #[must_use]
    pub fn is_switching(&self) -> bool {
        self.board.registers.commands.iter().any(|command| command.enabled)
    }
}
