//! What is told of control, and what it is told by the rest of the board.

use super::{Control, ControlOutput};
use crate::checksum::Checksum;
use crate::hal::Sample;
use crate::ident::{Cause, Change, Verdict};
use crate::leg::activity::Activity;
use crate::leg::model::IdentifiedModel;
use crate::safety::{Derating, DriveState, Fault, LimitCodes, Limits};
use crate::units::NewtonMetre;

impl<const N: usize> Control<N> {
    /// What the leg is doing.
    #[must_use]
    pub fn activity(&self) -> Activity {
        self.activity
    }

    /// Where the drive stands.
    #[must_use]
    pub fn state(&self) -> DriveState {
        self.servo.state()
    }

    /// Over gains, scales and limits, which do not change.
    #[must_use]
    pub fn checksum(&self) -> Checksum {
        self.servo.checksum()
    }

    /// A fault that the board saw, for the next tick.
    pub fn report(&mut self, fault: Fault) {
        self.servo.report(fault);
    }

    /// Joints that may be enabled outside their range, to return into it.
    pub fn permit_return(&mut self, joints: [bool; N]) {
        self.servo.permit_return(joints);
    }

    /// What temperature and bus voltage leave of the torque caps from the next tick on.
    pub fn derate(&mut self, derating: &Derating) {
        self.servo.derate(derating);
    }

    /// Codes of what was taken from each joint at a tick.
    #[must_use]
    pub fn limit_codes(&self, output: &ControlOutput<N>) -> [LimitCodes; N] {
        self.servo.limit_codes(&output.servo.decision)
    }

    /// Of a joint's measured current, model's sign.
    #[must_use]
    pub fn torque(&self, joint: usize, sample: &Sample<N>) -> Option<NewtonMetre> {
        Some(self.servo.scales().get(joint)?.torque(sample.joints.get(joint)?.current))
    }

    /// What each joint may do.
    #[must_use]
    pub fn limits(&self) -> &Limits<N> {
        self.servo.limits()
    }

    /// The verdict of the last identification.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        self.verdict
    }

    /// The alarm that the model no longer fits; gone with a new activity or once an update is taken.
    #[must_use]
    pub fn change(&self) -> Option<&Change<f32, N>> {
        self.change.as_ref()
    }

    /// What the quick pass made of the alarm; [`Cause::Unexplained`] asks for a full identification.
    #[must_use]
    pub fn cause(&self) -> Option<Cause> {
        self.cause
    }

    /// Whether there is an update to take.
    #[must_use]
    pub fn is_update_offered(&self) -> bool {
        self.models.is_offered()
    }

    /// The accepted model.
    #[must_use]
    pub fn model(&self) -> Option<&IdentifiedModel<N>> {
        self.models.model()
    }
}
