//! Absolute encoders at rotor and joint: power-up without turning and without reference, and contradictions.

use super::second_day::{Machine, second_day};
use super::*;
use crate::hal::AbsoluteEncoderSide;
use crate::motor::{AbsoluteAngle, Direction};
use crate::safety::BoardFault;

/// Axes with an absolute encoder at rotor and joint.
fn settings() -> HousekeepingSettings<2> {
    let axis = AxisConfiguration { index: false, absolute: true, ..CONFIGURATION };
    let absolute = AbsoluteEncoders { rotor: true, joint: Some(Direction::Up) };
    let encoders = HOUSEKEEPING.encoders.map(|encoders| EncoderSettings { absolute, ..encoders });
    HousekeepingSettings { axes: [axis; 2], encoders, ..HOUSEKEEPING }
}

/// Both motors of the first day after calibration and reference: the calibrations that would be stored, and
/// the motors' angles at the joints' zero.
fn first_day() -> ([Option<StoredCalibration>; 2], [f64; 2]) {
    let mut machine = Machine::with(settings(), second_day().0, [None; 2]);
    machine.hold(false, false, 0.1);
    machine.calibrate(45.0);
    assert_eq!(machine.results(), [(1, "done"), (2, "done")]);
    machine.hold(false, false, 0.1);
    let angles = machine.motors.each_ref().map(|motor| motor.angle);
    machine.reference();
    assert!(machine.signals.has_begun());
    (machine.offered, angles)
}

/// A board that starts again, with motors turned by these angles (rad) and counters that begin elsewhere.
fn restarted(turned: [f64; 2], stored: [Option<StoredCalibration>; 2], zeros: [f64; 2]) -> Machine {
    let mut motors = second_day().0;
    for axis in 0..2 {
        motors[axis].angle = zeros[axis] + turned[axis];
    }
    let mut machine = Machine::with(settings(), motors, stored);
    machine.counted = [12_345, 60_001];
    machine.hold(false, false, 0.1);
    machine
}

/// Axis faults recorded by the housekeeping.
fn faults(machine: &Machine) -> Vec<(u8, &'static str)> {
    picked!(machine.records, Record::AxisFault { joint, name, .. } => (*joint, *name)).collect()
}

#[test]
fn a_second_day_needs_neither_hand_nor_reference() {
    let (stored, zeros) = first_day();
    assert!(stored.iter().flatten().all(|stored| stored.joint_zero.is_some()));
    // Far from the zero, by whole motor turns and parts of one; 300 rad are 344 degrees of the joint.
    for turned in [[40.0, -61.7], [-3.3, 120.0]] {
        let mut machine = restarted(turned, stored, zeros);
        machine.calibrate(2.9);
        assert_eq!(machine.results(), [(1, "confirmed"), (2, "confirmed")]);
        machine.hold(true, false, 0.8);
        assert!(machine.signals.has_begun(), "no reference by the operator");
        machine.hold(true, false, 0.3);
        assert_ne!(machine.state(), DriveState::OperationEnabled, "this closing was for the calibration");
        for (axis, turned) in turned.into_iter().enumerate() {
            let counts = machine.signals.statistics.counts[axis].get().cast_signed();
            let expected = turned / core::f64::consts::TAU * 8192.0;
            // Friction lets the rotor rest a little apart, and the zero was that of the pose.
            assert!((f64::from(counts) - expected).abs() < 8.0, "{counts} {expected}");
        }
        assert_eq!(faults(&machine), []);
    }
}

#[test]
fn zeros_of_another_setting_or_before_a_load_are_not_used() {
    let (stored, zeros) = first_day();
    let begins = |settings: HousekeepingSettings<2>, stored, forgets: bool| {
        let mut motors = second_day().0;
        (0..2).for_each(|axis| motors[axis].angle = zeros[axis]);
        let mut machine = Machine::with(settings, motors, stored);
        if forgets {
            machine.signals.forget_stored();
        }
        machine.hold(false, false, 0.1);
        machine.calibrate(if forgets { 46.0 } else { 3.7 });
        (machine.results(), machine.signals.has_begun())
    };
    let confirmed = vec![(1, "confirmed"), (2, "confirmed")];
    assert_eq!(begins(settings(), stored, false), (confirmed.clone(), true));
    let mut other = settings();
    other.encoders[1].absolute.joint = Some(Direction::Down);
    assert_eq!(begins(other, stored, false), (confirmed.clone(), false));
    let mut other = settings();
    other.encoders[0].ratio = 49.0;
    assert_eq!(begins(other, stored, false), (confirmed, false));
    assert_eq!(begins(settings(), stored, true), (vec![(1, "done"), (2, "done")], false));
}

#[test]
fn an_offset_at_an_index_is_not_used_with_an_absolute_encoder() {
    let at_index = measured().stored().expect("an index");
    let mut machine = restarted([0.0; 2], [Some(at_index); 2], [0.3; 2]);
    machine.calibrate(3.0);
    // The motor turns.
    assert_eq!(machine.results(), []);
    assert!(machine.most_ampere > 10.0);
}

#[test]
fn a_joint_encoder_that_does_not_answer_delays_the_zero_and_refuses_a_stated_one() {
    let (stored, zeros) = first_day();
    let mut machine = restarted([40.0; 2], stored, zeros);
    machine.joint_steps[1] = None;
    machine.calibrate(3.7);
    assert!(!machine.signals.has_begun());
    machine.reference();
    assert!(!machine.signals.has_begun(), "its zero would be lost");
    machine.joint_steps[1] = Some(0);
    machine.hold(false, false, 0.7);
    assert!(machine.signals.has_begun(), "it answers again");
}

#[test]
fn a_gear_that_slipped_while_the_power_was_off_needs_a_reference() {
    let (stored, zeros) = first_day();
    // A third of a motor turn, 2.4 degrees of the joint.
    let mut machine = restarted([40.0; 2], stored, zeros);
    machine.joint_steps[1] = Some(16_384 / 150);
    machine.calibrate(3.7);
    assert_eq!(machine.results(), [(1, "confirmed"), (2, "confirmed")]);
    assert!(!machine.signals.has_begun());
    let refused =
        |record: &&Record<2>| matches!(record, Record::Request { name: "reference", accepted: false, .. });
    assert_eq!(machine.records.iter().filter(refused).count(), 1);
    // The operator states the pose.
    machine.reference();
    assert!(machine.signals.has_begun());
    let joint_zero = |stored: Option<StoredCalibration>| stored.and_then(|stored| stored.joint_zero);
    // The new zero is offered to the storage.
    assert_ne!(joint_zero(machine.offered[1]), joint_zero(stored[1]));
}

#[test]
fn encoders_that_contradict_each_other_brake_once_and_end_the_zero() {
    let (stored, zeros) = first_day();
    for (lost, steps, name) in
        [(24, 0, "absolute_encoder"), (0, 16_384 / 120, "joint_encoder"), (0, -16_384 / 120, "joint_encoder")]
    {
        let mut machine = restarted([40.0; 2], stored, zeros);
        machine.calibrate(3.7);
        assert!(machine.signals.has_begun());
        machine.counted[0] = machine.counted[0].wrapping_add(lost);
        machine.joint_steps[0] = Some(steps);
        machine.hold(true, false, 0.03);
        assert_eq!(faults(&machine), [(1, name), (1, "encoder")], "{lost} {steps}");
        assert!(!machine.signals.has_begun());
        machine.hold(true, false, 0.2);
        assert_eq!(faults(&machine).len(), 2, "recorded once");
    }
}

#[test]
fn a_contradiction_of_an_axis_that_is_off_makes_its_motor_turn_next() {
    let (stored, zeros) = first_day();
    for lost in [0, 24] {
        let mut machine = restarted([40.0; 2], stored, zeros);
        machine.counted[0] = machine.counted[0].wrapping_add(lost);
        machine.hold(false, false, 0.05);
        assert_eq!(faults(&machine).len(), usize::from(lost > 0));
        // Reset.
        machine.hold(false, true, 2.3);
        machine.hold(false, false, 0.3);
        machine.calibrate(3.0);
        let is_confirmed = machine.results().contains(&(1, "confirmed"));
        assert_eq!(is_confirmed, lost == 0, "{:?}", machine.results());
    }
}

#[test]
fn a_silent_encoder_is_reported_and_forbids_a_calibration() {
    for side in [AbsoluteEncoderSide::Rotor, AbsoluteEncoderSide::Joint] {
        let mut bench = Bench::new(Housekeeper::new(settings()));
        let valid = AbsoluteAngle::from_steps(77).to_frame();
        bench.hardware.encoder_frames = [[valid; 2]; 2];
        bench.signals.begin_servo();
        bench.hold(false, false);
        (0..2).for_each(|axis| bench.signals.take_reported(axis).for_each(drop));
        bench.hardware.encoder_frames[1][side as usize] = 0xFFFF;
        bench.hold(false, false);
        assert!(bench.signals.take_reported(0).next().is_none());
        assert!(bench.signals.take_reported(1).eq([BoardFault::AbsoluteEncoder]), "{side:?}");
    }
    let mut bench = Bench::new(Housekeeper::new(settings()));
    assert_eq!(bench.press(), []);
    let refused =
        |record: &Record<2>| matches!(record, Record::Calibration { result: "absolute_encoder", .. });
    assert!(bench.records.iter().any(refused));
}

#[test]
fn exchanged_lines_of_the_encoder_end_the_calibration_until_a_reset() {
    let mut machine = Machine::with(settings(), second_day().0, [None; 2]);
    // A and B exchanged, and motor leads as well, so that the counter runs with the field.
    for axis in &mut machine.keeper.settings.axes {
        axis.counter = Direction::Down;
    }
    for motor in &mut machine.motors {
        motor.encoder_sign = -1.0;
    }
    machine.is_spi_forward = true;
    machine.hold(false, false, 0.1);
    machine.calibrate(12.0);
    assert_eq!(faults(&machine), [(1, "absolute_encoder")]);
    assert_eq!(machine.results(), [(1, "interrupted")]);
    machine.hold(false, false, 0.1);
    machine.calibrate(0.1);
    assert_eq!(machine.results(), [(1, "interrupted"), (1, "absolute_encoder")]);
}
