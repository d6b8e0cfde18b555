//! What a run sees of the machine, and asks of it.

use scarab::hal::AxisCommand;
use scarab::leg::{ControlRequest, DriveState};
use scarab::safety::{Cause, FaultCode};

use super::{Edges, Rig};

impl<const N: usize, const B: usize> Rig<N, B> {
    /// Asks for something that the operator's contacts do not, at the next servo tick.
    pub fn ask(&mut self, request: ControlRequest<N>) {
        self.ports.requests.push_back(request);
    }

    /// A request waits for the servo's next tick.
    #[must_use]
    pub fn is_asked(&self) -> bool {
        !self.ports.requests.is_empty()
    }

    /// What forbids to enable, as the interlock's bits.
    #[must_use]
    pub fn causes(&self) -> u32 {
        self.ports.causes
    }

    /// Something that forbids to enable.
    pub fn raise(&mut self, cause: Cause) {
        self.ports.causes |= cause.bit();
    }

    /// The flash is written no more.
    pub fn stored(&mut self) {
        self.ports.causes &= !Cause::Storing.bit();
    }

    /// Commands of the period that is over.
    #[must_use]
    pub fn commands(&self) -> &[AxisCommand; N] {
        &self.ports.commands
    }

    /// What the operator did that may lead to an enabled drive.
    #[must_use]
    pub fn edges(&self) -> Edges {
        self.ports.edges
    }

    /// Of the joints, as the servo saw them last.
    #[must_use]
    pub fn counts(&self) -> &[i32; N] {
        &self.ports.counts
    }

    /// The brake resistor's duty.
    #[must_use]
    pub fn brake(&self) -> f32 {
        self.ports.brake
    }

    /// Where the drive stands.
    #[must_use]
    pub fn state(&self) -> DriveState {
        if self.ports.begun { self.leg.control().state() } else { DriveState::NotReadyToSwitchOn }
    }

    /// What the firmware says is wrong: an axis' fault, another cause, or the leg's fault.
    #[must_use]
    pub fn alarm(&self) -> Option<FaultCode> {
        let cause = || Cause::ALL.into_iter().find(|cause| self.ports.causes & cause.bit() != 0);
        self.ports
            .axis_fault
            .or_else(|| cause().and_then(Cause::code))
            .or_else(|| self.state().fault().map(|fault| fault.code))
    }

    /// Current that is asked of a joint, A; nothing while the drive is off.
    #[must_use]
    pub fn asked(&self, joint: usize) -> f64 {
        if self.ports.targets.enabled { f64::from(self.ports.targets.currents[joint].0) } else { 0.0 }
    }

    /// Both motors brake themselves.
    #[must_use]
    pub fn is_braking(&self) -> bool {
        self.ports.commands.iter().all(|command| *command == AxisCommand::BRAKE)
    }

    /// Any bridge switches.
    #[must_use]
    pub fn is_switching(&self) -> bool {
        self.ports.commands.iter().any(|command| command.enabled)
    }
}
