//! One leg: its activities, in two halves that exchange values only.
//!
//! ```text
//! control (ticked at 4 kHz)                  identification (advanced in idle time)
//! motion -> servo -> drive command           recorder -> solver -> verdict
//!     --- LoggedSample, 500 Hz: angle, torque, segment --->
//!     <-- Finding: solved | judged (accepted model) | changed | updated (offered model) ---
//!     --- took_update: the operator uses the offered model --->
//! ```
//!
//! The board runs control in an interrupt and identification at the lowest priority, and passes the values
//! between them. On the host [`Leg`] holds both halves in one value that can be cloned, compared and resumed.
//! Host tool and board run the same code.
//!
//! ```text
//! Idle --identify--> Approach -> Excite -> Settle -> Solve -> Validate (Approach, Run; 3 times) -> Judge
//!  ^ ^                                                                                              |
//!  | +--track--> Track      while a host commands the enabled drive: Follow instead of Idle         |
//!  +------------------------ drive no longer enabled (quick stop, fault): from every activity <-----+
//! ```

mod activity;
mod assured;
mod configuration;
mod control;
mod description;
mod follow;
mod identification;
mod model;
mod model_blend;
mod model_monitor;
mod permitted;
mod results;
mod stored;
#[cfg(test)]
pub(crate) mod testing;

pub use activity::{Activity, AssistPhase, IdentifyPhase, Segment, Step, VALIDATION_MOTIONS};
pub use configuration::{LegConfiguration, LegError, ProvedMotion};
pub(crate) use control::{AssistNote, Host};
pub use control::{AssistRefusal, Control, ControlOutput, ControlRequest, LoggedSample, Wearing};
pub use description::{
    DescriptionError, JointDescription, LegDescription, LinkDescription, MotorDescription,
};
pub(crate) use follow::LONGEST_PERIOD;
pub use follow::{Following, ImpedanceTarget, JointCommand, JointStatus, Mode, Reference, SetPoint, Target};
pub use identification::{Finding, Identification};
pub use model::IdentifiedModel;
pub use model_monitor::{ModelMonitor, UPDATE_ROWS};
pub use permitted::axis_code;
pub(crate) use permitted::{may_reset, permitted};
pub use results::{FoundBase, FoundFit, FoundParameter};
pub use stored::{RestoreError, StoredModel};

// Interface of the leg: other modules that report or store these values import them from here only.
pub use crate::assist::{AssistEnd, AssistLaw, AssistShares, Assured};
pub(crate) use crate::assist::{AssistSession, AssistTorque};
pub use crate::ident::Cause;
#[cfg(test)]
pub(crate) use crate::ident::Change;
pub use crate::ident::{
    Constant, Estimate, Evidence, Filters, MotionWindow, Plan, Reason, SearchState, Status, StribeckFit,
    Test, Verdict,
};
pub use crate::model::friction::Stribeck;
pub use crate::model::planar::{BASE, JOINTS};
pub use crate::model::{Fingerprint, PARAMETERS_PER_JOINT, Parameter};
pub use crate::motor::{
    AbsoluteAngle, AbsoluteEncoders, AxisFault, Calibration, Direction as CounterDirection, ElectricalAngle,
    EncoderSetting, JointZero, Mismatch, MotorConstant, MotorFindings, Phase, Refusal as CalibrationRefusal,
    StoredCalibration,
};
pub use crate::safety::{
    DeratingRamps, DriveState, Fault, FaultCode, LimitCode, LimitCodes, NO_ERROR, NoticeCode, Permission,
    PowerRequest, Refusal, RefusalReason,
};
pub(crate) use crate::safety::{Event as DriveEvent, RETURN_SPEED};
pub use crate::servo::{JointConfiguration, LogSample};

use crate::hal::Sample;

/// Both halves of a leg in one value.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize> {
    control: Control<N>,
    identification: Identification<N, B, TAPS, PENDING>,
    law: AssistLaw<N>,
    following: Following<N>,
    commands: Option<[JointCommand; N]>,
    cancel: bool,
    sample: Option<Sample<N>>,
}

impl<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize> Leg<N, B, TAPS, PENDING> {
    /// Creates a leg at rest with the drive off.
    ///
    /// # Errors
    /// [`LegError`] if limits are invalid, a motion cannot be proved to stay within them, or the filter does
    /// not fit its memory.
    pub fn new(configuration: &LegConfiguration<N, B>) -> Result<Self, LegError> {
        Ok(Self {
            control: Control::new(configuration)?,
            identification: Identification::new(configuration)?,
            law: AssistLaw::new(),
            following: Following::new(configuration),
            commands: None,
            cancel: false,
            sample: None,
        })
    }

    /// Runs one servo tick, then up to `evaluations` of the search. `gravity` is in the base frame, m/s^2.
    pub fn tick(
        &mut self,
        sample: &Sample<N>,
        request: Option<ControlRequest>,
        gravity: [f32; 3],
        evaluations: u32,
    ) -> ControlOutput<N> {
        let (following, cancel) = (&mut self.following, core::mem::take(&mut self.cancel));
        let host = Some(Host { following, commands: self.commands.as_ref(), cancel, waits: false });
        self.sample = Some(*sample);
        let output = self.control.tick(sample, request.as_ref(), gravity, host);
        if let Some(logged) = &output.logged {
            self.identification.push(logged);
        }
        self.assist(&output);
        let begun = matches!(request, Some(ControlRequest::Identify)) && !output.refused;
        if begun || !matches!(self.control.activity(), Activity::Identify(_)) {
            self.identification.cancel();
        }
        if output.took_update {
            self.identification.take_update();
        }
        if let Some(finding) = self.identification.advance(evaluations)
            && self.control.receive(finding)
        {
            let _ = self.identification.took_result();
        }
        output
    }

    /// Runs the law of the assistance on a logged sample.
    fn assist(&mut self, output: &ControlOutput<N>) {
        if let Some(session) = self.control.take_session() {
            self.law.begin(session);
        }
        if !self.control.activity().assists() {
            self.law.end();
        } else if let Some(logged) = &output.logged
            && let Some(torque) = self.law.step(&logged.sample)
        {
            self.control.receive_torque(&torque);
        }
    }

    /// Law of the assistance.
    pub fn law(&self) -> &AssistLaw<N> {
        &self.law
    }

    /// Sets whether the leg of the next identifications is empty or worn, see `Control::set_wearing`.
    pub fn set_wearing(&mut self, wearing: Option<Wearing>) {
        self.control.set_wearing(wearing);
    }

    /// Sets a model of the empty or the worn leg, see [`Control::set_model`].
    #[must_use]
    pub fn set_model(&mut self, wearing: Wearing, model: IdentifiedModel<N>) -> bool {
        self.control.set_model(wearing, model)
    }

    /// Resets to the state after the start, except for the model in use; see [`Control::restart`].
    pub fn restart(&mut self) {
        self.control.restart();
    }

    /// Sets the commands of a host, from the next tick on.
    pub fn command(&mut self, commands: &[JointCommand; N]) {
        self.commands = Some(*commands);
    }

    /// Status of a joint for a host, after the tick that returned `output`.
    pub fn joint_status(&self, joint: usize, output: &ControlOutput<N>) -> Option<JointStatus> {
        let torque = self.control.torque(joint, self.sample.as_ref()?)?;
        let follows = self.control.activity().follows_host();
        self.following.status(joint, torque, follows, output)
    }

    /// Cancels an identification for a host; from the next tick on the joints slow down to rest.
    pub fn cancel(&mut self) {
        self.cancel = true;
    }

    /// Sets the plan and the random seed of the next identification.
    pub fn prepare(&mut self, plan: Plan, swarm_seed: u64) {
        self.identification.prepare(plan, swarm_seed);
    }

    /// Validates these base values instead of the identified ones; see [`Identification::examine`].
    pub fn examine(&mut self, values: &[f32; B]) {
        self.identification.examine(values);
    }

    /// Uses a stored model, see `Control::adopt`. Its uncertainty is unknown, so the monitor does not watch
    /// it.
    #[must_use]
    pub fn adopt(&mut self, model: IdentifiedModel<N>) -> bool {
        let adopted = self.control.adopt(model);
        if adopted {
            self.identification.forget_model();
        }
        adopted
    }

    /// Sets the motion that is tracked next, see [`Control::set_tracked`].
    #[must_use]
    pub fn set_tracked(&mut self, motion: ProvedMotion<N>) -> bool {
        self.control.set_tracked(motion)
    }

    /// Reports a fault detected by the board, see `Control::report`.
    pub fn report(&mut self, fault: Fault) {
        self.control.report(fault);
    }

    /// Flips a bit of the servo's state, see `Servo::flip_bit`. Host only.
    #[cfg(not(target_os = "none"))]
    pub fn flip_bit(&mut self, joint: usize, number: u8, bit: u8) {
        self.control.flip_bit(joint, number, bit);
    }

    /// Both halves, for callers that run them at separate priorities (`operation`).
    pub fn halves(&mut self) -> (&mut Control<N>, &mut Identification<N, B, TAPS, PENDING>) {
        (&mut self.control, &mut self.identification)
    }

    /// Returns the control half.
    pub fn control(&self) -> &Control<N> {
        &self.control
    }

    /// Returns the identification half.
    pub fn identification(&self) -> &Identification<N, B, TAPS, PENDING> {
        &self.identification
    }
}
