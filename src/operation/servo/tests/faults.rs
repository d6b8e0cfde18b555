//! Faults reported by other levels, in memory, and of the supply.

use super::*;
use crate::safety::Bridges;
use crate::units::Ohm;

#[test]
fn changed_gains_or_limits_are_a_fault_within_64_ms() {
    let mut bench = Bench::enabled();
    bench.run(600);
    assert_eq!(bench.fault(), None);
    // The level has the checksum of another limit, as if the limit in memory had changed.
    let mut other = configuration();
    other.joints[1].torque.0 += 1e-5;
    let other = Control::new(&other).expect("a leg");
    let mut bench = Bench::begun();
    bench.level = ServoLevel::new(&other, RAMPS, VOLT_PER_CODE, None);
    bench.ends.servo.host = None;
    bench.enable();
    bench.run(255 - bench.level.tick);
    assert_eq!(bench.fault(), None);
    bench.tick();
    assert_eq!(bench.fault(), Some(Fault { code: FaultCode::Parameters, joint: 0 }));
    assert_eq!(bench.signals.permission(), Permission::Off);
}

#[test]
fn a_failing_supply_is_a_fault_after_four_ticks() {
    let mut bench = Bench::enabled();
    bench.run(40);
    bench.set_bus(Volt(0.75 * 48.0));
    bench.run(3);
    assert_eq!(bench.fault(), None);
    bench.tick();
    assert_eq!(bench.fault(), Some(Fault { code: FaultCode::SupplyLost, joint: 0 }));
    assert_eq!(bench.signals.permission(), Permission::Damp);
}

/// A leg with limits of the supply current whose axes take these powers, W.
fn supplied(powers_w: [f32; 2], seconds: f32) -> Bench {
    let mut bench = Bench::enabled();
    let limits = SupplyLimits { draw: Some(Ampere(10.0)), charge: Some(Ampere(4.0)), brake: Ohm(2.0) };
    bench.level = bench.level.with_supply(limits);
    for (axis, power) in powers_w.into_iter().enumerate() {
        bench.signals.set_power(axis, power);
    }
    bench.run((seconds * SERVO_RATE_HZ as f32) as u32);
    bench
}

#[test]
fn too_much_current_from_the_supply_damps_the_leg() {
    let bench = supplied([400.0, 240.0], 0.19);
    assert_eq!((bench.fault(), bench.level.supply_shares()[1]), (None, 1.0));
    assert!(bench.level.supply_shares()[0] < 0.1, "{:?}", bench.level.supply_shares());
    let bench = supplied([400.0, 240.0], 0.22);
    assert_eq!(bench.fault(), Some(Fault { code: FaultCode::SupplyCurrent, joint: 0 }));
    assert_eq!((bench.signals.permission(), bench.signals.inhibit.causes()), (Permission::Damp, 0));
    // One joint returns what the other takes.
    assert_eq!(supplied([640.0, -600.0], 0.5).fault(), None);
}

#[test]
fn too_much_current_into_the_supply_shorts_the_motors() {
    let bench = supplied([-100.0, -200.0], 0.19);
    assert_eq!((bench.fault(), bench.level.supply_shares()[0]), (None, 1.0));
    // 6.25 A, less three quarters of the limit, times 2 ohm over 48 V.
    assert!((bench.signals.wanted_brake() - 0.135).abs() < 1e-3, "{}", bench.signals.wanted_brake());
    let mut bench = supplied([-100.0, -200.0], 0.22);
    assert_eq!(bench.fault(), Some(Fault { code: FaultCode::ChargeCurrent, joint: 0 }));
    assert_eq!(Bridges::from_causes(bench.signals.inhibit.causes()), Bridges::Brake);
    assert_eq!(bench.signals.permission(), Permission::Off);
    // Shorted motors take nothing from the bus, whatever the axes last published.
    bench.run(100);
    assert_eq!(bench.signals.wanted_brake(), 0.0);
    // A resistor that takes the current keeps the leg enabled.
    let mut bench = supplied([-100.0, -200.0], 0.05);
    bench.signals.set_given_brake(bench.signals.wanted_brake());
    bench.run(4000);
    assert_eq!(bench.fault(), None);
    bench.signals.end_servo();
    bench.tick();
    assert_eq!(bench.signals.wanted_brake(), 0.0, "without a servo the resistor stays off");
}

#[test]
fn a_lost_host_is_the_fault_of_its_joint() {
    let mut bench = Bench::enabled();
    let faults = [None, Some(FaultCode::Heartbeat)];
    assert!(bench.bus.orders.enqueue(LegOrder { faults, ..order(None, None) }).is_ok());
    bench.tick();
    assert_eq!(bench.fault(), Some(Fault { code: FaultCode::Heartbeat, joint: 1 }));
}
