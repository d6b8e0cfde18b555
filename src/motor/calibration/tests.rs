extern crate std;

use super::*;
use crate::motor::testing::{CONFIGURATION, TestMotor};
use crate::motor::{Axis, AxisRequest};

const SETTINGS: CalibrationSettings =
    CalibrationSettings { current: Ampere(20.0), voltage: Volt(4.0), turns_per_s: 8.0 };

/// Runs a calibration to its end; no quadrature torque is ever allowed to run the rotor away.
fn run(motor: &mut TestMotor, mut calibrator: Calibrator) -> Result<Calibration, Refusal> {
    let mut sample = motor.sample();
    // Ten seconds.
    for _ in 0..240_000 {
        let command = match calibrator.tick(&sample) {
            CalibrationStep::Running(command) => command,
            CalibrationStep::Done(calibration) => return Ok(calibration),
            CalibrationStep::Refused(reason) => return Err(reason),
        };
        sample = motor.period(command);
    }
    panic!("no end");
}

pub(in crate::motor) fn calibrate(
    motor: &mut TestMotor,
    configuration: &AxisConfiguration,
) -> Result<Calibration, Refusal> {
    run(motor, Calibrator::new(configuration, SETTINGS).expect("usual"))
}

/// What is found against what is true, electrical degrees.
fn offset_error_deg(motor: &mut TestMotor, configuration: &AxisConfiguration, found: &Calibration) -> f64 {
    let scale = configuration.scale().expect("usual");
    let angle = found.angle_at(&scale, configuration.counter, motor.sample().encoder_count);
    let truth = motor.electrical() / core::f64::consts::TAU;
    let error = f64::from(angle.turns()) - truth;
    (error - error.round()) * 360.0
}

#[test]
fn a_sound_motor_is_measured_and_its_offset_found() {
    for (angle, direction) in [(0.3, 1.0), (2.0, -1.0), (-0.9, 1.0)] {
        let mut motor = TestMotor { angle, encoder_sign: direction, ..TestMotor::default() };
        let counter = if direction > 0.0 { Direction::Up } else { Direction::Down };
        let configuration = AxisConfiguration { counter, ..CONFIGURATION };
        let found = calibrate(&mut motor, &configuration).expect("sound");
        assert!((f64::from(found.resistance().0) / 0.05 - 1.0).abs() < 0.02, "{found:?}");
        assert!((f64::from(found.direct_inductance().0) / 24e-6 - 1.0).abs() < 0.02, "{found:?}");
        assert!((f64::from(found.quadrature_inductance().0) / 27e-6 - 1.0).abs() < 0.02, "{found:?}");
        let error = offset_error_deg(&mut motor, &configuration, &found);
        assert!(error.abs() < 1.0, "{error} degrees");
        assert!((f64::from(found.zeros()[0]) - 2060.3).abs() < 0.6, "{found:?}");
    }
}

#[test]
fn every_wrong_wiring_is_refused_with_its_own_reason() {
    type Change = fn(&mut TestMotor);
    let wirings: [(Change, Refusal); 11] = [
        (|motor| motor.shunts = |[b, c]| [c, b], Refusal::ShuntsSwapped),
        (|motor| motor.shunts = |[b, c]| [-b, c], Refusal::ShuntInverted(Phase::B)),
        (|motor| motor.shunts = |[b, c]| [b, -c], Refusal::ShuntInverted(Phase::C)),
        (|motor| motor.shunts = |[b, c]| [-b, -c], Refusal::ShuntsInverted),
        (|motor| motor.shunts = |[_, c]| [0.0, c], Refusal::PhaseOpen(Phase::B)),
        (|motor| motor.encoder_sign = -1.0, Refusal::Direction),
        (|motor| motor.encoder_dead = true, Refusal::NoCounts),
        (|motor| motor.pole_pairs = 11.0, Refusal::PolePairs(11)),
        (|motor| motor.zeros[1] = 400.0, Refusal::ShuntZero(Phase::C)),
        (|motor| motor.bus = 12.0, Refusal::BusVoltage),
        // 0.61 N m hold.
        (|motor| motor.coulomb = 0.54, Refusal::Slipped),
    ];
    for (change, reason) in wirings {
        let mut motor = TestMotor::default();
        change(&mut motor);
        assert_eq!(calibrate(&mut motor, &CONFIGURATION), Err(reason));
    }
    let configuration = AxisConfiguration { counts_per_turn: 10_000, index: false, ..CONFIGURATION };
    assert!(matches!(
        calibrate(&mut TestMotor::default(), &configuration),
        Err(Refusal::CountsPerTurn(8100..=8300))
    ));
}

#[test]
fn the_index_tells_counts_per_turn_from_pole_pairs() {
    let configuration = AxisConfiguration { counts_per_turn: 4096, ..CONFIGURATION };
    let refusals: std::vec::Vec<Refusal> = (0..7)
        .map(|turn| {
            // The way forwards is nine sevenths of a turn: from two of the seven places where the rotor may align it passes the
            // index twice.
            let encoder_zero = f64::from(turn) / 7.0 - 0.1;
            let mut motor = TestMotor { counts_per_turn: 2048.0, encoder_zero, ..TestMotor::default() };
            calibrate(&mut motor, &configuration).expect_err("half of the counts")
        })
        .collect();
    let told = refusals.iter().filter(|&&reason| reason == Refusal::CountsPerTurn(2048)).count();
    let mistaken = refusals.iter().filter(|&&reason| reason == Refusal::PolePairs(14)).count();
    assert_eq!((told, mistaken), (2, 5), "{refusals:?}");
}

#[test]
fn what_is_stored_is_found_again_by_the_index() {
    let mut motor = TestMotor::default();
    let first = calibrate(&mut motor, &CONFIGURATION).expect("sound");
    let stored = first.stored().expect("an index");
    // Power off: the counter forgets, the joint is moved.
    motor.angle += 11.0;
    motor.speed = 0.0;
    motor.encoder_zero += 3.0;
    let calibrator = Calibrator::from_stored(&CONFIGURATION, SETTINGS, stored).expect("usual");
    let second = run(&mut motor, calibrator).expect("sound");
    let error = offset_error_deg(&mut motor, &CONFIGURATION, &second);
    assert!(error.abs() < 1.0, "{error} degrees");
    assert_eq!(second.direct_inductance(), first.direct_inductance());

    let turned = StoredCalibration { offset: stored.offset.plus(ElectricalAngle::from_turns(0.3)), ..stored };
    let calibrator = Calibrator::from_stored(&CONFIGURATION, SETTINGS, turned).expect("usual");
    assert_eq!(run(&mut motor, calibrator), Err(Refusal::StoredOffset));
    let other = StoredCalibration { resistance: Ohm(0.1), ..stored };
    let calibrator = Calibrator::from_stored(&CONFIGURATION, SETTINGS, other).expect("usual");
    assert_eq!(run(&mut motor, calibrator), Err(Refusal::OtherMotor));
}

#[test]
fn an_axis_controls_the_motor_it_was_calibrated_on() {
    for (sign, counter) in [(1.0, Direction::Up), (-1.0, Direction::Down)] {
        for flexion in [Direction::Up, Direction::Down] {
            let mut motor = TestMotor { encoder_sign: sign, ..TestMotor::default() };
            let configuration = AxisConfiguration { counter, flexion, ..CONFIGURATION };
            let calibration = calibrate(&mut motor, &configuration).expect("sound");
            let mut sample = motor.sample();
            let mut axis = Axis::new(&configuration, &calibration, &sample).expect("usual");
            for _ in 0..2400 {
                let request = AxisRequest { enabled: true, current: Ampere(3.0) };
                sample = motor.period(axis.tick(&sample, request));
            }
            assert_eq!(axis.fault(), None);
            let joint = axis.joint_sample();
            // Positive current flexes: the counts grow with it, whatever the wiring; 0.1 s at some 340 rad/s^2.
            assert!((joint.current.0 - 3.0).abs() < 0.3, "{joint:?}");
            assert!(joint.encoder_counts > 500, "{joint:?}");
        }
    }
}

#[test]
fn settings_that_ask_for_too_much_are_refused() {
    let refused = |change: fn(&mut CalibrationSettings)| {
        let mut settings = SETTINGS;
        change(&mut settings);
        Calibrator::new(&CONFIGURATION, settings).expect_err("absurd")
    };
    assert_eq!(refused(|s| s.current.0 = 50.0), AxisError::Current);
    assert_eq!(refused(|s| s.current.0 = f32::NAN), AxisError::Current);
    assert_eq!(refused(|s| s.voltage.0 = 30.0), AxisError::Current);
    assert_eq!(refused(|s| s.turns_per_s = 0.0), AxisError::Current);
}
