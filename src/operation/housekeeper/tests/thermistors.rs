//! Thermistors of the motors.

use super::*;
use crate::safety::thermistor::tests::THERMISTOR;
use crate::safety::{BoardFault, FaultCode};

/// Rounds between two checks of the temperatures.
const CHECK: u32 = RATE_HZ / 20;
/// Codes of the thermistor at 90.7 and 20 degrees, of a partial short (188 degrees), and of an open wire.
const HOT: u16 = 1125;
const COLD: u16 = 3215;
const PARTIAL: u16 = 200;
const BROKEN: u16 = 4095;

/// Two motors with thermistors, their windings at 40 degrees; readings have begun.
fn fitted(thermistors: [Option<Thermistor>; 2]) -> Bench {
    let settings = HousekeepingSettings { thermistors, ..HOUSEKEEPING };
    let mut bench = Bench::new(Housekeeper::new(settings).with_windings([40.0; 2]));
    bench.hardware.motor_codes = [Some(COLD); 2];
    check(&mut bench, 12);
    (0..2).for_each(|axis| drop(bench.signals.take_reported(axis)));
    bench
}

fn check(bench: &mut Bench, times: u32) {
    for _ in 0..times * CHECK {
        bench.round();
    }
}

/// Readings of an axis with these codes; each motor's turn comes every other check.
fn read(bench: &mut Bench, axis: usize, codes: &[Option<u16>]) {
    for code in codes {
        bench.hardware.motor_codes[axis] = *code;
        check(bench, 2);
    }
}

/// Heats the thermistor of an axis to a code within the permitted steps.
fn heat(bench: &mut Bench, axis: usize, to: u16) {
    for code in (to..COLD).rev().step_by(5) {
        read(bench, axis, &[Some(code)]);
    }
    read(bench, axis, &[Some(to); 60]);
}

#[test]
fn a_hotter_thermistor_warms_its_winding_and_a_colder_one_does_not_cool_it() {
    let mut bench = fitted([Some(THERMISTOR); 2]);
    assert!((39.0..=40.0).contains(&bench.signals.winding_c(1)), "{}", bench.signals.winding_c(1));
    heat(&mut bench, 1, HOT);
    assert!((90.4..90.9).contains(&bench.signals.winding_c(1)), "{}", bench.signals.winding_c(1));
    assert!(bench.signals.winding_share(1) < 1.0 && bench.signals.winding_share(0) == 1.0);
    assert!(bench.signals.winding_c(0) <= 40.0);
    assert!((0..2).all(|axis| bench.signals.take_reported(axis).eq([])));
}

#[test]
fn noise_does_not_heat_the_model() {
    let mut bench = fitted([Some(THERMISTOR); 2]);
    heat(&mut bench, 0, HOT);
    let mut random = TestRandom::new(1);
    let mut hottest = f32::MIN;
    for _ in 0..3000 {
        // 30 codes are 1.5 K here.
        let noise = (0..12).map(|_| random.within(15.0)).sum::<f64>();
        read(&mut bench, 0, &[Some((f64::from(HOT) + noise) as u16)]);
        hottest = hottest.max(bench.signals.winding_c(0));
    }
    assert!((90.5..92.9).contains(&hottest), "{hottest}");
}

#[test]
fn a_winding_at_its_limit_by_the_thermistor_is_a_fault() {
    let mut bench = fitted([Some(THERMISTOR); 2]);
    // 929 ohm: 102.4 degrees.
    heat(&mut bench, 0, 900);
    assert!(bench.signals.take_reported(0).eq([BoardFault::Winding]));
    assert!(bench.signals.take_reported(1).eq([]));
}

#[test]
fn three_bad_readings_in_a_row_are_the_fault_of_their_joint_and_no_heat() {
    for (code, axis) in [(Some(BROKEN), 0), (Some(0), 1), (None, 1), (Some(PARTIAL), 0)] {
        let mut bench = fitted([Some(THERMISTOR); 2]);
        for _ in 0..4 {
            read(&mut bench, axis, &[code; 2]);
            read(&mut bench, axis, &[Some(COLD); 8]);
        }
        assert!(bench.signals.take_reported(axis).eq([]), "{code:?}");
        read(&mut bench, axis, &[code; 4]);
        assert!(bench.signals.take_reported(axis).eq([BoardFault::MotorThermistor]), "{code:?}");
        assert!(bench.signals.take_reported(1 - axis).eq([]), "{code:?}");
        assert!(bench.signals.winding_c(axis) <= 40.0, "{code:?}");
        assert_eq!(BoardFault::MotorThermistor.code(), FaultCode::MotorThermistor);
    }
}

#[test]
fn a_step_within_the_range_is_bad_and_so_is_a_temperature_far_above_the_limit() {
    let mut bench = fitted([Some(THERMISTOR); 2]);
    // 2.98 kOhm: 60 degrees.
    read(&mut bench, 0, &[Some(1944); 4]);
    assert!(bench.signals.take_reported(0).eq([BoardFault::MotorThermistor]));
    assert!(bench.signals.winding_c(0) <= 40.0);
    let mut bench = fitted([Some(THERMISTOR); 2]);
    // 522 ohm: 128 degrees.
    heat(&mut bench, 0, 560);
    assert!(bench.signals.take_reported(0).any(|fault| fault == BoardFault::MotorThermistor));
    assert!(bench.signals.winding_c(0) <= 120.0, "{}", bench.signals.winding_c(0));
}

#[test]
fn a_wire_with_every_other_reading_bad_is_a_fault_and_its_good_readings_count() {
    let mut bench = fitted([Some(THERMISTOR); 2]);
    read(&mut bench, 1, &[None, Some(COLD), None, Some(COLD), None, Some(COLD)]);
    assert!(bench.signals.take_reported(1).eq([]));
    read(&mut bench, 1, &[None, Some(COLD)]);
    assert!(bench.signals.take_reported(1).eq([BoardFault::MotorThermistor]));
    let mut bench = fitted([Some(THERMISTOR); 2]);
    heat(&mut bench, 1, 1300);
    let before = bench.signals.winding_c(1);
    for _ in 0..40 {
        read(&mut bench, 1, &[None, Some(HOT)]);
    }
    assert!(bench.signals.winding_c(1) > before + 5.0, "{before}");
}

#[test]
fn a_motor_without_a_thermistor_is_not_converted() {
    let mut bench = fitted([None; 2]);
    check(&mut bench, 8);
    assert_eq!(bench.hardware.converted, None);
    let mut bench = fitted([None, Some(THERMISTOR)]);
    bench.hardware.motor_codes = [None, Some(COLD)];
    check(&mut bench, 4);
    assert_eq!(bench.hardware.converted, Some((1, Some(COLD))));
    assert!(bench.signals.take_reported(0).eq([]));
}
