//! Level 6: the operator's contacts, gate drivers, temperatures of bridges and windings, calibration and
//! reference, resets.
//!
//! ```text
//! not calibrated --calibrate--> first axis --measured-> next axis --measured-> calibrated -reference-> ready
//!       ^                          | refused, let go                              |                      |
//!       +--------------------------+----- rotor position or parameters lost ------+----------------------+
//! ```
//!
//! An axis with a stored calibration is checked against it. Everything is measured again, and resistance,
//! inductances and offset have to agree. If one does not, the axis is refused with a record, and its next
//! calibration measures everything again. Once the joint was turned over its index by hand, the check needs
//! no motion and cannot measure the offset.
//!
//! If the rotor moves during such a check, a push looks like a wrong offset or index. So the stored
//! values stay, but the next calibration turns the motor and measures the offset against them. The same holds
//! after a lost rotor position. A push thus costs one calibration in motion, and until the
//! next start no check at standstill follows another one that failed.
//!
//! An absolute encoder at the rotor replaces the turning by hand; encoders at the joints, with a stored zero,
//! replace the reference (`zeros.rs`).
//!
//! A reset takes 24 ms. Gate drivers are turned off and on and configured again; then faults are cleared, and
//! those that still hold come back. Until then the registers are not checked and contacts are ignored;
//! afterwards both contacts have to be open once.

use super::axis_state::{Order, Outcome};
use super::contacts::{Operator, OperatorRequest, RATE_HZ, Situation};
use super::encoders::{EncoderCheck, EncoderSettings};
use super::queues::HousekeepingEnds;
use super::signals::{I2T_UNIT, Signals};
use super::status_light::{LightInputs, StatusLight};
use crate::bus::commissioning::{BoardState, CommissioningStep, StepReport, StepResult};
use crate::bus::program::ProgramStatus;
use crate::hal::{AxisSample, Contacts, Hardware};
use crate::leg::{
    AssistShares, AxisFault, Calibration, CalibrationRefusal, ControlRequest, DriveState, Mismatch,
    MotorFindings, Permission, PowerRequest, StoredCalibration,
};
use crate::motor::{Axis, AxisConfiguration, CalibrationSettings, Calibrator, EncoderSetting, JointZero};
use crate::safety::{
    BoardFault, CheckClock, InhibitReason, Thermistor, Winding, WindingRating, of_temperature,
};
use crate::trace::{Record, words};
use crate::units::Hertz;

mod thermistors;
mod zeros;

use thermistors::MotorThermistors;
use zeros::Reference;

/// Rounds of a reset with gate drivers off (2 ms), and until they can be configured (22 ms).
const GATES_ON: u8 = 1;
const GATES_READY: u8 = 12;

/// Settings of the housekeeping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HousekeepingSettings<const N: usize> {
    /// Configuration of each axis.
    pub axes: [AxisConfiguration; N],
    /// Limits of a calibration of each axis.
    pub calibration: [CalibrationSettings; N],
    /// Temperature from which a bridge is too hot, degrees Celsius.
    pub hottest_c: f32,
    /// Thermal constants of each motor's winding.
    pub windings: [WindingRating; N],
    /// Thermistors in the motors.
    pub thermistors: [Option<Thermistor>; N],
    /// Encoders of each axis.
    pub encoders: [EncoderSettings; N],
    /// Shares of the assistance that the start button begins; `None` lets it begin an identification.
    pub assist: Option<AssistShares>,
}

/// Access of a round to queues, signals and hardware.
struct Level<'a, 'q, const N: usize, H> {
    ends: &'a mut HousekeepingEnds<'q, N>,
    signals: &'a Signals<N>,
    hardware: &'a mut H,
}

impl<const N: usize, H> Level<'_, '_, N, H> {
    /// Sends an order to an axis and returns whether the queue took it.
    fn order(&mut self, axis: usize, order: Order) -> bool {
        self.ends.orders.get_mut(axis).is_some_and(|orders| orders.enqueue(order).is_ok())
    }

    /// Whether the queue of every axis has space for an order.
    fn takes_orders(&self) -> bool {
        self.ends.orders.iter().all(|orders| orders.ready())
    }

    /// Sends a request to the servo and returns whether the queue took it. While a host has the drive,
    /// closing the enabling switch only permits and requests nothing.
    fn request(&mut self, request: ControlRequest) -> bool {
        let enables = matches!(request, ControlRequest::Power(power) if power.enables());
        !(enables && self.signals.is_hosted()) && self.ends.requests.enqueue(request).is_ok()
    }

    fn record(&mut self, record: Record<N>) {
        if self.ends.notes.enqueue(record).is_err() {
            self.signals.statistics.records_lost.add();
        }
    }
}

/// State between two rounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Housekeeper<const N: usize> {
    settings: HousekeepingSettings<N>,
    /// Bandwidths of the current loops, of which each running axis was informed.
    bandwidths: [Hertz; N],
    clock: CheckClock,
    operator: Operator,
    calibrated: [bool; N],
    /// Stored calibrations, checked at the motor instead of measured again.
    stored: [Option<StoredCalibration>; N],
    /// Axes whose next calibration has to turn the motor.
    turning: [bool; N],
    /// Axes whose index is certain, while they are off.
    certain: [bool; N],
    /// The axis that is being calibrated.
    calibrating: Option<usize>,
    /// Calibration that each axis passed since the start, if it can be stored.
    passed: [Option<StoredCalibration>; N],
    /// Axes whose passed calibration the storage does not have.
    unsent: [bool; N],
    /// A reference in progress.
    reference: Option<Reference<N>>,
    /// The zeros were set in the previous round: the servo may begin.
    placed: bool,
    checks: [EncoderCheck; N],
    /// Axes whose absolute encoders contradict the counter; until a reset they are not calibrated.
    contradicted: [bool; N],
    /// Rotor position of each axis at count zero, in the joint's sense.
    origins: [i32; N],
    /// Readings at each joint's zero.
    joint_zeros: [Option<JointZero>; N],
    /// Rounds since a reset was requested.
    resetting: Option<u8>,
    /// Step of commissioning that a host asked for and that has not ended.
    step: Option<CommissioningStep>,
    /// Report of the last calibration that failed.
    failure: StepReport,
    drive: Option<DriveState>,
    windings: [Winding; N],
    /// Windings whose temperature is assumed.
    assumed: [bool; N],
    /// Integrals of the squared currents in the previous round.
    i2t: [u32; N],
    motor_thermistors: MotorThermistors<N>,
    round: u32,
    recorded: u32,
}

impl<const N: usize> Housekeeper<N> {
    /// State without any calibration; windings are assumed warm.
    pub fn new(settings: HousekeepingSettings<N>) -> Self {
        Self {
            settings,
            bandwidths: settings.axes.map(|axis| axis.bandwidth),
            clock: CheckClock::new(RATE_HZ),
            operator: Operator::default(),
            calibrated: [false; N],
            stored: [None; N],
            turning: [false; N],
            certain: [false; N],
            calibrating: None,
            passed: [None; N],
            unsent: [false; N],
            reference: None,
            placed: false,
            checks: [EncoderCheck::default(); N],
            contradicted: [false; N],
            origins: [0; N],
            joint_zeros: [None; N],
            resetting: None,
            step: None,
            failure: StepReport::new(StepResult::Interrupted),
            drive: None,
            windings: settings.windings.map(|rating| Winding::new(rating, None)),
            assumed: [true; N],
            i2t: [0; N],
            motor_thermistors: MotorThermistors::NONE,
            round: 0,
            recorded: 0,
        }
    }

    /// State with all axes calibrated and referenced elsewhere: they run, and the servo has begun.
    pub fn ready(settings: HousekeepingSettings<N>) -> Self {
        Self { calibrated: [true; N], ..Self::new(settings) }
    }

    /// Sets the temperatures of the windings, degrees Celsius.
    pub fn with_windings(self, celsius: [f32; N]) -> Self {
        let mut celsius = celsius.into_iter();
        let windings = self.settings.windings.map(|rating| Winding::new(rating, celsius.next()));
        Self { windings, assumed: [false; N], ..self }
    }

    /// Sets the readings at the joints' zeros, of axes that are ready.
    pub fn with_joint_zeros(self, joint_zeros: [Option<JointZero>; N]) -> Self {
        Self { joint_zeros, ..self }
    }

    /// Adds stored calibrations.
    pub fn with_stored(self, stored: [Option<StoredCalibration>; N]) -> Self {
        let HousekeepingSettings { axes, encoders, .. } = &self.settings;
        let joint_zeros = core::array::from_fn(|axis| {
            // With another setting the readings mean something else.
            let (stored, axis, encoders) =
                (stored.get(axis)?.as_ref()?, axes.get(axis)?, encoders.get(axis)?);
            let zero = stored.joint_zero.filter(|zero| zero.setting == encoders.joint_setting());
            zero.filter(|_| encoders.absolute.joint.is_some() && stored.encoder == EncoderSetting::new(axis))
        });
        Self { stored, joint_zeros, ..self }
    }

    /// Runs one round, counts it for the watchdog, and sets whether the operator permits enabling.
    pub fn round<H: Hardware<N>>(
        &mut self,
        ends: &mut HousekeepingEnds<'_, N>,
        signals: &Signals<N>,
        hardware: &mut H,
    ) {
        signals.statistics.rounds.add();
        self.act(&mut Level { ends, signals, hardware });
        signals.set_permits(self.permits());
        self.report_step(signals);
        signals.set_board_state(self.board_state(signals));
        hardware.set_status_light(StatusLight::from_inputs(&self.light_inputs(signals)).is_lit(self.round));
    }

    fn act(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        self.round = self.round.wrapping_add(1);
        self.advance_windings(level.signals);
        self.follow_counters(level);
        if self.advance_reset(level) {
            return;
        }
        self.check_board(level);
        self.send_passed(level);
        self.set_bandwidths(level);
        let situation = self.situation(level);
        let request = self.operator.tick(&situation);
        // Before the request, because the servo drops a step that the operator does not permit.
        level.signals.set_permits(self.permits());
        if let Some(request) = request {
            self.accept(request, level);
        } else {
            self.take_step(&situation, level);
        }
        self.advance_reference(level);
    }

    /// Orders the bandwidths of the current loops that a host has set, unless an axis is being calibrated. A
    /// current may flow. An axis that is not calibrated gets its bandwidth with its calibration.
    fn set_bandwidths(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        if self.calibrating.is_some() {
            return;
        }
        for (axis, set) in level.signals.current_bandwidths().into_iter().enumerate() {
            let Some(settings) = self.settings.axes.get(axis) else { return };
            let wanted = set.unwrap_or(settings.bandwidth);
            let runs = self.calibrated.get(axis).is_some_and(|calibrated| *calibrated);
            let Some(bandwidth) = self.bandwidths.get_mut(axis) else { return };
            // A full queue: again in the next round.
            if *bandwidth != wanted && (!runs || level.order(axis, Order::Bandwidth(wanted))) {
                *bandwidth = wanted;
            }
        }
    }

    /// Advances the windings by one round. A late round counts as one, so a winding cools less.
    fn advance_windings(&mut self, signals: &Signals<N>) {
        let seconds = self.round as f32 / RATE_HZ as f32;
        for (axis, (winding, before)) in self.windings.iter_mut().zip(&mut self.i2t).enumerate() {
            let now = signals.i2t(axis);
            let added = now.wrapping_sub(*before);
            *before = now;
            winding.advance(added as f32 * I2T_UNIT, 1.0 / RATE_HZ as f32);
            signals.set_winding(axis, winding);
            if let Some(assumed) = self.assumed.get_mut(axis) {
                *assumed &= !winding.has_forgotten(seconds);
            }
        }
    }

    /// Returns whether the operator permits enabling, by contact or host; never during a reset.
    fn permits(&self) -> bool {
        self.resetting.is_none() && self.operator.holds()
    }

    fn light_inputs(&self, signals: &Signals<N>) -> LightInputs {
        LightInputs {
            is_on: signals.permission() != Permission::Off,
            is_calibrating: self.calibrating.is_some(),
            is_inhibited: self.is_blocked(signals),
            is_on_trial: signals.program_status().has(ProgramStatus::ON_TRIAL),
            is_calibrated: self.is_calibrated(),
            is_referenced: signals.has_begun(),
        }
    }

    /// Whether an inhibit reason is set, or the drive has a fault.
    fn is_blocked(&self, signals: &Signals<N>) -> bool {
        !signals.inhibit.is_clear() || matches!(self.drive, Some(DriveState::Fault { .. }))
    }

    fn board_state(&self, signals: &Signals<N>) -> BoardState {
        let bits = [
            (self.is_calibrated(), BoardState::CALIBRATED),
            (signals.has_begun(), BoardState::REFERENCED),
            (self.calibrating.is_some(), BoardState::CALIBRATING),
            (self.operator.holds(), BoardState::SWITCH_CLOSED),
        ];
        BoardState(bits.into_iter().filter(|(is_set, _)| *is_set).fold(0, |bits, (_, bit)| bits | bit))
    }

    /// Takes the step that a host asked for: refused by the rules of the contacts, or carried out. While one
    /// is under way, others are dropped.
    fn take_step(&mut self, situation: &Situation, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let Some(step) = level.signals.take_step().filter(|_| self.step.is_none()) else { return };
        match self.operator.refusal(step, situation) {
            Some(why) => level.signals.set_report(StepReport::new(why)),
            None => {
                self.step = Some(step);
                self.failure = StepReport::new(StepResult::Interrupted);
                self.accept(step.into(), level);
            }
        }
    }

    /// Reports the result of a host's step once it has ended.
    fn report_step(&mut self, signals: &Signals<N>) {
        let done =
            |is_done: bool, otherwise| if is_done { StepReport::new(StepResult::Done) } else { otherwise };
        let report = match self.step {
            Some(CommissioningStep::Calibrate) if self.calibrating.is_none() => {
                done(self.is_calibrated(), self.failure)
            }
            Some(CommissioningStep::Reference) if self.reference.is_none() && !self.placed => {
                done(signals.has_begun(), StepReport::new(StepResult::JointMoved))
            }
            Some(CommissioningStep::Reset) if self.resetting.is_none() => {
                done(signals.inhibit.is_clear(), StepReport::new(StepResult::Inhibited))
            }
            _ => return,
        };
        self.step = None;
        signals.set_report(report);
    }

    fn situation(&self, level: &Level<'_, '_, N, impl Hardware<N>>) -> Situation {
        let Contacts { enabling, start } = level.hardware.contacts();
        Situation {
            enabling,
            start,
            blocked: self.is_blocked(level.signals),
            host_acts: level.signals.take_host_action(),
            calibrated: self.is_calibrated(),
            calibrating: self.calibrating.is_some(),
            referenced: level.signals.has_begun(),
            drive: self.drive,
        }
    }

    fn is_calibrated(&self) -> bool {
        self.calibrated.iter().all(|calibrated| *calibrated)
    }

    fn check_board(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        while let Some(drive) = level.ends.drive.dequeue() {
            self.drive = Some(drive);
        }
        let due = self.clock.next();
        if due.gates {
            for axis in 0..N {
                if !level.hardware.gate_holds(axis) {
                    level.signals.inhibit.raise(InhibitReason::GateConfiguration);
                }
            }
        }
        if due.temperatures {
            // The servo damps these faults; derating starts 20 degrees below.
            let most = self.settings.hottest_c;
            for axis in 0..N {
                let degrees = level.hardware.temperature(axis);
                level.signals.set_bridge_c(axis, degrees.unwrap_or(most));
                if let Some(fault) = of_temperature(degrees, most) {
                    level.signals.report(fault, axis);
                }
            }
            self.check_thermistors(level);
            for (axis, _) in self.windings.iter().enumerate().filter(|(_, winding)| winding.is_too_hot()) {
                level.signals.report(BoardFault::Winding, axis);
            }
        }
        if due.encoders {
            (0..N).for_each(|axis| self.check_encoders(axis, level));
        }
        for axis in 0..N {
            // An outcome may lead to an order for each axis, which must not be lost.
            if !level.takes_orders() {
                break;
            }
            let outcome = level.ends.outcomes.get_mut(axis).and_then(|outcomes| outcomes.dequeue());
            if let Some(outcome) = outcome {
                self.receive(axis, &outcome, level);
            }
        }
        if level.signals.take_forgotten() {
            (self.stored, self.passed, self.joint_zeros) = ([None; N], [None; N], [None; N]);
            self.unsent = [false; N];
        }
        self.record_causes(level);
    }

    /// Records every new inhibit reason; those of the gate drivers with each driver's status.
    fn record_causes(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let causes = level.signals.inhibit.causes();
        for cause in InhibitReason::ALL.into_iter().filter(|cause| causes & !self.recorded & cause.bit() != 0)
        {
            let why = cause.name();
            level.record(Record::Refused { why, value: causes });
            if matches!(cause, InhibitReason::GateFault | InhibitReason::GateConfiguration) {
                for axis in 0..N {
                    let status = level.hardware.gate_status(axis);
                    level.record(Record::GateDriver { why, joint: axis as u8 + 1, status });
                }
            }
        }
        self.recorded = causes;
    }

    fn receive(&mut self, axis: usize, outcome: &Outcome, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let joint = axis as u8 + 1;
        match outcome {
            Outcome::Calibrated(_) if self.is_contradicted(axis) => {
                level.record(refused(joint, "absolute_encoder", 0, None));
                self.failure = StepReport { axis: joint, ..StepReport::new(StepResult::JointMoved) };
                self.calibrating = None;
            }
            Outcome::Calibrated(calibration) => {
                level.record(found(joint, calibration));
                if let Some(findings) = calibration.findings() {
                    level.record(motor(joint, &findings));
                }
                // A check at standstill changes nothing that is stored.
                let before = self.stored.get(axis).copied().flatten();
                self.take_temperature(axis, before, calibration);
                let stored = if calibration.is_proven() {
                    let winding_c = self.known_temperature(axis);
                    let joint_zero = self.joint_zeros.get(axis).copied().flatten();
                    calibration.stored().map(|stored| StoredCalibration { winding_c, joint_zero, ..stored })
                } else {
                    before
                };
                self.passes(axis, stored);
                self.must_turn(axis, false);
                self.run_axis(axis, calibration, level);
            }
            Outcome::Refused(refusal) => {
                let (word, detail) = (words::calibration(*refusal), refusal.detail());
                level.record(refused(joint, word, detail, refusal.mismatch()));
                self.failure = StepReport {
                    result: StepResult::CalibrationRefused as u8,
                    axis: joint,
                    reason: refusal.number(),
                    detail: detail.min(255) as u8,
                };
                self.calibrating = None;
                use CalibrationRefusal::{BusVoltage, Load, Moved, Travel, Turning};
                if matches!(refusal, Moved) {
                    self.must_turn(axis, true);
                }
                // The stored calibration does not fit the motor or its mounting: measure again next time. A
                // load, a hand or the supply says nothing about it.
                let is_pushed = matches!(refusal, BusVoltage | Load(_) | Moved | Travel | Turning);
                if let Some((stored, zero)) =
                    self.stored.get_mut(axis).zip(self.joint_zeros.get_mut(axis)).filter(|_| !is_pushed)
                {
                    (*stored, *zero) = (None, None);
                }
            }
            Outcome::Index(search) => {
                let axes = &self.settings.axes;
                let certain = axes.get(axis).is_some_and(|axis| axis.index && search.is_certain(axis));
                if self.certain.get(axis).is_some_and(|before| *before != certain) {
                    level.record(Record::Index { joint, certain });
                }
                self.set_certain(axis, certain);
            }
            Outcome::Interrupted => {
                level.record(refused(joint, "interrupted", 0, None));
                self.calibrating = None;
            }
            // The axis runs on without a zero.
            Outcome::StoodStill => {
                self.set_certain(axis, false);
                level.record(Record::AxisFault { tick: self.round, joint, name: "zero_forgotten" });
                self.forget_zeros(level);
            }
            Outcome::Fault { fault, lost } => {
                level.record(Record::AxisFault { tick: self.round, joint, name: words::axis_fault(*fault) });
                if *lost {
                    self.forget_zeros(level);
                    self.must_turn(axis, true);
                    if let Some(calibrated) = self.calibrated.get_mut(axis) {
                        *calibrated = false;
                    }
                    // A braking motor brakes until a reset.
                    if *fault == AxisFault::Parameters {
                        // There is space: checked for every outcome.
                        level.order(axis, Order::Off);
                    }
                }
            }
        }
    }

    /// Keeps a passed calibration, to be sent to the storage.
    fn passes(&mut self, axis: usize, stored: Option<StoredCalibration>) {
        if let Some((passed, unsent)) = self.passed.get_mut(axis).zip(self.unsent.get_mut(axis)) {
            (*passed, *unsent) = (stored, true);
        }
    }

    /// Sends passed calibrations to the storage; again in the next round if its queue is full.
    fn send_passed(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        for (axis, (passed, unsent)) in self.passed.iter().zip(&mut self.unsent).enumerate() {
            *unsent = *unsent && level.ends.calibrated.enqueue((axis, *passed)).is_err();
        }
    }

    /// Temperature of a winding, unless it follows from an assumption.
    fn known_temperature(&self, axis: usize) -> Option<f32> {
        let is_assumed = self.assumed.get(axis).is_none_or(|assumed| *assumed);
        self.windings.get(axis).filter(|_| !is_assumed).map(Winding::temperature_c)
    }

    /// Whether an absolute encoder of an axis contradicts its counter.
    fn is_contradicted(&self, axis: usize) -> bool {
        self.contradicted.get(axis).is_some_and(|contradicted| *contradicted)
    }

    /// Replaces the assumed temperature of a winding by that of its resistance against the stored one.
    fn take_temperature(
        &mut self,
        axis: usize,
        stored: Option<StoredCalibration>,
        calibration: &Calibration,
    ) {
        let Some((assumed, winding)) = self.assumed.get_mut(axis).zip(self.windings.get_mut(axis)) else {
            return;
        };
        if let Some(stored) = stored
            && let Some(celsius) = stored.winding_c
            && *assumed
        {
            winding.measured(calibration.resistance().0 / stored.resistance.0, celsius);
        }
    }

    /// Sets whether the index of an axis is certain.
    fn set_certain(&mut self, axis: usize, certain: bool) {
        if let Some(slot) = self.certain.get_mut(axis) {
            *slot = certain;
        }
    }

    /// Sets whether the next calibration of an axis has to turn its motor.
    fn must_turn(&mut self, axis: usize, turns: bool) {
        if let Some(turning) = self.turning.get_mut(axis) {
            *turning = turns;
        }
    }

    /// Starts an axis that passed its calibration, with outputs off, and calibrates the next one.
    fn run_axis(
        &mut self,
        axis: usize,
        calibration: &Calibration,
        level: &mut Level<'_, '_, N, impl Hardware<N>>,
    ) {
        let encoder_count = level.hardware.encoder_count(axis);
        let sample = AxisSample { encoder_count, ..AxisSample::default() };
        let running = self.settings.axes.get(axis).zip(self.bandwidths.get(axis)).and_then(
            |(configuration, bandwidth)| {
                let mut axis = Axis::new(configuration, calibration, &sample).ok()?;
                axis.set_bandwidth(*bandwidth);
                Some(axis)
            },
        );
        self.set_origin(axis, calibration, encoder_count);
        let (Some(running), Some(calibrated)) = (running, self.calibrated.get_mut(axis)) else {
            self.calibrating = None;
            return level.signals.inhibit.raise(InhibitReason::Configuration);
        };
        *calibrated = true;
        // A running axis has no index search.
        self.set_certain(axis, false);
        // Counting restarts without a zero.
        level.signals.end_servo();
        // There is space: checked for every outcome.
        level.order(axis, Order::Run(running));
        let next = (axis + 1..N).find(|&next| !self.calibrated.get(next).copied().unwrap_or(true));
        self.calibrating = next;
        if let Some(next) = next {
            self.calibrate(next, level);
        }
    }

    fn calibrate(&mut self, axis: usize, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let settings = self.settings.axes.get(axis).zip(self.settings.calibration.get(axis));
        let stored = self.stored.get(axis).copied().flatten();
        let turns = self.turning.get(axis).is_some_and(|turns| *turns);
        let calibrator = settings.map(|(axis, settings)| match stored {
            // A calibration for another configuration is not used.
            Some(stored) => {
                Calibrator::from_stored(axis, *settings, stored).or_else(|_| Calibrator::new(axis, *settings))
            }
            None => Calibrator::new(axis, *settings),
        });
        let is_absolute = self.settings.encoders.get(axis).is_some_and(|encoders| encoders.absolute.rotor);
        let position = self.checks.get(axis).and_then(EncoderCheck::position);
        let is_contradicted = self.is_contradicted(axis);
        match calibrator {
            Some(Ok(_)) if is_contradicted || is_absolute && position.is_none() => {
                self.calibrating = None;
                let joint = axis as u8 + 1;
                self.failure = StepReport { axis: joint, ..StepReport::new(StepResult::JointMoved) };
                level.record(refused(joint, "absolute_encoder", 0, None));
            }
            Some(Ok(calibrator)) => {
                self.calibrating = Some(axis);
                let calibrator = if turns { calibrator.turning() } else { calibrator };
                let calibrator = match position {
                    Some((counter, counts)) => calibrator.at_position(counter, counts),
                    None => calibrator,
                };
                if !level.order(axis, Order::Calibrate(calibrator)) {
                    self.calibrating = None;
                }
            }
            _ => {
                self.calibrating = None;
                self.failure = StepReport::new(StepResult::Inhibited);
                level.signals.inhibit.raise(InhibitReason::Configuration);
            }
        }
    }

    fn accept(&mut self, request: OperatorRequest, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let accepted = match request {
            OperatorRequest::Power(request) => level.request(ControlRequest::Power(request)),
            // The servo records the result.
            OperatorRequest::Begin => {
                let request = match self.settings.assist {
                    Some(shares) => ControlRequest::Assist(shares),
                    None => ControlRequest::Identify,
                };
                if level.request(request) {
                    return;
                }
                false
            }
            OperatorRequest::Calibrate => {
                let first = self.calibrated.iter().position(|calibrated| !calibrated);
                if let Some(first) = first {
                    self.calibrate(first, level);
                }
                first.is_some()
            }
            OperatorRequest::EndCalibration => {
                // Requested in every round until the calibration has ended.
                if let Some(axis) = self.calibrating {
                    level.order(axis, Order::Off);
                }
                return;
            }
            OperatorRequest::Reference => {
                self.reference = Reference::by_operator();
                self.reference.is_some()
            }
            OperatorRequest::Reset => {
                // Braking motors are turned off first, because restarting gate drivers measure currents with
                // another gain.
                level.signals.inhibit.raise(InhibitReason::Resetting);
                level.hardware.disable_all();
                level.hardware.switch_gates(false);
                self.resetting = Some(0);
                return;
            }
        };
        level.record(Record::Request { tick: self.round, name: request.name(), accepted });
    }

    /// Continues a reset and returns whether one is under way: gate drivers off and on, then faults cleared.
    fn advance_reset(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) -> bool {
        let Some(rounds) = self.resetting else { return false };
        let rounds = rounds.saturating_add(1);
        // At its end the orders and the request must not be lost.
        let may_end = rounds >= GATES_READY && level.takes_orders() && level.ends.requests.ready();
        self.resetting = Some(rounds).filter(|_| !may_end);
        if rounds == GATES_ON {
            level.hardware.switch_gates(true);
        }
        if self.resetting.is_some() {
            return true;
        }
        let configured = level.hardware.configure_gates();
        // A switch closed during the reset must not count as closed after it: both contacts have to be open
        // once.
        self.operator = Operator::default();
        (self.checks, self.contradicted) = ([EncoderCheck::default(); N], [false; N]);
        level.signals.inhibit.reset();
        if !configured {
            level.signals.inhibit.raise(InhibitReason::GateConfiguration);
        }
        for axis in 0..N {
            level.order(axis, Order::ClearFault);
        }
        level.request(ControlRequest::Power(PowerRequest::ResetFault));
        level.record(Record::Request {
            tick: self.round,
            name: OperatorRequest::Reset.name(),
            accepted: true,
        });
        true
    }
}

fn found<const N: usize>(joint: u8, calibration: &Calibration) -> Record<N> {
    let [zero_b, zero_c] = calibration.current_offsets();
    Record::Calibration {
        joint,
        result: if calibration.is_proven() { "done" } else { "confirmed" },
        number: 0,
        resistance_ohm: calibration.resistance().0,
        direct_h: calibration.direct_inductance().0,
        quadrature_h: calibration.quadrature_inductance().0,
        offset_turns: calibration.offset().turns(),
        zero_b,
        zero_c,
        stated: f32::NAN,
        found: f32::NAN,
    }
}

fn motor<const N: usize>(joint: u8, findings: &MotorFindings) -> Record<N> {
    Record::CalibrationFindings {
        joint,
        flux_wb: findings.flux.0,
        friction_a: findings.friction.0,
        load_a: findings.load.0,
        resistance_sigma_ohm: findings.resistance_sigma.0,
        direct_sigma_h: findings.direct_sigma.0,
        quadrature_sigma_h: findings.quadrature_sigma.0,
        offset_sigma_turns: findings.offset_sigma_turns,
        flux_sigma_wb: findings.flux_sigma.0,
        friction_sigma_a: findings.friction_sigma.0,
    }
}

fn refused<const N: usize>(
    joint: u8,
    result: &'static str,
    number: u32,
    mismatch: Option<Mismatch>,
) -> Record<N> {
    let Mismatch { stated, found } = mismatch.unwrap_or(Mismatch { stated: f32::NAN, found: f32::NAN });
    Record::Calibration {
        joint,
        result,
        number,
        resistance_ohm: f32::NAN,
        direct_h: f32::NAN,
        quadrature_h: f32::NAN,
        offset_turns: f32::NAN,
        zero_b: f32::NAN,
        zero_c: f32::NAN,
        stated,
        found,
    }
}

#[cfg(test)]
mod tests;
