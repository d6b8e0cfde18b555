//! Tests of the servo's level with the control of the default leg, whose joints stand still.

use super::super::testing::{RAMPS, TestHardware, VOLT_PER_CODE, commanded, ends, on_a_bus, order, picked};
use super::super::{AssistEnds, AssistQueues, BusEnds, Ends};
use super::*;
use crate::bus::device::{LegOrder, LegRequest, LegStatus};
use crate::hal::{Contacts, DriveCommand};
use crate::leg::testing::{LEG, configuration};
use crate::leg::{Finding, JointCommand, PowerRequest};
use crate::safety::BoardFault;
use crate::units::Ampere;

mod assist;
mod bandwidths;
mod faults;
mod holding_brake;
mod reports;

/// Counts at which both joints are within their ranges.
const COUNTS: i32 = 30_000;

struct Bench {
    control: Control<2>,
    level: ServoLevel<2>,
    hardware: TestHardware<2>,
    signals: Signals<2>,
    ends: Ends<'static, 2>,
    bus: BusEnds<'static, 2>,
    assist: AssistEnds<'static, 2>,
    counts: [i32; 2],
    /// The identification takes its events.
    is_received: bool,
    events: Vec<LegEvent<2>>,
    states: Vec<DriveState>,
    /// Newest report to the bus.
    status: Option<LegStatus<2>>,
}

impl Bench {
    /// A leg with a bus, whose joints have no zeros yet; the operator holds the enabling switch.
    fn resting() -> Self {
        let (mut hardware, host, bus) = on_a_bus();
        let configuration = configuration();
        let control = Control::new(&configuration).expect("a leg");
        let level = ServoLevel::new(&control, RAMPS, VOLT_PER_CODE, Some(Following::new(&configuration)));
        let mut ends = ends();
        ends.servo.host = Some(host);
        let (servo, assist) = Box::leak(Box::new(AssistQueues::new())).split();
        ends.servo.assist = Some(servo);
        hardware.contacts = Contacts { enabling: true, start: false };
        let signals = Signals::new();
        signals.set_permits(true);
        signals.set_bridge_c(0, 30.0);
        let mut bench = Self {
            control,
            level,
            hardware,
            signals,
            ends,
            bus,
            assist,
            counts: [COUNTS; 2],
            is_received: true,
            events: Vec::new(),
            states: Vec::new(),
            status: None,
        };
        bench.set_bus(Volt(48.0));
        bench
    }

    /// All joints have their zeros.
    fn begun() -> Self {
        let bench = Self::resting();
        bench.signals.begin_servo();
        bench
    }

    fn enabled() -> Self {
        let mut bench = Self::begun();
        bench.enable();
        bench.clear();
        bench
    }

    fn enable(&mut self) {
        use PowerRequest::{EnableOperation, Shutdown, SwitchOn};
        for power in [Shutdown, SwitchOn, EnableOperation] {
            self.ask(ControlRequest::Power(power));
            self.tick();
        }
        assert_eq!(self.control.state(), DriveState::OperationEnabled);
    }

    fn set_bus(&mut self, volt: Volt) {
        self.signals.statistics.see_bus((volt.0 / VOLT_PER_CODE.0) as u16);
    }

    /// The operator requests.
    fn ask(&mut self, request: ControlRequest) {
        assert!(self.ends.housekeeping.requests.enqueue(request).is_ok(), "full");
    }

    /// The fault for which the leg damps or is off.
    fn fault(&self) -> Option<Fault> {
        match self.control.state() {
            DriveState::Fault { fault } | DriveState::FaultReactionActive { fault, .. } => Some(fault),
            _ => None,
        }
    }

    /// The bus orders.
    fn order(&mut self, commands: Option<[JointCommand; 2]>, request: Option<LegRequest>) {
        assert!(self.bus.orders.enqueue(order(commands, request)).is_ok(), "full");
    }

    fn tick(&mut self) -> Option<ControlOutput<2>> {
        for (samples, counts) in self.ends.current.samples.iter_mut().zip(self.counts) {
            let sample = JointSample { encoder_counts: counts, ..JointSample::default() };
            assert!(samples.enqueue(sample).is_ok(), "full");
        }
        let Self { level, control, ends, signals, hardware, .. } = self;
        let output = level.tick(control, LEG.gravity, &mut ends.servo, signals, hardware);
        if self.is_received {
            self.events.extend(core::iter::from_fn(|| self.ends.identification.events.dequeue()));
        }
        self.states.extend(core::iter::from_fn(|| self.ends.housekeeping.drive.dequeue()));
        self.status = self.bus.status.dequeue().or(self.status);
        output
    }

    fn run(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| {
            self.tick();
        });
    }

    fn clear(&mut self) {
        self.events.clear();
        self.states.clear();
    }

    /// Kinds of the events so far except samples; records by their kind and name.
    fn names(&self) -> Vec<&'static str> {
        let name = |event: &LegEvent<2>| {
            Some(match event {
                LegEvent::Sample(_) => return None,
                LegEvent::Activity(_) => "activity",
                LegEvent::Begun(..) => "begun",
                LegEvent::TookUpdate => "took update",
                LegEvent::TookResult => "took result",
                LegEvent::Record(Record::Fault { .. }) => "fault",
                LegEvent::Record(Record::State { .. }) => "state",
                LegEvent::Record(Record::Limit { .. }) => "limit",
                LegEvent::Record(Record::Request { .. }) => "request",
                LegEvent::Record(Record::NotEnabled { .. }) => "not enabled",
                LegEvent::Record(_) => "another record",
            })
        };
        self.events.iter().filter_map(name).collect()
    }
}

#[test]
fn the_leg_does_not_tick_before_every_joint_has_a_zero() {
    let mut bench = Bench::resting();
    bench.signals.set_targets(&DriveCommand { enabled: true, currents: [Ampere(1.0); 2] });
    bench.signals.set_permission(Permission::Follow);
    bench.ask(ControlRequest::Power(PowerRequest::Shutdown));
    bench.order(Some(commanded()), Some(LegRequest::Power(PowerRequest::Shutdown)));
    for _ in 0..2 {
        assert!(bench.tick().is_none());
    }
    assert_eq!((bench.signals.target(0).enabled, bench.signals.target(1).enabled), (false, false));
    assert_eq!((bench.signals.permission(), bench.level.tick), (Permission::Off, 0));
    // The bus is informed that the leg rests; the request is dropped.
    let joints = bench.status.expect("a report").joints;
    assert!(joints.iter().all(|joint| joint.bus.0 > 40.0));
    assert_eq!(bench.status, Some(LegStatus { joints, held: true, blocked: false, ..LegStatus::NONE }));
    assert!(bench.bus.orders.ready());
    bench.signals.begin_servo();
    assert!(bench.tick().is_some());
    assert_eq!((bench.control.state(), bench.level.tick), (DriveState::SwitchOnDisabled, 1));
    assert_eq!(bench.signals.statistics.counts.each_ref().map(|count| count.get()), [COUNTS as u32; 2]);
}

#[test]
fn a_restarted_leg_is_off_and_has_no_targets() {
    let mut bench = Bench::enabled();
    assert_eq!(bench.signals.permission(), Permission::Follow);
    assert!(bench.signals.target(0).enabled && bench.signals.target(1).enabled);
    bench.signals.end_servo();
    bench.tick();
    assert_eq!((bench.signals.permission(), bench.signals.target(0).enabled), (Permission::Off, false));
    bench.signals.begin_servo();
    bench.tick();
    assert_eq!(bench.control.state(), DriveState::SwitchOnDisabled);
    // The state is reported once more.
    assert_eq!(bench.states, [DriveState::NotReadyToSwitchOn, DriveState::SwitchOnDisabled]);
}

#[test]
fn a_restarted_leg_discards_the_zeros_of_homing() {
    let mut bench = Bench::enabled();
    let position = |bench: &Bench| bench.status.expect("a report").joints.map(|joint| joint.position.0);
    let hold = commanded();
    bench.order(Some(hold), None);
    bench.run(10);
    let before = position(&bench);
    let target = crate::leg::Target::Homing { offset: crate::units::Radian(0.3) };
    // The request comes once the joints are in their mode.
    for request_count in [0, 1] {
        bench.order(Some(hold.map(|command| JointCommand { target, request_count, ..command })), None);
        bench.run(10);
    }
    // The zero is shifted by whole counts, 15 microradians each.
    assert!(position(&bench).iter().all(|position| (position - 0.3).abs() < 1e-4), "{:?}", position(&bench));
    bench.signals.end_servo();
    bench.tick();
    bench.signals.begin_servo();
    bench.order(Some(hold), None);
    bench.run(10);
    for (after, before) in position(&bench).into_iter().zip(before) {
        assert!((after - before).abs() < 1e-6, "{after} {before}");
    }
}

#[test]
fn findings_reach_control_one_per_tick() {
    let mut bench = Bench::begun();
    let change = |since_s| {
        let change = crate::leg::Change { since_s, joints: [true; 2], statistic: [1.0; 2], limit: 0.5 };
        Finding::Changed(change)
    };
    for since_s in [1.0, 2.0] {
        assert!(bench.ends.identification.findings.enqueue(change(since_s)).is_ok());
    }
    let seen = [1, 2].map(|_| {
        bench.tick();
        bench.control.change().map(|change| change.since_s)
    });
    assert_eq!(seen, [Some(1.0), Some(2.0)]);
}

#[test]
fn the_start_button_begins_nothing_while_a_host_has_the_drive() {
    for hosted in [false, true] {
        let mut bench = Bench::enabled();
        bench.order(hosted.then(commanded), None);
        bench.run(2);
        bench.clear();
        bench.ask(ControlRequest::Identify);
        bench.tick();
        let accepted = picked!(bench.events, LegEvent::Record(Record::Request { accepted, .. }) => *accepted);
        assert!(accepted.eq([!hosted]), "{hosted}");
        assert_eq!(bench.control.activity().is_identifying(), !hosted);
    }
}

#[test]
fn only_requests_that_turn_off_pass_while_inhibited() {
    let mut bench = Bench::enabled();
    bench.signals.inhibit.raise(InhibitReason::EmergencyStop);
    bench.tick();
    let state = DriveState::Fault { fault: Fault { code: FaultCode::EmergencyStop, joint: 0 } };
    assert_eq!((bench.control.state(), bench.signals.target(0).enabled), (state, false));
    for request in [PowerRequest::Shutdown, PowerRequest::ResetFault] {
        bench.ask(ControlRequest::Power(request));
        bench.tick();
        assert_eq!(bench.control.state(), state);
    }
    bench.signals.inhibit.reset();
    bench.ask(ControlRequest::Power(PowerRequest::ResetFault));
    bench.tick();
    assert_eq!(bench.control.state(), DriveState::SwitchOnDisabled);
    // A flash write that was asked for is no fault.
    let mut bench = Bench::enabled();
    bench.signals.inhibit.raise(InhibitReason::Storing);
    bench.tick();
    assert_eq!(bench.control.state(), DriveState::SwitchOnDisabled);
}
