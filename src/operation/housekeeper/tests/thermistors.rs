//! Thermistors of the motors.

use super::*;
use crate::safety::thermistor::tests::THERMISTOR;
use crate::safety::{BoardFault, FaultCode};

/// Rounds between two checks of the temperatures.
const CHECK: u32 = RATE_HZ / 20;
/// Codes of the thermistor at 90, 91 and 20 degrees, and of an open wire.
const HOT: u16 = 1100;
const HOTTER: u16 = 1080;
const COLD: u16 = 3215;
const BROKEN: u16 = 4095;

/// Two motors with thermistors, their windings at 40 degrees.
fn fitted(thermistors: [Option<Thermistor>; 2]) -> Bench {
    let settings = HousekeepingSettings { thermistors, ..HOUSEKEEPING };
    let mut bench = Bench::new(Housekeeper::new(settings).with_windings([40.0; 2]));
    bench.hardware.motor_codes = [Some(COLD); 2];
    bench
}

fn check(bench: &mut Bench) {
    for _ in 0..CHECK {
        bench.round();
    }
}

#[test]
fn a_hotter_thermistor_warms_its_winding_and_a_colder_one_does_not_cool_it() {
    let mut bench = fitted([Some(THERMISTOR); 2]);
    (0..4).for_each(|_| check(&mut bench));
    assert!((39.0..=40.0).contains(&bench.signals.winding_c(1)), "{}", bench.signals.winding_c(1));
    bench.hardware.motor_codes[1] = Some(HOT);
    (0..5).for_each(|_| check(&mut bench));
    let expected = THERMISTOR.celsius(HOT).expect("readable");
    assert!((expected - bench.signals.winding_c(1)).abs() < 0.2, "{expected} {}", bench.signals.winding_c(1));
    assert!(bench.signals.winding_share(1) < 1.0 && bench.signals.winding_share(0) == 1.0);
    assert!(bench.signals.winding_c(0) <= 40.0);
}

#[test]
fn one_disturbed_reading_changes_nothing_and_of_two_the_lower_counts() {
    let mut bench = fitted([Some(THERMISTOR); 2]);
    (0..4).for_each(|_| check(&mut bench));
    let before = bench.signals.winding_c(0);
    bench.hardware.motor_codes[0] = Some(HOT);
    (0..2).for_each(|_| check(&mut bench));
    bench.hardware.motor_codes[0] = Some(COLD);
    (0..4).for_each(|_| check(&mut bench));
    assert!(bench.signals.winding_c(0) <= before);
    bench.hardware.motor_codes[0] = Some(HOTTER);
    (0..2).for_each(|_| check(&mut bench));
    bench.hardware.motor_codes[0] = Some(HOT);
    (0..2).for_each(|_| check(&mut bench));
    // The next round publishes it.
    bench.round();
    let (hot, hotter) = (THERMISTOR.celsius(HOT), THERMISTOR.celsius(HOTTER));
    let winding = bench.signals.winding_c(0);
    assert!(hot.is_some_and(|hot| (winding - hot).abs() < 0.2), "{winding}");
    assert!(hotter.is_some_and(|hotter| hotter > winding + 0.5), "{winding}");
}

#[test]
fn a_winding_at_its_limit_by_the_thermistor_is_a_fault() {
    let mut bench = fitted([Some(THERMISTOR); 2]);
    // 973 ohm: 102 degrees.
    bench.hardware.motor_codes[0] = Some(932);
    (0..6).for_each(|_| check(&mut bench));
    assert!(bench.signals.take_reported(0).eq([BoardFault::Winding]));
    assert!(bench.signals.take_reported(1).eq([]));
}

#[test]
fn three_unreadable_conversions_are_the_fault_of_their_joint() {
    for (code, axis) in [(Some(BROKEN), 0), (Some(0), 1), (None, 1)] {
        let mut bench = fitted([Some(THERMISTOR); 2]);
        (0..4).for_each(|_| check(&mut bench));
        bench.hardware.motor_codes[axis] = code;
        // Two readings: each motor's turn comes every other check.
        (0..4).for_each(|_| check(&mut bench));
        bench.hardware.motor_codes[axis] = Some(COLD);
        (0..2).for_each(|_| check(&mut bench));
        assert!(bench.signals.take_reported(axis).eq([]), "{code:?}");
        bench.hardware.motor_codes[axis] = code;
        (0..7).for_each(|_| check(&mut bench));
        assert!(bench.signals.take_reported(axis).eq([BoardFault::MotorThermistor]), "{code:?}");
        assert!(bench.signals.take_reported(1 - axis).eq([]), "{code:?}");
        assert_eq!(BoardFault::MotorThermistor.code(), FaultCode::MotorThermistor);
    }
}

#[test]
fn a_motor_without_a_thermistor_is_not_converted() {
    let mut bench = fitted([None; 2]);
    (0..8).for_each(|_| check(&mut bench));
    assert_eq!(bench.hardware.converted, None);
    let mut bench = fitted([None, Some(THERMISTOR)]);
    bench.hardware.motor_codes = [None, Some(HOT)];
    (0..4).for_each(|_| check(&mut bench));
    assert_eq!(bench.hardware.converted, Some(1));
    assert!(bench.signals.take_reported(0).eq([]) && bench.signals.winding_c(1) > 80.0);
}
