//! What lies beneath the firmware in place of a board's registers and queues.
//!
//! Queues hold what the board's hold (`scarab::task::links`), one that is full takes no more.

use std::collections::VecDeque;

use scarab::board::odrive_v3_6::settings::analog::temperature_c;
use scarab::hal::{AxisCommand, DriveCommand, JointSample};
use scarab::leg::{ControlRequest, DriveState};
use scarab::motor::AxisRequest;
use scarab::operation::{CurrentBoard, HousekeepingBoard, Order, Outcome};
use scarab::safety::{Cause, FaultCode};
use scarab::trace::Record;

use super::{Edges, Hand};

/// Orders and requests that wait, and outcomes.
const ORDERS: usize = 2;
const OUTCOMES: usize = 3;
/// Of the thermistor of a bridge at 41 degrees Celsius.
pub(super) const WARM_CODE: u16 = 1500;

/// A board's registers, contacts and queues.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ports<const N: usize> {
    pub(super) hand: Hand,
    pub(super) edges: Edges,
    pub(super) period: u64,
    /// What the firmware must not see.
    pub(super) blind: &'static [FaultCode],
    pub(super) causes: u32,
    pub(super) commands: [AxisCommand; N],
    pub(super) brake: f32,
    pub(super) targets: DriveCommand<N>,
    /// The joints have calibrations and zeros.
    pub(super) begun: bool,
    pub(super) orders: [VecDeque<Order>; N],
    pub(super) outcomes: [VecDeque<Outcome>; N],
    pub(super) requests: VecDeque<ControlRequest<N>>,
    pub(super) drive: VecDeque<DriveState>,
    pub(super) samples: [JointSample; N],
    pub(super) counts: [i32; N],
    pub(super) encoders: [u16; N],
    /// Current ticks of the axes.
    pub(super) ticks: [u32; N],
    pub(super) servo_ticks: u32,
    pub(super) servo_due: bool,
    /// For the servo's next tick.
    pub(super) reported: VecDeque<(FaultCode, usize)>,
    pub(super) hottest_c: f32,
    pub(super) thermistors: [u16; N],
    pub(super) gates: [bool; N],
    pub(super) gates_on: bool,
    /// The first that an axis told of since the last reset.
    pub(super) axis_fault: Option<FaultCode>,
}

impl<const N: usize> Ports<N> {
    /// Nothing asked, nothing known but where the joints are.
    pub(super) fn new(samples: [JointSample; N]) -> Self {
        Self {
            hand: Hand::default(),
            edges: Edges::default(),
            period: 0,
            blind: &[],
            causes: 0,
            commands: [AxisCommand::RELEASED; N],
            brake: 0.0,
            targets: DriveCommand::RELEASED,
            begun: false,
            orders: core::array::from_fn(|_| VecDeque::new()),
            outcomes: core::array::from_fn(|_| VecDeque::new()),
            requests: VecDeque::new(),
            drive: VecDeque::new(),
            samples,
            counts: samples.map(|sample| sample.encoder_counts),
            encoders: [0; N],
            ticks: [0; N],
            servo_ticks: 0,
            servo_due: false,
            reported: VecDeque::new(),
            hottest_c: 0.0,
            thermistors: [WARM_CODE; N],
            gates: [true; N],
            gates_on: true,
            axis_fault: None,
        }
    }

    pub(super) fn is_blind(&self, code: Option<FaultCode>) -> bool {
        code.is_some_and(|code| self.blind.contains(&code))
    }

    fn blind_bits(&self) -> u32 {
        let blind = |cause: &Cause| self.is_blind(cause.code());
        Cause::ALL.into_iter().filter(blind).fold(0, |bits, cause| bits | cause.bit())
    }

    /// A code that the rest of the board saw, unless it is not to be seen.
    pub(super) fn note(&mut self, code: FaultCode, joint: usize) {
        if !self.is_blind(Some(code)) {
            self.reported.push_back((code, joint));
        }
    }

    fn end(&mut self) {
        (self.begun, self.targets) = (false, DriveCommand::RELEASED);
    }
}

impl<const N: usize> CurrentBoard for Ports<N> {
    fn causes(&self) -> u32 {
        self.causes
    }

    fn raise(&mut self, bits: u32) {
        self.causes |= if bits == 0 { 0 } else { bits & !self.blind_bits() };
    }

    fn release_all(&mut self) {
        self.commands = [AxisCommand::RELEASED; N];
    }

    fn drive(&mut self, axis: usize, command: &AxisCommand) {
        self.commands[axis] = *command;
    }

    fn set_brake(&mut self, duty: f32) {
        self.brake = duty;
    }

    fn target(&self, axis: usize) -> AxisRequest {
        if !self.targets.enabled {
            return AxisRequest::RELEASED;
        }
        AxisRequest { enabled: true, current: self.targets.currents[axis] }
    }

    fn end_servo(&mut self) {
        self.end();
    }

    fn damp(&mut self) {
        self.note(FaultCode::CurrentTicks, 0);
    }

    fn has_order(&self, axis: usize) -> bool {
        !self.orders[axis].is_empty()
    }

    fn order(&mut self, axis: usize) -> Option<Order> {
        self.orders[axis].pop_front()
    }

    fn tell(&mut self, axis: usize, outcome: Outcome) {
        if let Outcome::Fault { fault, .. } = outcome {
            self.axis_fault = self.axis_fault.or(Some(scarab::leg::axis_code(fault)));
        }
        if self.outcomes[axis].len() < OUTCOMES {
            self.outcomes[axis].push_back(outcome);
        }
    }

    fn sample(&mut self, axis: usize, sample: JointSample) {
        self.samples[axis] = sample;
    }

    fn servo_ticks(&self) -> u32 {
        self.servo_ticks
    }

    fn call_servo(&mut self, _: bool) {
        self.servo_due = true;
    }

    fn count_missed(&mut self) {}
}

impl<const N: usize> HousekeepingBoard<N> for Ports<N> {
    fn contacts(&self) -> (bool, bool) {
        (self.hand.enabling, self.hand.start)
    }

    fn causes(&self) -> u32 {
        self.causes
    }

    fn raise(&mut self, cause: Cause) {
        CurrentBoard::raise(self, cause.bit());
    }

    fn reset_interlock(&mut self) {
        self.causes &= Cause::for_ever();
        self.axis_fault = None;
        self.edges.reset = Some(self.period);
    }

    fn gate_holds(&mut self, axis: usize) -> bool {
        self.gates[axis]
    }

    fn gate_status(&mut self) -> u32 {
        0
    }

    fn switch_gates(&mut self, on: bool) {
        self.gates_on = on;
    }

    fn configure_gates(&mut self) -> bool {
        self.gates.iter().all(|holds| *holds)
    }

    fn temperature(&self, axis: usize) -> Option<f32> {
        temperature_c(self.thermistors[axis])
    }

    fn set_temperature(&mut self, degrees_c: f32) {
        self.hottest_c = degrees_c;
    }

    fn report(&mut self, code: FaultCode, axis: usize) {
        self.note(code, axis);
    }

    fn encoder_count(&self, axis: usize) -> u16 {
        self.encoders[axis]
    }

    fn joint_counts(&self, joint: usize) -> i32 {
        self.counts[joint]
    }

    fn begin_servo(&mut self) {
        self.begun = true;
    }

    fn end_servo(&mut self) {
        self.end();
    }

    fn has_begun(&self) -> bool {
        self.begun
    }

    fn order(&mut self, axis: usize, order: Order) {
        if self.orders[axis].len() < ORDERS {
            self.orders[axis].push_back(order);
        }
    }

    fn outcome(&mut self, axis: usize) -> Option<Outcome> {
        self.outcomes[axis].pop_front()
    }

    fn request(&mut self, request: ControlRequest<N>) -> bool {
        let has_room = self.requests.len() < ORDERS;
        if has_room {
            self.requests.push_back(request);
        }
        has_room
    }

    fn drive_state(&mut self) -> Option<DriveState> {
        self.drive.pop_front()
    }

    fn say(&mut self, _: Record<N>) {}
}
