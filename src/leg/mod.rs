//! One leg: what it does, and two halves that exchange values only.
//!
//! ```text
//!   control (ticked at 4 kHz)                              identification (advanced when there is time)
//!   motion -> servo -> drive command                       recorder -> solver -> verdict
//!      |  LoggedSample, 500 Hz: angle, torque, segment  ----->
//!      <-----  Finding: solved | judged, with the model if it was accepted | changed | updated, with the model offered
//!      |  took_update: the operator takes what was offered into use  ----->
//! ```
//!
//! The board runs control in an interrupt and identification at the lowest priority and carries the values from one
//! to the other; on the host [`Leg`] holds both in one value that can be cloned, compared and run on. Host tool,
//! emulated image and board run the same code.
//!
//! ```text
//!   Idle --identify--> Approach --> Excite --> Settle --> Solve --> Validate: Approach, Run (three times) --> Judge
//!    ^ ^                                                                                                      |
//!    | +--track--> Track        with commands of a host: Follow in the place of Idle while the drive is enabled
//!    +---------------------- the drive is no longer enabled (quick stop, fault): from everywhere <-------------+
//! ```

mod activity;
mod configuration;
mod control;
mod description;
mod follow;
mod identification;
mod model;
mod permitted;
mod results;
mod stored;
mod succession;
#[cfg(test)]
pub(crate) mod testing;
mod upkeep;

pub use activity::{Activity, IdentifyPhase, Segment, Step, VALIDATION_MOTIONS};
pub use configuration::{LegConfiguration, LegError, ProvedMotion};
pub use control::{Control, ControlOutput, ControlRequest, Host, LoggedSample};
pub use description::{
    DescriptionError, JointDescription, LegDescription, LinkDescription, MotorDescription,
};
pub use follow::{Following, JointCommand, JointStatus, Mode, SetPoint, Target};
pub use identification::{Finding, Identification};
pub use model::IdentifiedModel;
pub use permitted::{axis_code, permitted};
pub use results::{FoundBase, FoundFit, FoundParameter};
pub use stored::{RestoreError, StoredModel};
pub use upkeep::{UPDATE_ROWS, Upkeep};

// What crosses the leg's border: rooms that tell or keep it look no deeper.
pub use crate::ident::{
    Cause, Change, Constant, Estimate, Evidence, Filters, MotionWindow, Plan, Reason, SearchState, Status,
    StribeckFit, Test, Verdict,
};
pub use crate::model::friction::Stribeck;
pub use crate::model::{Fingerprint, PARAMETERS_PER_JOINT, Parameter};
pub use crate::motor::{
    AxisFault, Calibration, Direction as CounterDirection, ElectricalAngle, EncoderSetting, Phase,
    Refusal as CalibrationRefusal, StoredCalibration,
};
pub use crate::safety::{
    DeratingRamps, DriveState, Event as DriveEvent, Fault, FaultCode, LimitCode, LimitCodes, NO_ERROR,
    NoticeCode, Permission, PowerRequest, RETURN_SPEED, Refusal, RefusalReason,
};
pub use crate::servo::LogSample;

use crate::hal::Sample;
use crate::safety::Derating;

/// Both halves of a leg in one value.
#[derive(Clone, Debug, PartialEq)]
pub struct Leg<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize> {
    control: Control<N>,
    identification: Identification<N, B, TAPS, PENDING>,
    following: Following<N>,
    commands: Option<[JointCommand; N]>,
    cancel: bool,
    sample: Option<Sample<N>>,
}

impl<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize> Leg<N, B, TAPS, PENDING> {
    /// A leg at rest, drive off.
    ///
    /// # Errors
    /// [`LegError`] when limits make no sense, a motion cannot be proved to stay within them, or the filter does not
    /// fit its memory.
    pub fn new(configuration: &LegConfiguration<N, B>) -> Result<Self, LegError> {
        Ok(Self {
            control: Control::new(configuration)?,
            identification: Identification::new(configuration)?,
            following: Following::new(configuration),
            commands: None,
            cancel: false,
            sample: None,
        })
    }

    /// One servo tick, then up to `evaluations` of the search; `gravity` in the base frame, m/s^2.
    pub fn tick(
        &mut self,
        sample: &Sample<N>,
        request: Option<ControlRequest<N>>,
        gravity: [f32; 3],
        evaluations: u32,
    ) -> ControlOutput<N> {
        let (following, cancel) = (&mut self.following, core::mem::take(&mut self.cancel));
        let host = self.commands.as_ref().map(|commands| Host { following, commands, cancel });
        self.sample = Some(*sample);
        let output = self.control.tick_with(sample, request, gravity, host);
        if let Some(logged) = &output.logged {
            self.identification.push(logged);
        }
        let begun = request == Some(ControlRequest::Identify) && !output.refused;
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

    /// As after the start, but for the model in use; see [`Control::restart`].
    pub fn restart(&mut self) {
        self.control.restart();
    }

    /// What a host commands from the next tick on.
    pub fn command(&mut self, commands: &[JointCommand; N]) {
        self.commands = Some(*commands);
    }

    /// No host commands any more, from the next tick on.
    pub fn let_go(&mut self) {
        self.commands = None;
    }

    /// What a host is told of a joint, given what came of the last tick.
    #[must_use]
    pub fn joint_status(&self, joint: usize, output: &ControlOutput<N>) -> Option<JointStatus> {
        let torque = self.control.torque(joint, self.sample.as_ref()?)?;
        let follows = self.control.activity() == Activity::Follow;
        self.following.status(joint, torque, follows, output)
    }

    /// A host gives an identification up: from the next tick on the joints come to rest.
    pub fn cancel(&mut self) {
        self.cancel = true;
    }

    /// With which plan and random numbers the next identification is made.
    pub fn prepare(&mut self, plan: Plan, swarm_seed: u64) {
        self.identification.prepare(plan, swarm_seed);
    }

    /// Has these base values validated in the place of those found; see [`Identification::examine`].
    pub fn examine(&mut self, values: &[f32; B]) {
        self.identification.examine(values);
    }

    /// Takes a model that was kept into use, see [`Control::adopt`]. It comes without its uncertainty and is not watched.
    #[must_use]
    pub fn adopt(&mut self, model: IdentifiedModel<N>) -> bool {
        let adopted = self.control.adopt(model);
        if adopted {
            self.identification.forget_model();
        }
        adopted
    }

    /// A fault that the board saw, see [`Control::report`].
    pub fn report(&mut self, fault: Fault) {
        self.control.report(fault);
    }

    /// What temperature and bus voltage leave of the torque caps, see [`Control::derate`].
    pub fn derate(&mut self, derating: &Derating) {
        self.control.derate(derating);
    }

    /// Flips a bit of the servo's numbers, see [`crate::servo::Servo::upset`]; on the host alone.
    #[cfg(not(target_os = "none"))]
    pub fn upset(&mut self, joint: usize, number: u8, bit: u8) {
        self.control.servo.upset(joint, number, bit);
    }

    /// Both halves, for whoever runs them at levels of their own (`operation`).
    pub fn halves(&mut self) -> (&mut Control<N>, &mut Identification<N, B, TAPS, PENDING>) {
        (&mut self.control, &mut self.identification)
    }

    /// The half that moves.
    #[must_use]
    pub fn control(&self) -> &Control<N> {
        &self.control
    }

    /// The half that finds out.
    #[must_use]
    pub fn identification(&self) -> &Identification<N, B, TAPS, PENDING> {
        &self.identification
    }
}
