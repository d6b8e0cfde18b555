//! Control's interface to the rest of the board: status values and settings.

use super::{Control, ControlOutput};
use crate::checksum::Checksum;
use crate::hal::Sample;
use crate::ident::{Cause, Change, Verdict};
use crate::leg::activity::Activity;
use crate::leg::model::IdentifiedModel;
use crate::safety::{Derating, DriveState, Fault, LimitCodes, Limits};
use crate::units::NewtonMetre;

impl<const N: usize> Control<N> {
    /// Returns the activity.
    #[must_use]
    pub fn activity(&self) -> Activity {
        self.activity
    }

    /// Returns the state of the drive.
    #[must_use]
    pub fn state(&self) -> DriveState {
        self.servo.state()
    }

    /// Returns the checksum over gains, scales and limits, which are constant.
    #[must_use]
    pub fn checksum(&self) -> Checksum {
        self.servo.checksum()
    }

    /// Reports a fault detected by the board, for the next tick.
    pub fn report(&mut self, fault: Fault) {
        self.servo.report(fault);
    }

    /// Sets which joints may be enabled outside their range, to return into it.
    pub fn permit_return(&mut self, joints: [bool; N]) {
        self.servo.permit_return(joints);
    }

    /// Sets the derating of the torque caps by temperature and bus voltage, from the next tick on.
    pub fn derate(&mut self, derating: &Derating) {
        self.servo.derate(derating);
    }

    /// Codes of the limits that acted on each joint in the tick that returned `output`.
    #[must_use]
    pub fn limit_codes(&self, output: &ControlOutput<N>) -> [LimitCodes; N] {
        self.servo.limit_codes(&output.servo.decision)
    }

    /// Torque by a joint's measured current, with the model's sign.
    #[must_use]
    pub fn torque(&self, joint: usize, sample: &Sample<N>) -> Option<NewtonMetre> {
        Some(self.servo.scales().get(joint)?.torque(sample.joints.get(joint)?.current))
    }

    /// Returns the limits of the joints.
    #[must_use]
    pub fn limits(&self) -> &Limits<N> {
        self.servo.limits()
    }

    /// Returns the verdict of the last identification.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        self.verdict
    }

    /// Returns the alarm that the model no longer fits. Cleared by a new activity or by taking an update.
    #[must_use]
    pub fn change(&self) -> Option<&Change<f32, N>> {
        self.change.as_ref()
    }

    /// Returns the cause found for the alarm; [`Cause::Unexplained`] requires a full identification.
    #[must_use]
    pub fn cause(&self) -> Option<Cause> {
        self.cause
    }

    /// Whether an update is offered.
    #[must_use]
    pub fn is_update_offered(&self) -> bool {
        self.models.is_offered()
    }

    /// Returns the accepted model.
    #[must_use]
    pub fn model(&self) -> Option<&IdentifiedModel<N>> {
        self.models.model()
    }
}
