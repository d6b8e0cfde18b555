//! Faults reported by other levels, in memory, and of the supply.

use super::*;

/// The fault for which the leg damps or is off.
fn fault(bench: &Bench) -> Option<Fault> {
    match bench.control.state() {
        DriveState::Fault { fault } | DriveState::FaultReactionActive { fault, .. } => Some(fault),
        _ => None,
    }
}

#[test]
fn a_fault_from_another_level_reaches_the_leg_with_its_joint() {
    for joint in 0..2 {
        for seen in BoardFault::ALL {
            let mut bench = Bench::enabled();
            bench.signals.report(seen, joint);
            bench.tick();
            assert_eq!(fault(&bench), Some(Fault { code: seen.code(), joint: joint as u8 }));
            assert_eq!(bench.signals.permission(), Permission::Damp);
        }
    }
}

#[test]
fn changed_gains_or_limits_are_a_fault_within_64_ms() {
    let mut bench = Bench::enabled();
    bench.run(600);
    assert_eq!(fault(&bench), None);
    // The level has the checksum of another limit, as if the limit in memory had changed.
    let mut other = configuration();
    other.joints[1].torque.0 += 1e-5;
    let other = Control::new(&other).expect("a leg");
    let mut bench = Bench::begun();
    bench.level = ServoLevel::new(&other, RAMPS, VOLT_PER_CODE, None);
    bench.ends.servo.host = None;
    bench.enable();
    bench.run(255 - bench.level.ticks());
    assert_eq!(fault(&bench), None);
    bench.tick();
    assert_eq!(fault(&bench), Some(Fault { code: FaultCode::Parameters, joint: 0 }));
    assert_eq!(bench.signals.permission(), Permission::Off);
}

#[test]
fn a_failing_supply_is_a_fault_after_four_ticks() {
    let mut bench = Bench::enabled();
    bench.run(40);
    bench.set_bus(Volt(0.75 * 48.0));
    bench.run(3);
    assert_eq!(fault(&bench), None);
    bench.tick();
    assert_eq!(fault(&bench), Some(Fault { code: FaultCode::SupplyLost, joint: 0 }));
    assert_eq!(bench.signals.permission(), Permission::Damp);
}

#[test]
fn a_lost_host_is_the_fault_of_its_joint() {
    let mut bench = Bench::enabled();
    let faults = [None, Some(FaultCode::Heartbeat)];
    let order = LegOrder { commands: None, request: None, faults, may_return: [true; 2], refused: None };
    assert!(bench.bus.orders.enqueue(order).is_ok());
    bench.tick();
    assert_eq!(fault(&bench), Some(Fault { code: FaultCode::Heartbeat, joint: 1 }));
}
