//! The hardware of this module's unit tests: registers as public fields, no decisions.
//!
//! One value serves every level, so tests of single levels and of several together use the same board. An
//! emergency stop can come before any access of a tick ([`Stop`]), like the interrupt of its contact.

use core::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use heapless::spsc::Producer;

use super::{BusEnds, BusQueues, Ends, HostEnds, Queues, Signals};
use crate::bus::device::{Device, LegOrder, LegRequest, LegStatus};
use crate::bus::drive::AxisConstants;
use crate::bus::identification::ResultsCopy;
use crate::bus::tests::constants;
use crate::bus::{Identity, NodeId};
use crate::hal::{AbsoluteEncoderSide, AxisCommand, Contacts, Controller, Frame, Hardware};
use crate::leg::{DeratingRamps, DriveState, JointCommand, JointStatus, Plan};
use crate::motor::SenseScale;
use crate::safety::InhibitReason;
use crate::units::{Hertz, Volt};

/// Usual reductions and scale of the bus voltage.
pub(super) const RAMPS: DeratingRamps =
    DeratingRamps::new([80.0, 100.0], [Volt(24.0), Volt(21.0)], [Volt(55.0), Volt(57.5)]);
pub(super) const VOLT_PER_CODE: Volt = SenseScale::ODRIVE_3_6.volt_per_code;

/// A watchdog whose new period becomes effective after a while. A write during another write is ignored.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TestWatchdog {
    pub(crate) stretched: bool,
    /// Milliseconds until a written value is effective, and the value.
    pub(crate) under_way: Option<(u64, bool)>,
    /// Duration of a write, ms; `None` if it never ends.
    pub(crate) takes_ms: Option<u64>,
    /// Number of feeds.
    pub(crate) fed: u32,
}

impl TestWatchdog {
    fn ask(&mut self, stretched: bool) -> bool {
        if self.under_way.is_none() && self.stretched != stretched {
            self.under_way = Some((self.takes_ms.unwrap_or(u64::MAX), stretched));
        }
        self.under_way.is_none() && self.stretched == stretched
    }

    pub(crate) fn pass(&mut self, milliseconds: u64) {
        self.under_way = self.under_way.and_then(|(left, value)| {
            if left > milliseconds {
                return Some((left - milliseconds, value));
            }
            self.stretched = value;
            None
        });
    }
}

/// Bus controller with three mailboxes. Frames leave in the order of writing, at once while the plug is in.
#[derive(Debug)]
pub(super) struct TestCan {
    pub(crate) controller: Controller,
    /// A frame was lost since the state was read.
    pub(crate) overrun: bool,
    /// Mailbox, frame, and time of writing, us.
    pub(crate) waiting: Vec<(u32, Frame, u64)>,
    pub(crate) unplugged: bool,
    /// Frames that left, with times of writing and leaving, us.
    pub(crate) sent: Vec<(Frame, u64, u64)>,
    /// Number of aborted transmissions.
    pub(crate) aborted: u32,
    /// Largest number of mailboxes in use at once.
    pub(crate) most: usize,
}

/// Interrupt of received frames: fills the queue whenever the clock is read, and adds processing time per
/// frame.
pub(super) struct Reception {
    queue: Producer<'static, Frame>,
    /// Frames on the wire.
    pub(crate) arriving: VecDeque<Frame>,
    /// Processing time of one frame, us.
    pub(crate) frame_us: u64,
    /// Processing time of all frames so far, us.
    spent_us: u64,
    /// Frames in the queue at the last call.
    queued: usize,
}

impl Reception {
    fn new(queue: Producer<'static, Frame>) -> Self {
        Self { queue, arriving: VecDeque::new(), frame_us: 0, spent_us: 0, queued: 0 }
    }

    /// Frames that were not processed yet.
    pub(crate) fn unheard(&self) -> usize {
        self.queue.len() + self.arriving.len()
    }

    fn deliver(&mut self) -> u64 {
        self.spent_us += (self.queued - self.queue.len()) as u64 * self.frame_us;
        while self.queue.ready()
            && let Some(frame) = self.arriving.pop_front()
        {
            let _ = self.queue.enqueue(frame);
        }
        self.queued = self.queue.len();
        self.spent_us
    }
}

/// An emergency stop whose interrupt comes before an access of the hardware: turns the bridges off, then sets
/// its inhibit reason.
pub(super) struct Stop<const N: usize> {
    pub(crate) signals: Rc<Signals<N>>,
    /// Accesses before the stop.
    pub(crate) after: u32,
    /// The stop waits for the end of a masked step.
    pub(crate) pending: bool,
    /// The stop was handled.
    pub(crate) handled: bool,
    /// Bridges were enabled after that.
    pub(crate) enabled_since: bool,
}

impl<const N: usize> Stop<N> {
    pub fn new(signals: &Rc<Signals<N>>, after: u32) -> Self {
        let signals = Rc::clone(signals);
        Self { signals, after, pending: false, handled: false, enabled_since: false }
    }
}

/// All registers of a board of `N` axes.
pub(super) struct TestHardware<const N: usize> {
    /// Outputs and duties of each bridge.
    pub(crate) bridges: [AxisCommand; N],
    pub(crate) brake: f32,
    /// The holding brake is released.
    pub(crate) holding_brake_released: bool,
    /// The status light is lit.
    pub(crate) is_lit: bool,
    pub(crate) servo_pended: u32,
    pub(crate) bus_pended: u32,
    /// Requests of the assistance.
    pub(crate) assist_pended: u32,
    pub(crate) contacts: Contacts,
    pub(crate) encoder_counts: [u16; N],
    /// Frames of the absolute encoders at rotor and joint.
    pub(crate) encoder_frames: [[u16; 2]; N],
    pub(crate) temperatures: [Option<f32>; N],
    /// Codes of the thermistors in the motors; `None` while the converter is silent.
    pub(crate) motor_codes: [Option<u16>; N],
    /// Axis whose thermistor is converted, and its code at the start of that.
    pub(crate) converted: Option<(usize, Option<u16>)>,
    pub(crate) gates_hold: [bool; N],
    pub(crate) gate_status: [u32; N],
    /// The gate drivers accept their configuration.
    pub(crate) gates_configure: bool,
    /// Each switching of the gate drivers' supply.
    pub(crate) gates_switched: Vec<bool>,
    pub(crate) now_us: u64,
    pub(crate) can: TestCan,
    pub(crate) reception: Option<RefCell<Reception>>,
    pub(crate) watchdog: TestWatchdog,
    pub(crate) processor_supply_is_low: bool,
    pub(crate) stop: Option<Stop<N>>,
    /// Accesses that a tick makes, counted for [`Stop`].
    pub(crate) accesses: u32,
    masked: bool,
}

impl<const N: usize> TestHardware<N> {
    /// A healthy board at rest, both contacts open, bridges at 30 degrees Celsius.
    pub fn new() -> Self {
        let can = TestCan {
            controller: Controller::Active,
            overrun: false,
            waiting: Vec::new(),
            unplugged: false,
            sent: Vec::new(),
            aborted: 0,
            most: 0,
        };
        Self {
            bridges: [AxisCommand::OFF; N],
            brake: 0.0,
            holding_brake_released: false,
            is_lit: false,
            servo_pended: 0,
            bus_pended: 0,
            assist_pended: 0,
            contacts: Contacts::default(),
            encoder_counts: [0; N],
            encoder_frames: [[u16::MAX; 2]; N],
            temperatures: [Some(30.0); N],
            motor_codes: [None; N],
            converted: None,
            gates_hold: [true; N],
            gate_status: [0; N],
            gates_configure: true,
            gates_switched: Vec::new(),
            now_us: 0,
            can,
            reception: None,
            watchdog: TestWatchdog { takes_ms: Some(48), ..TestWatchdog::default() },
            processor_supply_is_low: false,
            stop: None,
            accesses: 0,
            masked: false,
        }
    }

    /// Waiting frames leave if the plug is in.
    pub(crate) fn empty_mailboxes(&mut self) {
        if !self.can.unplugged {
            let now_us = self.now_us();
            let waiting = self.can.waiting.drain(..);
            self.can.sent.extend(waiting.map(|(_, frame, given_us)| (frame, given_us, now_us)));
        }
    }

    /// Reception of frames.
    pub(crate) fn reception(&self) -> core::cell::RefMut<'_, Reception> {
        self.reception.as_ref().expect("a bus").borrow_mut()
    }

    /// Whether any outputs are on.
    pub(crate) fn is_enabled(&self) -> bool {
        self.bridges.iter().any(|bridge| bridge.enabled)
    }

    /// Counts an access; the stop's interrupt comes before the selected one.
    fn access(&mut self) {
        if let Some(stop) = &mut self.stop {
            stop.pending |= stop.after == self.accesses;
        }
        self.accesses += 1;
        self.interrupt();
    }

    fn interrupt(&mut self) {
        if let Some(stop) = &mut self.stop
            && !self.masked
            && core::mem::take(&mut stop.pending)
        {
            self.bridges = [AxisCommand::OFF; N];
            self.holding_brake_released = false;
            stop.signals.inhibit.raise(InhibitReason::EmergencyStop);
            stop.handled = true;
        }
    }
}

impl<const N: usize> Hardware<N> for TestHardware<N> {
    fn masked(&mut self, step: impl FnOnce(&mut Self)) {
        self.access();
        self.masked = true;
        step(self);
        self.masked = false;
        self.interrupt();
    }
    fn disable_all(&mut self) {
        self.access();
        self.bridges = [AxisCommand::OFF; N];
        self.holding_brake_released = false;
    }
    fn disable(&mut self, axis: usize) {
        self.access();
        self.bridges[axis] = AxisCommand::OFF;
    }
    fn set_duty(&mut self, axis: usize, duty: &[f32; 3]) {
        self.access();
        self.bridges[axis].duty = *duty;
    }
    fn enable(&mut self, axis: usize) {
        self.access();
        self.bridges[axis].enabled = true;
        if let Some(stop) = &mut self.stop {
            stop.enabled_since |= stop.handled;
        }
    }
    fn set_brake(&mut self, duty: f32) {
        self.access();
        self.brake = duty;
    }
    fn set_holding_brake(&mut self, released: bool) {
        self.access();
        self.holding_brake_released = released;
    }
    fn set_status_light(&mut self, is_lit: bool) {
        self.is_lit = is_lit;
    }
    fn pend_servo(&mut self) {
        self.access();
        self.servo_pended += 1;
    }
    fn pend_bus(&mut self) {
        self.access();
        self.bus_pended += 1;
    }
    fn pend_assist(&mut self) {
        self.access();
        self.assist_pended += 1;
    }
    fn contacts(&self) -> Contacts {
        self.contacts
    }
    fn encoder_count(&self, axis: usize) -> u16 {
        self.encoder_counts[axis]
    }
    fn encoder_frame(&mut self, axis: usize, side: AbsoluteEncoderSide) -> u16 {
        self.encoder_frames[axis][side as usize]
    }
    fn temperature(&self, axis: usize) -> Option<f32> {
        self.temperatures[axis]
    }

    fn convert_thermistor(&mut self, axis: usize) {
        self.converted = Some((axis, self.motor_codes[axis]));
    }

    fn thermistor_code(&mut self) -> Option<u16> {
        self.converted.and_then(|(_, code)| code)
    }
    fn gate_holds(&mut self, axis: usize) -> bool {
        self.gates_hold[axis]
    }
    fn gate_status(&mut self, axis: usize) -> u32 {
        self.gate_status[axis]
    }
    fn switch_gates(&mut self, on: bool) {
        self.gates_switched.push(on);
    }
    fn configure_gates(&mut self) -> bool {
        self.gates_configure
    }
    fn now_us(&self) -> u64 {
        self.now_us + self.reception.as_ref().map_or(0, |reception| reception.borrow_mut().deliver())
    }
    fn controller(&mut self) -> Controller {
        if core::mem::take(&mut self.can.overrun) { Controller::Overrun } else { self.can.controller }
    }
    fn mailboxes_waiting(&self) -> u32 {
        self.can.waiting.iter().fold(0, |bits, (mailbox, _, _)| bits | 1 << mailbox)
    }
    fn send(&mut self, mailbox: u32, frame: &Frame) {
        assert!(mailbox < 3 && self.mailboxes_waiting() & 1 << mailbox == 0, "dropped");
        let now_us = self.now_us();
        self.can.waiting.push((mailbox, *frame, now_us));
        self.can.most = self.can.most.max(self.can.waiting.len());
    }
    fn abort_transmission(&mut self) {
        self.can.aborted += 1;
        self.can.waiting.clear();
    }
    fn processor_supply_is_low(&self) -> bool {
        self.processor_supply_is_low
    }
    fn feed_watchdog(&mut self) {
        self.watchdog.fed += 1;
    }
    fn stretch_watchdog(&mut self) -> bool {
        self.watchdog.ask(true)
    }
    fn tighten_watchdog(&mut self) -> bool {
        self.watchdog.ask(false)
    }
}

/// Hardware that receives frames, and the ends of its bus' queues.
pub(super) fn on_a_bus() -> (TestHardware<2>, HostEnds<'static, 2>, BusEnds<'static, 2>) {
    let queues = Box::leak(Box::new(BusQueues::new()));
    let (frames, host, bus, _) = queues.split();
    let mut hardware = TestHardware::new();
    hardware.reception = Some(RefCell::new(Reception::new(frames)));
    (hardware, host, bus)
}

/// Ends of queues that are never freed.
pub(super) fn ends() -> Ends<'static, 2> {
    Box::leak(Box::new(Queues::new())).split(Box::leak(Box::default()))
}

/// Empty results of an identification.
pub(super) const NOTHING: ResultsCopy<2, 1> = ResultsCopy::nothing();

/// Two nodes with the numbers 1 and 2.
pub(super) fn device() -> Device<2, 4> {
    let (position_bandwidth, current_bandwidth) = (Hertz(6.0), Hertz(1000.0));
    let constants = AxisConstants { position_bandwidth, current_bandwidth, ..constants() };
    let own = [1, 2].map(|number| NodeId::new(number).expect("a number"));
    let identity = Identity::scarab(1, "test");
    Device::new(own, identity, [constants; 2], Plan::OneTime, 1).with_emergency_inhibit(0)
}

/// An order of the bus without faults or refusals.
pub(super) fn order(commands: Option<[JointCommand; 2]>, request: Option<LegRequest>) -> LegOrder<2> {
    LegOrder { commands, request, faults: [None; 2], may_return: [true; 2], refused: None }
}

/// Values of the elements that match a pattern, in their order.
macro_rules! picked {
    ($elements:expr, $pattern:pat $(if $guard:expr)? => $value:expr) => {
        $elements.iter().filter_map(|element| match element {
            $pattern $(if $guard)? => Some($value),
            _ => None,
        })
    };
}
pub(super) use picked;

/// Commands of a host that has the drive.
pub(super) fn commanded() -> [JointCommand; 2] {
    let mut device = device();
    // The boot-up message goes first.
    assert!(device.poll(0, 0, &NOTHING).is_some());
    device.receive(&Frame::new(0x601, &[0x2B, 0x40, 0x60, 0, 6, 0, 0, 0]), 0, None, &NOTHING);
    assert!(device.poll(0, 0, &NOTHING).is_some());
    let joint = JointStatus { drive: DriveState::SwitchOnDisabled, ..JointStatus::NONE };
    device.update(&LegStatus { joints: [joint; 2], rests: false, ..LegStatus::NONE });
    device.order().commands.expect("a host")
}
