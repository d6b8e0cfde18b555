//! Control half of a leg: activity, motions, servo, log. Ticked at 4 kHz.

mod assist;
mod host;

pub(crate) use assist::AssistNote;
pub use assist::{AssistRefusal, Wearing};
pub(crate) use host::Host;

use assist::Assistance;

use super::activity::{Activity, IdentifyPhase, Segment, Step, VALIDATION_MOTIONS};
use super::configuration::{LegConfiguration, LegError, ProvedMotion};
use super::identification::Finding;
use super::model::IdentifiedModel;
use super::model_blend::ModelBlend;
use crate::assist::{AssistEnd, AssistShares};
use crate::checksum::Checksum;
use crate::hal::Sample;
use crate::ident::{Cause, Change, Verdict};
use crate::motion::{Motion, MotionState, Periodic, Ramp};
use crate::real::min;
use crate::safety::{Derating, DriveState, Fault, LimitCodes, Limits, PowerRequest, RETURN_SPEED};
use crate::servo::{LogAverager, LogSample, SERVO_RATE_HZ, Servo, ServoCommand, ServoOutput};
use crate::units::{Hertz, NewtonMetre, RadianPerSecond, RadianPerSecondSquared};

/// Rest after a motion before the next step: half a second.
const SETTLE_TICKS: u32 = SERVO_RATE_HZ / 2;

/// Request of an operator, valid for one tick. `Identify`, `Track` and `Assist` are refused unless the drive
/// is enabled and the commanded motion is at rest. To stop a moving leg, request a quick stop or wait for the
/// end of the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ControlRequest {
    /// A step of the drive's power states.
    Power(PowerRequest),
    /// Start an identification: excite, solve, validate.
    Identify,
    /// Track the motion of [`Control::set_tracked`], with the identified model as feedforward or with
    /// feedback only. Refused if no motion is set.
    Track {
        /// Whether the model is used as feedforward, if there is one.
        with_model: bool,
    },
    /// Use the offered update, in motion or at rest. Its torque replaces that of the old model within half a
    /// second. Refused if no update is offered.
    TakeUpdate,
    /// Begin a session of assistance. Refused without the models that the shares need, and while the model
    /// monitor reports a change.
    Assist(AssistShares),
    /// Fade the session of assistance out.
    EndAssist,
}

impl ControlRequest {
    /// Returns whether the request commands a motion.
    pub(crate) const fn moves(&self) -> bool {
        matches!(self, Self::Identify | Self::Track { .. } | Self::Assist(_))
    }
}

/// A 500 Hz sample and its use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoggedSample<const N: usize> {
    /// Angles and torques.
    pub sample: LogSample<N>,
    /// Use of the sample.
    pub segment: Option<Segment>,
}

/// Result of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlOutput<const N: usize> {
    /// Output of the servo, with the command for the drives.
    pub servo: ServoOutput<N>,
    /// Commanded motion.
    pub motion: MotionState<N>,
    /// Logged sample, every eighth tick.
    pub logged: Option<LoggedSample<N>>,
    /// Whether the request of this tick was refused.
    pub refused: bool,
    /// Whether the offered update was taken into use in this tick.
    pub took_update: bool,
}

/// Activity, servo and log of one leg.
#[derive(Clone, Debug, PartialEq)]
pub struct Control<const N: usize> {
    pub(super) servo: Servo<N>,
    averager: LogAverager<N>,
    tick: u32,
    activity: Activity,
    /// Use of the last logged sample. A sample during whose ticks it changed belongs to neither.
    segment: Option<Segment>,
    motion: Motion<N>,
    motion_tick: u32,
    tracked: Option<Periodic<N>>,
    excitation: Periodic<N>,
    validation: [Periodic<N>; VALIDATION_MOTIONS],
    approach_speed: [RadianPerSecond; N],
    approach_acceleration: [RadianPerSecondSquared; N],
    models: ModelBlend<N>,
    change: Option<Change<f32, N>>,
    verdict: Option<Verdict>,
    assistance: Assistance<N>,
}

impl<const N: usize> Control<N> {
    /// Creates the control half at rest with the drive off.
    ///
    /// # Errors
    /// [`LegError`] if limits are invalid or a motion cannot be proved to stay within them.
    pub fn new<const B: usize>(configuration: &LegConfiguration<N, B>) -> Result<Self, LegError> {
        configuration.prove(configuration.excitation)?;
        for motion in configuration.validation {
            configuration.prove(motion)?;
        }
        let (approach_speed, approach_acceleration) = configuration.approach();
        Ok(Self {
            servo: Servo::new(configuration.joints).map_err(LegError::Servo)?,
            averager: LogAverager::EMPTY,
            tick: 0,
            activity: Activity::Idle,
            segment: None,
            motion: Motion::Hold([0.0; N]),
            motion_tick: 0,
            tracked: None,
            excitation: configuration.excitation,
            validation: configuration.validation,
            approach_speed,
            approach_acceleration,
            models: ModelBlend::new(),
            change: None,
            verdict: None,
            assistance: Assistance::new(),
        })
    }

    /// Runs instead of a tick while the joints have no valid readings ([`Servo::stand_by`]).
    pub(crate) fn stand_by(&mut self, resets: bool) -> Option<Fault> {
        self.servo.stand_by(resets)
    }

    /// Resets to the state after the start: drive off, nothing measured, no activity. For joints that have
    /// missed ticks, or whose zeros have changed. The model in use stays, and a fault until its reset.
    pub fn restart(&mut self) {
        self.servo.restart();
        self.averager = LogAverager::EMPTY;
        self.activity = Activity::Idle;
        self.segment = None;
        (self.motion, self.motion_tick) = (Motion::Hold([0.0; N]), 0);
        self.tracked = None;
        self.models.interrupt();
        self.assistance.interrupt();
    }

    /// Activity.
    pub fn activity(&self) -> Activity {
        self.activity
    }

    /// State of the drive.
    pub fn state(&self) -> DriveState {
        self.servo.state()
    }

    /// Checksum over gains, scales and limits; only [`Self::set_bandwidths`] changes it.
    pub(crate) fn checksum(&self) -> Checksum {
        self.servo.checksum()
    }

    /// Flips a bit of the servo's constants ([`Servo::flip_bit`]). Host only.
    #[cfg(not(target_os = "none"))]
    pub(crate) fn flip_bit(&mut self, joint: usize, number: u8, bit: u8) {
        self.servo.flip_bit(joint, number, bit);
    }

    /// Reports a fault detected by the board, for the next tick.
    pub(crate) fn report(&mut self, fault: Fault) {
        self.servo.monitor.report(fault);
    }

    /// Sets which joints may be enabled outside their range, to return into it.
    pub(crate) fn permit_return(&mut self, joints: [bool; N]) {
        self.servo.monitor.permit_return(joints);
    }

    /// Sets the bandwidth of each position loop ([`Servo::set_bandwidths`]).
    #[cold]
    #[inline(never)]
    pub(crate) fn set_bandwidths(&mut self, bandwidths: &[Option<Hertz>; N]) {
        self.servo.set_bandwidths(bandwidths);
    }

    /// Sets the derating of each joint's torque cap by temperatures and bus voltage, from the next tick on.
    pub(crate) fn derate(&mut self, derating: &Derating<N>) {
        self.servo.monitor.derate(derating);
    }

    /// Codes of the limits that acted on each joint in the tick that returned `output`.
    pub fn limit_codes(&self, output: &ControlOutput<N>) -> [LimitCodes; N] {
        self.servo.monitor.limit_codes(&output.servo.decision)
    }

    /// Torque by a joint's measured current, with the model's sign.
    pub(crate) fn torque(&self, joint: usize, sample: &Sample<N>) -> Option<NewtonMetre> {
        Some(self.servo.scales().get(joint)?.torque(sample.joints.get(joint)?.current))
    }

    /// Limits of the joints.
    pub fn limits(&self) -> &Limits<N> {
        self.servo.limits()
    }

    /// Verdict of the last identification.
    pub fn verdict(&self) -> Option<Verdict> {
        self.verdict
    }

    /// Alarm that the model no longer fits. Cleared by a new activity or by taking an update.
    pub fn change(&self) -> Option<&Change<f32, N>> {
        self.change.as_ref()
    }

    /// Whether an update is offered.
    pub fn is_update_offered(&self) -> bool {
        self.models.is_offered()
    }

    /// Accepted model.
    pub fn model(&self) -> Option<&IdentifiedModel<N>> {
        self.models.model()
    }

    /// Runs one tick, with the commands of a host if there is one.
    #[inline]
    pub fn tick(
        &mut self,
        sample: &Sample<N>,
        request: Option<&ControlRequest>,
        gravity: [f32; 3],
        mut host: Option<Host<'_, N>>,
    ) -> ControlOutput<N> {
        self.tick = self.tick.wrapping_add(1);
        let refused = request.is_some_and(|request| !self.may_begin(request, host.as_ref()));
        if let Some(ControlRequest::Assist(shares)) = request.filter(|_| refused) {
            self.note_refusal(shares);
        }
        let took_update = !refused && matches!(request, Some(ControlRequest::TakeUpdate));
        let power = self.accept(request.filter(|_| !refused), gravity);
        let commanded = self.apply_commands(host.as_mut());
        let assisted = self.assist();
        let motion = match &commanded {
            Some(commanded) => commanded.motion,
            None => self.motion.state_at(self.motion_tick),
        };
        let mixed = self.models.advance();
        let feedforward = self.models.faded(mixed.as_ref());
        let feedforward = feedforward.as_ref();
        let efforts = commanded.as_ref().map(|commanded| &commanded.efforts).or(assisted.as_ref());
        let command = ServoCommand { motion, feedforward, power };
        let servo = self.servo.tick(sample, &command, efforts, gravity);
        // In every tick: a host that takes the leg over begins from this state.
        if let Some(host) = &mut host {
            host.following.measure(&servo);
        }
        self.conclude(sample, servo, motion, [refused, took_update])
    }

    /// Updates activity and log after the servo's tick.
    #[inline(always)]
    fn conclude(
        &mut self,
        sample: &Sample<N>,
        servo: ServoOutput<N>,
        motion: MotionState<N>,
        [refused, took_update]: [bool; 2],
    ) -> ControlOutput<N> {
        self.motion_tick = self.motion_tick.saturating_add(1);
        if !servo.decision.state.is_enabled() {
            // Without power the commanded pose follows the joints: enabling must not cause a motion.
            self.activity = Activity::Idle;
            self.models.interrupt();
            self.assistance.interrupt();
            self.hold(servo.position.map(|angle| angle.0));
        } else if self.activity.assists() {
            self.hold(servo.position.map(|angle| angle.0));
            self.end_assist();
        } else {
            self.proceed();
        }
        self.assistance.measure(&servo);
        // A sample that the servo rejected as a glitch does not enter the log.
        let mut believed = *sample;
        for (joint, counts) in believed.joints.iter_mut().zip(servo.accepted_counts) {
            joint.encoder_counts = counts;
        }
        let logged = self.averager.collect(&believed).then(|| {
            let sample = self.averager.means(self.tick, &self.servo.scales());
            let segment = self.segment.filter(|segment| Some(*segment) == self.activity.segment());
            self.segment = self.activity.segment();
            LoggedSample { sample, segment }
        });
        ControlOutput { servo, motion, logged, refused, took_update }
    }

    /// Whether the request is permitted. A new activity starts only from rest, because its approach does.
    fn may_begin(&self, request: &ControlRequest, host: Option<&Host<'_, N>>) -> bool {
        let still = match host {
            Some(host) if self.activity.follows_host() => host.following.is_still(),
            _ => self.motion.state_at(self.motion_tick).velocity_rad_per_s.iter().all(|&speed| speed == 0.0),
        };
        let halts = host
            .and_then(|host| host.commands)
            .is_some_and(|commands| commands.iter().any(|command| command.halt));
        let enabled = self.servo.state().is_enabled() && !halts;
        match request {
            ControlRequest::Power(_) => true,
            ControlRequest::TakeUpdate => self.is_update_offered(),
            ControlRequest::EndAssist => self.activity.assists(),
            // A session holds no position, so its commanded motion says nothing about rest.
            _ if self.activity.assists() => false,
            ControlRequest::Identify => enabled && still,
            ControlRequest::Track { .. } => enabled && still && self.tracked.is_some(),
            ControlRequest::Assist(shares) => {
                enabled && still && self.rests_for_assist() && self.assist_refusal(shares).is_none()
            }
        }
    }

    /// Discards the findings of an earlier motion. A fade in progress continues to its end.
    fn forget_change(&mut self) {
        self.change = None;
        self.models.withdraw();
    }

    fn accept(&mut self, request: Option<&ControlRequest>, gravity: [f32; 3]) -> Option<PowerRequest> {
        match *request? {
            ControlRequest::Power(power) => return Some(power),
            ControlRequest::Identify => {
                self.verdict = None;
                self.models.want(false);
                self.forget_change();
                self.approach(Activity::Identify(IdentifyPhase::Approach), self.excitation);
            }
            ControlRequest::Track { with_model } => {
                if let Some(motion) = self.tracked {
                    self.forget_change();
                    self.models.want(with_model);
                    self.approach(Activity::Track(Step::Approach), motion);
                }
            }
            ControlRequest::TakeUpdate => {
                self.models.take();
                self.change = None;
            }
            ControlRequest::Assist(shares) => self.begin_assist(shares, gravity),
            ControlRequest::EndAssist => self.assistance.leave(AssistEnd::Requested),
        }
        None
    }

    /// Starts the next step of the activity if the motion has ended.
    fn proceed(&mut self) {
        let ended = match self.motion.duration_ticks() {
            Some(duration) => self.motion_tick >= duration,
            None => self.motion_tick >= SETTLE_TICKS,
        };
        match self.activity {
            _ if !ended => {}
            Activity::Identify(IdentifyPhase::Approach) => {
                self.run(Activity::Identify(IdentifyPhase::Excite), self.excitation);
            }
            Activity::Identify(IdentifyPhase::Excite) => self.rest(Activity::Identify(IdentifyPhase::Settle)),
            Activity::Identify(IdentifyPhase::Settle) => {
                self.activity = Activity::Identify(IdentifyPhase::Solve);
            }
            Activity::Identify(IdentifyPhase::Validate { motion, step }) => self.validate_after(motion, step),
            // The fade of the model ends before the motion begins.
            Activity::Track(Step::Approach) if self.models.is_fading() => {}
            Activity::Track(Step::Approach) => match self.tracked {
                Some(motion) => self.run(Activity::Track(Step::Run), motion),
                None => self.rest(Activity::Idle),
            },
            Activity::Track(Step::Run) => self.rest(Activity::Idle),
            Activity::Idle
            | Activity::Follow
            | Activity::Assist(_)
            | Activity::Identify(IdentifyPhase::Solve | IdentifyPhase::Judge) => {}
        }
    }

    fn validate_after(&mut self, motion: u8, step: Step) {
        let following = if step == Step::Run { motion.saturating_add(1) } else { motion };
        match (step, self.validation.get(usize::from(following)).copied()) {
            (Step::Approach, Some(periodic)) => {
                self.run(Activity::Identify(IdentifyPhase::Validate { motion, step: Step::Run }), periodic)
            }
            (Step::Run, Some(periodic)) => self.approach(
                Activity::Identify(IdentifyPhase::Validate { motion: following, step: Step::Approach }),
                periodic,
            ),
            (_, None) => self.rest(Activity::Identify(IdentifyPhase::Judge)),
        }
    }

    /// Processes a finding of the identification half. Returns whether a result was taken; the result of a
    /// cancelled identification is dropped.
    #[must_use]
    pub(crate) fn receive(&mut self, finding: Finding<N>) -> bool {
        match finding {
            Finding::Solved => {
                if let (Activity::Identify(IdentifyPhase::Settle | IdentifyPhase::Solve), Some(first)) =
                    (self.activity, self.validation.first().copied())
                {
                    let phase = IdentifyPhase::Validate { motion: 0, step: Step::Approach };
                    self.approach(Activity::Identify(phase), first);
                }
            }
            Finding::Judged { verdict, model } => {
                use IdentifyPhase::{Judge, Settle, Solve};
                // In any other phase the result belongs to an identification that was restarted since.
                if let Activity::Identify(Settle | Solve | Judge) = self.activity {
                    self.verdict = Some(verdict);
                    // A refused result leaves the previous model in use.
                    if let Some(model) = model {
                        self.assistance.accept(&model);
                        self.models.accept(model);
                    }
                    self.rest(Activity::Idle);
                    return true;
                }
            }
            // Obsolete: these concern an earlier motion and a model that this identification may replace.
            Finding::Changed(_) | Finding::Updated { .. }
                if matches!(self.activity, Activity::Identify(_)) => {}
            Finding::Changed(change) => {
                self.change = Some(change);
                self.assistance.change();
            }
            Finding::Updated { cause, model, .. } => {
                match model {
                    Some(model) => self.models.offer(model),
                    None => self.models.withdraw(),
                }
                if cause == Cause::Nothing {
                    self.change = None;
                }
            }
        }
        false
    }

    /// Sets the motion of [`ControlRequest::Track`]. It is proved against this leg's limits
    /// ([`LegConfiguration::prove`]) and stays until it is replaced, or until a restart. Refused (`false`)
    /// while one is tracked.
    #[must_use]
    pub fn set_tracked(&mut self, motion: ProvedMotion<N>) -> bool {
        let tracks = matches!(self.activity, Activity::Track(_));
        if !tracks {
            self.tracked = Some(*motion.motion());
        }
        !tracks
    }

    /// Replaces the model by a restored one, from the next tick on. Refused (`false`) during an activity or
    /// while a model is in the feedforward, because the torque would step.
    #[must_use]
    pub(crate) fn adopt(&mut self, model: IdentifiedModel<N>) -> bool {
        self.activity == Activity::Idle && self.models.adopt(model)
    }

    fn approach(&mut self, activity: Activity, motion: Periodic<N>) {
        let start = Motion::Periodic(motion).start_rad();
        let here = self.motion.state_at(self.motion_tick).position_rad;
        let mut speed = self.approach_speed;
        for (speed, returns) in speed.iter_mut().zip(self.servo.monitor.returns()) {
            // While a joint returns into its range, the whole approach is limited to the return speed.
            speed.0 = if returns { min(speed.0, RETURN_SPEED) } else { speed.0 };
        }
        let ramp = Ramp::between(here, start, speed, self.approach_acceleration, SERVO_RATE_HZ);
        match ramp {
            Ok(ramp) => {
                self.activity = activity;
                self.motion = Motion::Ramp(ramp);
                self.motion_tick = 0;
            }
            Err(_) => {
                self.activity = Activity::Idle;
                self.hold(here);
            }
        }
    }

    fn run(&mut self, activity: Activity, motion: Periodic<N>) {
        self.activity = activity;
        self.motion = Motion::Periodic(motion);
        self.motion_tick = 0;
    }

    fn rest(&mut self, activity: Activity) {
        self.activity = activity;
        self.hold(self.motion.end_rad());
    }

    fn hold(&mut self, pose_rad: [f32; N]) {
        self.motion = Motion::Hold(pose_rad);
        self.motion_tick = 0;
    }
}
