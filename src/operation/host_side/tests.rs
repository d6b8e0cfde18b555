use std::collections::VecDeque;

use super::super::BusEnds;
use super::super::testing::{self, TestHardware, commanded, on_a_bus};
use super::*;
use crate::bus::device::LegOrder;
use crate::hal::{Contacts, JointSample};
use crate::leg::testing::{LEG, configuration, model};
use crate::leg::{Cause, Change, FaultCode, Finding, Verdict};
use crate::safety::{Refusal, RefusalReason};
use crate::testing::TestRandom;

struct Bench {
    side: HostSide<2>,
    host: HostEnds<'static, 2>,
    bus: BusEnds<'static, 2>,
    hardware: TestHardware<2>,
    signals: Signals<2>,
    /// Orders that the bus has not sent yet.
    orders: VecDeque<LegOrder<2>>,
    /// Reports that the bus took.
    status: Vec<LegStatus<2>>,
    /// The bus takes no report.
    busy: bool,
}

impl Bench {
    /// The operator holds the enabling switch.
    fn new(orders: &[LegOrder<2>]) -> Self {
        let (hardware, host, bus) = on_a_bus();
        let mut bench = Self {
            side: HostSide::new(Following::new(&configuration()), Volt(0.01)),
            host,
            bus,
            hardware,
            signals: Signals::new(),
            orders: orders.iter().copied().collect(),
            status: Vec::new(),
            busy: false,
        };
        bench.hold([true; 2]);
        bench
    }

    /// Enabling contact, and the operator's permission as the housekeeping sees it.
    fn hold(&mut self, [enabling, permits]: [bool; 2]) {
        self.hardware.contacts = Contacts { enabling, start: false };
        self.signals.set_permits(permits);
    }

    /// The bus sends its next order when the queue is free, as its round does.
    fn give(&mut self) {
        if self.bus.orders.ready()
            && let Some(order) = self.orders.pop_front()
        {
            let _ = self.bus.orders.enqueue(order);
        }
    }

    /// Orders that the servo did not take.
    fn waiting(&self) -> usize {
        self.orders.len() + usize::from(!self.bus.orders.ready())
    }

    fn receive(&mut self, report: impl FnMut(Fault)) {
        self.give();
        self.side.receive(&mut self.host, report);
    }

    fn held(&self, request: Option<ControlRequest>, state: DriveState) -> Option<ControlRequest> {
        self.side.held(request, state, &self.signals, &self.hardware)
    }

    /// Commands, and whether the identification is cancelled.
    fn commands(&mut self) -> Option<([JointCommand; 2], bool)> {
        let host = self.side.host(false);
        host.commands.map(|commands| (*commands, host.cancel))
    }

    fn report(&mut self, control: &Control<2>, output: &ControlOutput<2>) {
        let Self { side, host, hardware, signals, .. } = self;
        side.report(control, &SAMPLE, output, host, signals, hardware);
        self.take_report();
    }

    fn rest(&mut self) {
        let drive = DriveState::NotReadyToSwitchOn;
        self.side.rest(drive, &mut self.host, &self.signals, &mut self.hardware);
        self.take_report();
    }

    fn take_report(&mut self) {
        if !self.busy
            && let Some(status) = self.bus.status.dequeue()
        {
            self.status.push(status);
        }
    }
}

/// Both joints within their ranges.
const SAMPLE: Sample<2> = Sample {
    joints: [JointSample { encoder_counts: 30_000, current: crate::units::Ampere::ZERO, doubtful: false }; 2],
};

fn order(request: Option<LegRequest>) -> LegOrder<2> {
    testing::order(Some(commanded()), request)
}

const UP: PowerRequest = PowerRequest::EnableOperation;
const ENABLE: LegRequest = LegRequest::Power(UP);

fn unreported(_: Fault) {
    panic!("no fault")
}

#[test]
fn a_request_waits_behind_the_operators_and_none_is_lost() {
    let prepared = Prepared { plan: Plan::Sequential, seed: 7, wearing: Some(Wearing::Worn) };
    let Prepared { plan, seed, wearing } = prepared;
    let identify = LegRequest::Identify { plan, seed, wearing };
    let mut bench =
        Bench::new(&[order(Some(ENABLE)), order(Some(identify)), order(Some(LegRequest::TakeUpdate))]);
    let stop = ControlRequest::Power(PowerRequest::QuickStop);
    for _ in 0..3 {
        bench.receive(unreported);
        // The operator's request comes first and begins without a host's plan.
        assert_eq!(bench.side.request(Some(stop)), Some((stop, None)));
        assert_eq!(bench.waiting(), 2);
    }
    let expected = [
        (ControlRequest::Power(UP), None),
        (ControlRequest::Identify, Some(prepared)),
        (ControlRequest::TakeUpdate, None),
    ];
    for expected in expected {
        bench.receive(unreported);
        assert_eq!(bench.side.request(None), Some(expected));
        assert_eq!(bench.side.request(None), None, "once");
    }
}

#[test]
fn the_newest_commands_count_and_a_cancel_passes_once() {
    let fault = LegOrder { faults: [None, Some(FaultCode::Heartbeat)], ..order(None) };
    let mut bench = Bench::new(&[order(Some(LegRequest::Cancel)), fault]);
    assert!(bench.commands().is_none());
    let mut reported = Vec::new();
    (0..2).for_each(|_| bench.receive(|fault| reported.push(fault)));
    assert_eq!(reported, [Fault { code: FaultCode::Heartbeat, joint: 1 }]);
    let commands = commanded();
    assert_eq!(bench.commands(), Some((commands, true)));
    assert_eq!(bench.commands(), Some((commands, false)));
    // A host that no longer has the drive commands nothing.
    bench.orders.push_back(LegOrder { commands: None, ..order(None) });
    bench.receive(unreported);
    assert_eq!(bench.commands(), None);
}

#[test]
fn an_open_switch_blocks_enabling_and_stops_an_enabled_leg() {
    let mut bench = Bench::new(&[]);
    let (up, stop, off) =
        [UP, PowerRequest::QuickStop, PowerRequest::DisableVoltage].map(ControlRequest::Power).into();
    let states = [DriveState::SwitchOnDisabled, DriveState::SwitchedOn, DriveState::OperationEnabled];
    for request in [None, Some(up), Some(off), Some(ControlRequest::Identify)] {
        for state in states {
            assert_eq!(bench.held(request, state), request);
        }
    }
    // The contact counts at once; the housekeeping's permission is debounced.
    for open in [[false, true], [true, false], [false; 2]] {
        bench.hold(open);
        for state in states {
            let enabled = state == DriveState::OperationEnabled;
            let enabling = [up, ControlRequest::Identify, ControlRequest::TakeUpdate].map(Some);
            for turned_away in [None].into_iter().chain(enabling) {
                assert_eq!(bench.held(turned_away, state), enabled.then_some(stop), "{state:?}");
            }
            // A step that disables passes.
            assert_eq!(bench.held(Some(off), state), Some(off));
        }
    }
}

#[test]
fn the_bus_gets_a_report_every_second_tick_once_it_is_free() {
    let mut bench = Bench::new(&[]);
    let mut control = Control::new(&configuration()).expect("a leg");
    let plain = control.tick(&SAMPLE, None, LEG.gravity, None);
    let mut refused = plain;
    refused.servo.decision.refused = Some(Refusal { joint: 0, reason: RefusalReason::Moving });
    // The bus has not read the previous report.
    bench.busy = true;
    (0..2).for_each(|_| bench.report(&control, &plain));
    // A power request was refused in between.
    (0..4).for_each(|tick| bench.report(&control, if tick == 1 { &refused } else { &plain }));
    assert_eq!((bench.hardware.bus_pended, bench.status.len()), (3, 0));
    bench.busy = false;
    bench.take_report();
    bench.status.clear();
    let change = Change { since_s: 1.0, joints: [true; 2], statistic: [1.0; 2], limit: 0.5 };
    assert!(!control.receive(Finding::Changed(change)));
    let (cause, verdict) = (Cause::Friction, Verdict::ACCEPTED);
    assert!(!control.receive(Finding::Updated { cause, verdict, model: Some(model()) }));
    (0..4).for_each(|_| bench.report(&control, &plain));
    let status = bench.status.iter();
    let status = status.map(|status| (status.refused.is_some(), status.blocked, status.held, status.change));
    assert!(status.eq([(true, false, true, [true; 2]), (false, false, true, [true; 2])]));
    assert_eq!(bench.hardware.bus_pended, 5);
}

#[test]
fn a_report_contains_the_switch_and_the_inhibit_reasons() {
    let mut control = Control::new(&configuration()).expect("a leg");
    let output = control.tick(&SAMPLE, None, LEG.gravity, None);
    for (switch, blocked) in [([true; 2], false), ([false, true], false), ([true; 2], true)] {
        let mut bench = Bench::new(&[]);
        bench.hold(switch);
        if blocked {
            bench.signals.inhibit.raise(crate::safety::InhibitReason::GateFault);
        }
        (0..2).for_each(|_| bench.report(&control, &output));
        let status = bench.status[0];
        assert_eq!((status.held, status.blocked, status.rests), (switch == [true; 2], blocked, false));
        (0..2).for_each(|_| bench.rest());
        let causes = if blocked { crate::safety::InhibitReason::GateFault.bit() } else { 0 };
        let held = status.held;
        assert_eq!(bench.status[1], LegStatus { held, blocked, causes, ..LegStatus::NONE });
    }
}

#[test]
fn requests_to_a_leg_without_zeros_are_dropped() {
    let mut bench = Bench::new(&[order(Some(ENABLE))]);
    bench.receive(unreported);
    bench.orders.extend([order(Some(ENABLE)), order(Some(LegRequest::Cancel))]);
    bench.signals.inhibit.raise(crate::safety::InhibitReason::EmergencyStop);
    bench.hold([false; 2]);
    for _ in 0..2 {
        bench.give();
        bench.rest();
    }
    assert_eq!((bench.waiting(), bench.status.len()), (0, 1));
    let causes = crate::safety::InhibitReason::EmergencyStop.bit();
    assert_eq!(bench.status[0], LegStatus { causes, ..LegStatus::NONE });
    bench.receive(unreported);
    assert_eq!((bench.side.request(None), bench.commands()), (None, None));
}

#[test]
fn a_host_without_the_drive_cancels_by_a_quick_stop() {
    let mut bench = Bench::new(&[LegOrder { commands: None, ..order(Some(LegRequest::Cancel)) }]);
    bench.receive(unreported);
    assert_eq!(bench.commands(), None);
    assert_eq!(bench.side.request(None), Some((ControlRequest::Power(PowerRequest::QuickStop), None)));
    assert_eq!(bench.side.request(None), None, "once");
}

#[test]
fn a_bridge_reports_torque_smoothed_and_only_while_switching() {
    let mut control = Control::new(&configuration()).expect("a leg");
    let mut output = control.tick(&SAMPLE, None, LEG.gravity, None);
    let mut bench = Bench::new(&[]);
    bench.signals.statistics.see_bus(2400);
    let mut status = |state: DriveState, ticks: u32| {
        output.servo.decision.state = state;
        let mut random = TestRandom::new(1);
        let mut most = 0.0_f32;
        for tick in 0..ticks {
            // Noise of 3 A around 10 A.
            let current = 10.0 + random.within(3.0) as f32;
            let joint = JointSample { current: crate::units::Ampere(current), ..SAMPLE.joints[0] };
            let Bench { side, host, hardware, signals, .. } = &mut bench;
            side.report(&control, &Sample { joints: [joint; 2] }, &output, host, signals, hardware);
            if let Some(status) = bench.bus.status.dequeue()
                && tick + 100 > ticks
            {
                assert_eq!(status.joints[1].bus, Volt(24.0));
                most = most.max((status.joints[0].torque.0 - 15.0).abs());
            }
        }
        most
    };
    // 1.5 N m/A.
    assert_eq!(status(DriveState::SwitchOnDisabled, 200), 15.0);
    let noise = status(DriveState::OperationEnabled, 400);
    assert!(noise < 2.3, "{noise}, of 4.5 N m");
    assert_eq!(status(DriveState::SwitchedOn, 200), 15.0);
}
