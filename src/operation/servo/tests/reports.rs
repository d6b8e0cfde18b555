//! Events of the servo and their order.

use super::super::super::queues::RESERVED;
use super::*;
use crate::leg::LimitCode;
use crate::leg::Plan;
use crate::safety::Winding;
use crate::safety::winding::tests::RATING;

/// Tick, code and joint of every reported limit.
fn limits(bench: &Bench) -> Vec<(u32, u8, u8)> {
    let limits = picked!(
        bench.events,
        LegEvent::Record(Record::Limit { tick, code, joint, .. }) => (*tick, *code, *joint)
    );
    limits.collect()
}

#[test]
fn limits_are_reported_once_a_second_and_one_per_tick() {
    let mut bench = Bench::enabled();
    // Derating leaves no torque to draw the joints back to their start.
    bench.signals.set_bridge_c(0, 100.0);
    for _ in 0..60 {
        bench.counts = bench.counts.map(|counts| counts + 1);
        bench.tick();
    }
    bench.run(8100 - bench.level.tick);
    let limits = limits(&bench);
    assert!(limits.iter().all(|(_, code, _)| *code == LimitCode::Temperature as u8), "{limits:?}");
    assert!(limits[0].0 < limits[1].0 && limits[1].0 < 100, "{limits:?}");
    let later = limits[2..].iter().map(|(tick, _, joint)| (*tick, *joint));
    assert!(later.eq([(4000, 1), (4001, 2), (8000, 1), (8001, 2)]), "{limits:?}");
    // A cool leg reports no limit.
    let mut bench = Bench::enabled();
    bench.counts = bench.counts.map(|counts| counts + 10);
    bench.run(100);
    assert!(!bench.names().contains(&"limit"));
}

/// Limits reported, code and joint, and current targets after a small move of both joints.
fn after_a_move(change: impl Fn(&Signals<2>)) -> (Vec<(u8, u8)>, [f32; 2]) {
    let mut bench = Bench::enabled();
    change(&bench.signals);
    for _ in 0..20 {
        bench.counts = bench.counts.map(|counts| counts + 1);
        bench.tick();
    }
    let limits = limits(&bench).iter().map(|(_, code, joint)| (*code, *joint)).collect();
    (limits, [0, 1].map(|joint| bench.signals.target(joint).current.0))
}

#[test]
fn a_hot_winding_limits_its_own_joint() {
    let hot = Winding::new(RATING, Some(RATING.limit_c));
    let (limits, targets) = after_a_move(|signals| signals.set_winding(1, &hot));
    assert_eq!(limits, [(LimitCode::Winding as u8, 2)]);
    assert!(targets[0] != 0.0 && targets[1] == 0.0, "{targets:?}");
}

#[test]
fn an_unproven_rotor_angle_leaves_a_quarter_of_its_joints_torque() {
    let quarter = 0.25 * LEG.joints[0].current.0;
    let (limits, limited) = after_a_move(|signals| signals.set_current_share(0, 0.25));
    assert_eq!(limits, [(LimitCode::FirstMotion as u8, 1)]);
    let (none, whole) = after_a_move(|signals| signals.set_current_share(0, 1.0));
    assert_eq!(none, []);
    assert!((limited[0].abs() - quarter).abs() < 0.1, "{limited:?}");
    assert!(whole[0].abs() > quarter + 1.0 && (limited[1] - whole[1]).abs() < 0.1, "{limited:?} {whole:?}");
}

#[test]
fn a_fault_is_recorded_before_the_state_that_follows() {
    let mut bench = Bench::enabled();
    bench.signals.report(BoardFault::Thermistor, 1);
    bench.tick();
    assert_eq!(bench.names(), ["fault", "state"]);
    let code = FaultCode::Thermistor.number();
    let tick = bench.level.tick;
    let expected = Record::Fault { tick, code, name: FaultCode::Thermistor.name(), joint: 2 };
    assert!(bench.events.contains(&LegEvent::Record(expected)));
    assert_eq!(bench.states, [bench.control.state()]);
    // Once.
    bench.tick();
    assert_eq!(bench.names(), ["fault", "state"]);
}

#[test]
fn a_refusal_by_the_bus_is_recorded_once_with_and_without_zeros_of_the_joints() {
    use crate::safety::{Refusal, RefusalReason};
    for mut bench in [Bench::resting(), Bench::begun()] {
        bench.tick();
        bench.clear();
        let refused = Some(Refusal { joint: Refusal::LEG, reason: RefusalReason::NoReference });
        assert!(bench.bus.orders.enqueue(LegOrder { refused, ..order(None, None) }).is_ok(), "full");
        bench.run(3);
        assert_eq!(bench.names(), ["not enabled"]);
        let record =
            |event: &LegEvent<2>| matches!(event, LegEvent::Record(Record::NotEnabled { joint: 0, .. }));
        assert!(bench.events.iter().any(record));
    }
}

#[test]
fn samples_leave_space_for_other_events() {
    let mut bench = Bench::enabled();
    bench.is_received = false;
    bench.run(2000);
    let statistics = &bench.signals.statistics;
    let room = bench.ends.servo.events.capacity() - RESERVED;
    assert_eq!((bench.ends.servo.events.len(), statistics.records_lost.get()), (room, 0));
    assert_eq!(statistics.samples_lost.get() as usize, 2000 / 8 - room);
    bench.signals.report(BoardFault::Temperature, 0);
    bench.tick();
    assert_eq!(bench.ends.servo.events.len(), room + 2);
    // Lost records are counted as well.
    for _ in 0..RESERVED {
        bench.ask(ControlRequest::Identify);
        bench.tick();
    }
    assert_eq!(bench.ends.servo.events.len(), room + RESERVED);
    assert_eq!(bench.signals.statistics.records_lost.get(), 2);
}

#[test]
fn an_identification_begins_with_the_requested_plan_and_seed() {
    let mut bench = Bench::enabled();
    bench.ask(ControlRequest::Identify);
    bench.tick();
    assert_eq!(bench.names(), ["request", "begun", "state", "activity"]);
    assert!(bench.events.contains(&LegEvent::Begun(None, None)));
    let mut bench = Bench::enabled();
    bench.order(None, Some(LegRequest::Identify { plan: Plan::Sequential, seed: 7, wearing: None }));
    bench.tick();
    assert!(bench.events.contains(&LegEvent::Begun(Some((Plan::Sequential, 7)), None)));
}

#[test]
fn a_refused_request_is_recorded_and_begins_nothing() {
    let mut bench = Bench::begun();
    bench.run(2);
    bench.clear();
    bench.ask(ControlRequest::Identify);
    bench.tick();
    let tick = bench.level.tick;
    let record = Record::Request { tick, name: "identify", accepted: false };
    assert_eq!(bench.events, [LegEvent::Record(record)]);
}

#[test]
fn every_sample_of_the_log_leaves_with_its_tick() {
    let mut bench = Bench::enabled();
    bench.run(80);
    let ticks = picked!(bench.events, LegEvent::Sample(logged) => logged.sample.tick);
    assert!(ticks.eq((1..=10).map(|sample| 8 * sample)));
}
