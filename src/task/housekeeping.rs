//! Level 6: the operator's contacts, gate drivers, temperatures, calibration and reference, and the watchdog.
//!
//! The watchdog is fed by a task of its own, and only if since the last time both axes' current loops, the servo and the
//! housekeeping have run: one of them hanging is a reset, after which the drive stays refused.

use embassy_time::{Duration, Ticker, Timer};
use heapless::spsc::{Consumer, Producer};

use super::interlock::{self, Cause};
use super::leg::JOINTS;
use super::links::{Order, Outcome};
use super::servo;
use super::statistics::{self, Count};
use crate::board::odrive_v3_6::gate_driver::GateDrivers;
use crate::board::odrive_v3_6::settings::analog::{HOTTEST_C, temperature_c};
use crate::board::odrive_v3_6::settings::drives::CALIBRATION;
use crate::board::odrive_v3_6::{contacts, converter, encoder, watchdog};
use crate::hal::{AxisSample, JointSample};
use crate::leg::{AxisFault, Calibration, ControlRequest, DriveState};
use crate::motor::reference::{ReferenceStep, StatedPose};
use crate::motor::{Axis, AxisConfiguration, Calibrator};
use crate::operator::{Ask, Operator, RATE_HZ, Situation};
use crate::real::max;
use crate::safety::{CheckIns, UpkeepClock, of_gate_driver, of_temperature};
use crate::trace::{Record, words};
use crate::units::Hertz;

/// Rounds of the housekeeping, for the watchdog.
static ROUNDS: Count = Count::zero();

/// What level 6 works on.
pub struct Housekeeping {
    /// Both.
    pub gate_drivers: GateDrivers,
    /// As commissioned.
    pub axes: [AxisConfiguration; JOINTS],
    /// To each axis.
    pub orders: [Producer<'static, Order>; JOINTS],
    /// From each axis.
    pub outcomes: [Consumer<'static, Outcome>; JOINTS],
    /// To the servo.
    pub requests: Producer<'static, ControlRequest<JOINTS>>,
    /// From the servo.
    pub drive: Consumer<'static, DriveState>,
    /// To whoever tells.
    pub notes: Producer<'static, Record<JOINTS>>,
}

/// What changes.
struct State {
    clock: UpkeepClock,
    operator: Operator,
    calibrated: [bool; JOINTS],
    /// The axis that is being calibrated.
    calibrating: Option<usize>,
    /// Joints that are waited for to stand still, and which of them have.
    reference: Option<[(StatedPose, bool); JOINTS]>,
    /// The zeros were set in the tick before: the servo may begin.
    placed: bool,
    drive: Option<DriveState>,
    tick: u32,
    causes: u32,
}

/// Feeds the watchdog as long as everything else runs.
#[embassy_executor::task]
pub async fn watch() -> ! {
    let mut ticker = Ticker::every(Duration::from_millis(4));
    let [first, second] = &statistics::CURRENT_TICKS;
    let seen = || [first, second, &statistics::SERVO_TICKS, &ROUNDS].map(Count::get);
    let mut check_ins = CheckIns::new(seen());
    loop {
        ticker.next().await;
        if check_ins.all(seen()) {
            watchdog::feed();
        }
    }
}

/// Everything else at this level.
#[embassy_executor::task]
pub async fn run(mut keeping: Housekeeping) -> ! {
    let mut state = State::new();
    let mut ticker = Ticker::every(Duration::from_hz(u64::from(RATE_HZ)));
    loop {
        ticker.next().await;
        state.tick = state.tick.wrapping_add(1);
        ROUNDS.add();
        keeping.look(&mut state);
        if let Some(ask) = state.operator.tick(&state.situation()) {
            keeping.accept(ask, &mut state).await;
        }
        keeping.advance_reference(&mut state);
    }
}

impl State {
    fn new() -> Self {
        Self {
            clock: UpkeepClock::new(RATE_HZ),
            operator: Operator::default(),
            calibrated: [false; JOINTS],
            calibrating: None,
            reference: None,
            placed: false,
            drive: None,
            tick: 0,
            causes: 0,
        }
    }

    fn situation(&self) -> Situation {
        Situation {
            enabling: contacts::enabling(),
            start: contacts::start(),
            blocked: !interlock::is_clear() || matches!(self.drive, Some(DriveState::Fault { .. })),
            calibrated: self.calibrated.iter().all(|calibrated| *calibrated),
            calibrating: self.calibrating.is_some(),
            referenced: servo::has_begun(),
            drive: self.drive,
        }
    }
}

impl Housekeeping {
    fn say(&mut self, record: Record<JOINTS>) {
        if self.notes.enqueue(record).is_err() {
            statistics::RECORDS_LOST.add();
        }
    }

    fn look(&mut self, state: &mut State) {
        while let Some(drive) = self.drive.dequeue() {
            state.drive = Some(drive);
        }
        let due = state.clock.next();
        if due.gates {
            for axis in 0..JOINTS {
                if let Some(cause) = of_gate_driver(self.gate_drivers.holds(axis)) {
                    interlock::raise(cause);
                }
            }
        }
        if due.temperatures {
            // Both are damped by the servo, which gives less torque from 20 degrees below on.
            let mut hottest_c = f32::MIN;
            for code in converter::thermistors().into_iter().take(JOINTS) {
                let degrees = temperature_c(code);
                hottest_c = max(hottest_c, degrees.unwrap_or(HOTTEST_C));
                if let Some(code) = of_temperature(degrees, HOTTEST_C) {
                    servo::report(code);
                }
            }
            servo::set_temperature(hottest_c);
        }
        for axis in 0..JOINTS {
            if let Some(outcome) = self.outcomes.get_mut(axis).and_then(Consumer::dequeue) {
                self.hear(axis, &outcome, state);
            }
        }
        self.tell_causes(state);
    }

    /// Every cause that has come since the last time.
    fn tell_causes(&mut self, state: &mut State) {
        let causes = interlock::causes();
        for cause in Cause::ALL {
            if causes & !state.causes & cause.bit() != 0 {
                let status = match cause {
                    Cause::GateFault | Cause::GateConfiguration => self.gate_drivers.status(0),
                    _ => causes,
                };
                self.say(Record::Refused { why: cause.name(), value: status });
            }
        }
        state.causes = causes;
    }

    fn hear(&mut self, axis: usize, outcome: &Outcome, state: &mut State) {
        let joint = axis as u8 + 1;
        match outcome {
            Outcome::Calibrated(calibration) => {
                self.say(found(joint, calibration));
                self.run_axis(axis, calibration, state);
            }
            Outcome::Refused(refusal) => {
                let (result, number) = words::calibration(*refusal);
                self.say(refused(joint, result, number));
                state.calibrating = None;
            }
            Outcome::Interrupted => {
                self.say(refused(joint, "interrupted", 0));
                state.calibrating = None;
            }
            Outcome::Fault { fault, lost } => {
                self.say(Record::AxisFault { tick: state.tick, joint, name: words::axis_fault(*fault) });
                if *lost {
                    // With the place goes the joint's zero, also one that is being looked for.
                    servo::end();
                    (state.drive, state.reference, state.placed) = (None, None, false);
                    if let Some(calibrated) = state.calibrated.get_mut(axis) {
                        *calibrated = false;
                    }
                    // A motor that brakes does so until a reset.
                    if *fault == AxisFault::Parameters {
                        self.order(axis, Order::Off);
                    }
                }
            }
        }
    }

    /// An axis that passed runs from now on, released; then the next one is measured.
    fn run_axis(&mut self, axis: usize, calibration: &Calibration, state: &mut State) {
        let sample = AxisSample { encoder_count: encoder::count(axis), ..AxisSample::default() };
        let running = self.axes.get(axis).and_then(|axis| Axis::new(axis, calibration, &sample).ok());
        let (Some(running), Some(calibrated)) = (running, state.calibrated.get_mut(axis)) else {
            state.calibrating = None;
            return interlock::raise(Cause::Configuration);
        };
        *calibrated = true;
        // Its counts begin anew, without a zero.
        servo::end();
        self.order(axis, Order::Run(running));
        let next = (axis + 1..JOINTS).find(|&next| !state.calibrated.get(next).copied().unwrap_or(true));
        state.calibrating = next;
        if let Some(next) = next {
            self.calibrate(next, state);
        }
    }

    fn calibrate(&mut self, axis: usize, state: &mut State) {
        match self.axes.get(axis).map(|axis| Calibrator::new(axis, CALIBRATION)) {
            Some(Ok(calibrator)) => {
                state.calibrating = Some(axis);
                self.order(axis, Order::Calibrate(calibrator));
            }
            _ => interlock::raise(Cause::Configuration),
        }
    }

    fn order(&mut self, axis: usize, order: Order) {
        if let Some(orders) = self.orders.get_mut(axis) {
            // An axis takes an order within 42 us, this level gives at most two in 2 ms.
            let _ = orders.enqueue(order);
        }
    }

    async fn accept(&mut self, ask: Ask, state: &mut State) {
        let accepted = match ask {
            Ask::Power(request) => self.requests.enqueue(ControlRequest::Power(request)).is_ok(),
            // The servo tells what became of it.
            Ask::Identify => {
                let _ = self.requests.enqueue(ControlRequest::Identify);
                return;
            }
            Ask::Calibrate => {
                let first = state.calibrated.iter().position(|calibrated| !calibrated);
                if let Some(first) = first {
                    self.calibrate(first, state);
                }
                first.is_some()
            }
            Ask::EndCalibration => {
                // Asked in every tick until it has ended.
                if let Some(axis) = state.calibrating {
                    self.order(axis, Order::Off);
                }
                return;
            }
            Ask::Reference => {
                let pose = StatedPose::new(Hertz(RATE_HZ as f32));
                state.reference = pose.map(|pose| [(pose, false); JOINTS]);
                state.reference.is_some()
            }
            Ask::Reset => {
                self.reset().await;
                true
            }
        };
        self.say(Record::Request { tick: state.tick, name: ask.name(), accepted });
    }

    /// Gate drivers off and on again, faults forgotten: what still holds comes back.
    async fn reset(&mut self) {
        self.gate_drivers.off();
        Timer::after_millis(1).await;
        self.gate_drivers.on();
        for _ in 0..10 {
            Timer::after_millis(2).await;
            ROUNDS.add();
        }
        let configured = self.gate_drivers.configure();
        interlock::reset();
        if configured.contains(&false) {
            interlock::raise(Cause::GateConfiguration);
        }
        for axis in 0..JOINTS {
            self.order(axis, Order::ClearFault);
        }
        let _ = self.requests.enqueue(ControlRequest::Power(crate::leg::PowerRequest::ResetFault));
    }

    fn advance_reference(&mut self, state: &mut State) {
        if core::mem::take(&mut state.placed) && state.calibrated.iter().all(|calibrated| *calibrated) {
            servo::begin();
        }
        let Some(mut poses) = state.reference else { return };
        let mut standing = true;
        for ((pose, found), count) in poses.iter_mut().zip(&statistics::COUNTS) {
            let sample = JointSample { encoder_counts: count.get().cast_signed(), ..JointSample::default() };
            match pose.tick(&sample) {
                ReferenceStep::Running(_) => {}
                ReferenceStep::Found(_) => *found = true,
                ReferenceStep::Refused(_) => standing = false,
            }
        }
        state.reference = Some(poses).filter(|_| standing);
        if !standing {
            self.say(Record::Request { tick: state.tick, name: "reference", accepted: false });
        } else if poses.iter().all(|(_, found)| *found) {
            state.reference = None;
            state.placed = true;
            for axis in 0..JOINTS {
                self.order(axis, Order::Place(0));
            }
        }
    }
}

fn found(joint: u8, calibration: &Calibration) -> Record<JOINTS> {
    let [zero_b, zero_c] = calibration.zeros();
    Record::Calibration {
        joint,
        result: "done",
        number: 0,
        resistance_ohm: calibration.resistance().0,
        direct_h: calibration.direct_inductance().0,
        quadrature_h: calibration.quadrature_inductance().0,
        offset_turns: calibration.offset().turns(),
        zero_b,
        zero_c,
    }
}

fn refused(joint: u8, result: &'static str, number: u32) -> Record<JOINTS> {
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
    }
}
