//! The holding brake around enabling, stops and lost samples.

use super::*;
use crate::safety::BrakeDelays;

const DELAYS: BrakeDelays = BrakeDelays { release_ms: 20, engage_ms: 30 };
/// Ticks in which the brake opens, after the tick that enables.
const OPENING: u32 = 80;
/// Ticks in which the brake closes.
const CLOSING: usize = 120;

/// A leg with a brake, in the tick in which it was enabled.
fn braked() -> Bench {
    let mut bench = Bench::begun();
    bench.level = bench.level.with_holding_brake(Some(DELAYS));
    bench.enable();
    bench.clear();
    bench
}

/// A leg whose brake is open.
fn open() -> Bench {
    let mut bench = braked();
    bench.run(OPENING + 2);
    bench
}

fn activity(bench: &Bench) -> Activity {
    bench.control.activity()
}

#[test]
fn the_brake_is_released_once_the_bridges_switch() {
    let mut bench = braked();
    assert!(bench.signals.target(0).enabled && !bench.hardware.holding_brake_released);
    bench.tick();
    assert!(bench.hardware.holding_brake_released);
    // A leg without a brake does not touch the output.
    let mut bench = Bench::enabled();
    bench.run(10);
    assert!(!bench.hardware.holding_brake_released);
}

#[test]
fn an_identification_is_refused_until_the_brake_is_open() {
    let mut bench = braked();
    bench.run(OPENING);
    bench.ask(ControlRequest::Identify);
    bench.tick();
    assert_eq!(activity(&bench), Activity::Idle);
    let refused = Record::Request { tick: bench.level.tick, name: "identify", accepted: false };
    assert!(bench.events.contains(&LegEvent::Record(refused)), "{:?}", bench.events);
    assert!(!bench.names().contains(&"begun"));
    bench.tick();
    bench.ask(ControlRequest::Identify);
    bench.tick();
    assert!(matches!(activity(&bench), Activity::Identify(_)));
}

#[test]
fn commands_of_a_host_wait_until_the_brake_is_open() {
    let mut bench = braked();
    for _ in 0..=OPENING {
        bench.order(Some(commanded()), None);
        bench.tick();
        assert_eq!(activity(&bench), Activity::Idle);
    }
    bench.tick();
    assert_eq!(activity(&bench), Activity::Follow);
}

#[test]
fn the_brake_has_closed_when_a_released_switch_turns_the_bridges_off() {
    let mut bench = open();
    bench.hardware.contacts.enabling = false;
    let (mut damped, mut closing) = (0, 0);
    loop {
        bench.tick();
        if !bench.signals.target(0).enabled {
            break;
        }
        damped += 1;
        closing += usize::from(!bench.hardware.holding_brake_released);
    }
    assert_eq!((damped, closing), (1200, CLOSING));
    assert!(!bench.hardware.holding_brake_released);
}

#[test]
fn a_fault_that_turns_the_bridges_off_engages_the_brake_in_its_tick() {
    let mut bench = open();
    bench.control.report(Fault { code: FaultCode::Parameters, joint: 0 });
    bench.tick();
    assert_eq!((bench.signals.permission(), bench.hardware.holding_brake_released), (Permission::Off, false));
}

#[test]
fn a_leg_without_valid_samples_is_held_by_its_brake() {
    let mut bench = open();
    bench.signals.end_servo();
    bench.tick();
    assert!(!bench.hardware.holding_brake_released);
}

#[test]
fn a_stop_within_a_tick_leaves_the_brake_engaged() {
    let mut bench = open();
    // The stop comes after the tick has read the inhibit word.
    bench.hardware.disable_all();
    bench.signals.inhibit.raise(InhibitReason::EmergencyStop);
    bench.level.hold(DriveState::OperationEnabled, &bench.signals, &mut bench.hardware);
    assert!(!bench.hardware.holding_brake_released);
}
