//! Limits of the first motion after a check at standstill, and its proof of the rotor angle.

use super::*;
use crate::motor::calibration::tests::unproven;

/// Joint speed (of the motor, rad/s) whose back-EMF exceeds the tolerance, and one below the speed limit.
const COUNTED: f64 = 45.0;
/// Speed whose back-EMF lies below every tolerance.
const SLOW: f64 = 15.0;

impl Bench {
    /// An axis with an unproven offset, so many electrical degrees off, on a rotor that is driven.
    fn unproven(degrees: f32, change: impl Fn(&mut TestMotor)) -> Self {
        let mut motor = TestMotor::default();
        let calibration = unproven(&calibrate(&mut motor, &CONFIGURATION).expect("sound"), degrees);
        (motor.driven, motor.speed) = (true, 0.0);
        change(&mut motor);
        let sample = motor.sample();
        let axis = Axis::new(&CONFIGURATION, &calibration, &sample).expect("usual");
        let mut bench = Self { motor, axis, sample };
        bench.run_sampled(AxisRequest::OFF, 480, |_| {});
        bench
    }

    /// Turns the rotor at a speed (rad/s) that is reached within 0.1 s, until the angle is proven, a fault is
    /// found, or so many turns are made. Returns the turns made at the full speed.
    fn turn(&mut self, speed: f64, current: f32, most_turns: f64) -> f64 {
        for tick in 0..400 {
            self.motor.speed = speed * f64::from(tick) / 400.0;
            self.run_sampled(ask(current), 6, |_| {});
        }
        self.motor.speed = speed;
        let begin = self.motor.angle;
        let turned = |bench: &Self| (bench.motor.angle - begin).abs() / core::f64::consts::TAU;
        while !self.axis.is_proven() && self.axis.fault().is_none() && turned(self) < most_turns {
            self.run_sampled(ask(current), 6, |_| {});
        }
        turned(self)
    }
}

#[test]
fn a_quarter_of_the_current_flows_until_a_quarter_of_a_turn_has_agreed() {
    for (speed, current) in [(COUNTED, 30.0), (-COUNTED, 30.0), (60.0, -40.0), (-40.0, 0.0)] {
        let mut bench = Bench::unproven(0.0, |_| {});
        bench.run_sampled(ask(current), 240, |_| {});
        let limited = current.clamp(-10.0, 10.0);
        let q = bench.motor.current[1];
        assert!((q - f64::from(limited)).abs() < 0.5, "{q} A of {current}");
        assert!(!bench.axis.is_proven());
        bench.turn(speed, current, 1.0);
        assert_eq!((bench.axis.is_proven(), bench.axis.fault()), (true, None), "{speed} rad/s, {current} A");
        // The limit rises within 0.75 s, not in a step that would throw the joint against a hand.
        let mut before = bench.motor.current[1];
        for _ in 0..800 {
            bench.run_sampled(ask(current), 24, |_| {});
            let q = bench.motor.current[1];
            assert!((q - before).abs() < 0.5, "{before} to {q} A within a millisecond");
            before = q;
        }
        assert_eq!(bench.axis.current_share(), 1.0);
        assert!((before - f64::from(current)).abs() < 0.5, "{before} A of {current}");
        // No limit of the speed is left.
        for tick in 0..400 {
            bench.motor.speed = speed + (150.0 - speed) * f64::from(tick) / 400.0;
            bench.run_sampled(ask(0.0), 6, |_| {});
        }
        assert_eq!(bench.axis.fault(), None);
    }
}

#[test]
fn only_travel_in_a_row_with_a_back_emf_beyond_the_tolerance_counts() {
    // Any number of turns at a low speed.
    let mut bench = Bench::unproven(0.0, |_| {});
    bench.turn(SLOW, 5.0, 5.0);
    assert_eq!((bench.axis.is_proven(), bench.axis.fault()), (false, None));
    // With the bridge off.
    bench.motor.speed = COUNTED;
    bench.run_sampled(AxisRequest::OFF, 6000, |_| {});
    assert_eq!((bench.axis.is_proven(), bench.axis.fault()), (false, None));
    // Enabled again and again, each time for less than the quarter of a turn: 30 ms make 0.21.
    for _ in 0..10 {
        bench.run_sampled(ask(5.0), 720, |_| {});
        assert_eq!((bench.axis.is_proven(), bench.axis.fault()), (false, None));
        bench.run_sampled(AxisRequest::OFF, 240, |_| {});
    }
    bench.run_sampled(ask(5.0), 960, |_| {});
    assert!(bench.axis.is_proven());
}

#[test]
fn more_than_the_first_speed_loses_the_position_and_brakes() {
    // 3.5 (0.44 V + 0.35 * 0.05 ohm * 10 A) / 2.9 mV s / 7.
    let frozen = Bench::unproven(0.0, |_| {}).axis.constants.model.frozen_speed(Ampere(10.0));
    let limit = f64::from(SPEED_SHARE * frozen) / 7.0;
    assert!((limit - 106.0).abs() < 2.0, "{limit}");
    for (share, lost) in [(0.97, false), (1.03, true), (-1.03, true)] {
        let mut bench = Bench::unproven(0.0, |_| {});
        // So fast that no quarter of a turn is counted on the way.
        bench.motor.speed = share * limit;
        bench.run_sampled(AxisRequest::OFF, 240, |_| {});
        assert_eq!(bench.axis.fault(), None, "the bridge is off");
        bench.run_sampled(ask(1.0), 60, |_| {});
        assert_eq!(bench.axis.fault(), lost.then_some(AxisFault::Encoder), "{share}");
        if lost {
            assert_eq!(bench.tick(ask(1.0)), AxisCommand::BRAKE);
            assert!(!bench.axis.clear_fault());
        }
    }
}

#[test]
fn a_wrong_angle_is_never_proven_and_a_lost_position_once_it_turns() {
    for degrees in [60.0, -60.0, 90.0, -90.0, 120.0, 180.0] {
        for (speed, current) in [(COUNTED, 0.0), (-COUNTED, 8.0), (70.0, 30.0), (-100.0, -30.0)] {
            let mut bench = Bench::unproven(degrees, |_| {});
            bench.turn(speed, current, 2.0);
            assert!(!bench.axis.is_proven(), "{degrees} degrees, {speed} rad/s, {current} A");
            if degrees != 60.0 && degrees != -60.0 || speed.abs() > 60.0 {
                assert_eq!(bench.axis.fault(), Some(AxisFault::Encoder), "{degrees} {speed} {current}");
            }
        }
        // Left to itself, with the greatest permitted torque.
        let mut bench = Bench::unproven(degrees, |motor| motor.driven = false);
        bench.run_sampled(ask(40.0), 24_000, |_| {});
        assert!(!bench.axis.is_proven(), "{degrees} degrees");
        assert!(degrees.abs() == 90.0 || bench.axis.fault() == Some(AxisFault::Encoder), "{degrees} degrees");
    }
}

#[test]
fn an_exchanged_encoder_is_never_proven() {
    for angle in [0.3, 0.5, 0.8, 1.0] {
        for speed in [COUNTED, -80.0] {
            // The counter runs against the field since the calibration.
            let mut bench = Bench::unproven(0.0, |motor| {
                motor.encoder_sign = -1.0;
                motor.angle = angle;
            });
            bench.turn(speed, 8.0, 2.0);
            assert_eq!((bench.axis.is_proven(), bench.axis.fault()), (false, Some(AxisFault::Encoder)));
        }
    }
}

#[test]
fn a_warm_motor_s_first_motion_is_proven() {
    for (resistance, flux, inductance) in [(1.3, 0.85, 0.8), (0.85, 1.1, 1.1)] {
        for (speed, current) in [(70.0, 10.0), (-70.0, 10.0), (60.0, 0.0)] {
            let mut bench = Bench::unproven(3.0, |motor| {
                motor.resistance *= resistance;
                motor.flux *= flux;
                motor.inductance = motor.inductance.map(|henry| henry * inductance);
            });
            bench.turn(speed, current, 1.0);
            let found = (bench.axis.is_proven(), bench.axis.fault());
            assert_eq!(found, (true, None), "{flux} {speed} {current}");
        }
    }
}

#[test]
fn a_phase_that_opens_before_the_proof_brakes() {
    let mut bench = Bench::unproven(0.0, |_| {});
    bench.turn(SLOW, 8.0, 0.1);
    bench.motor.open = true;
    bench.run_sampled(ask(8.0), 1200, |_| {});
    assert!(matches!(bench.axis.fault(), Some(AxisFault::Encoder | AxisFault::EncoderFrozen)));
    assert_eq!(bench.tick(ask(8.0)), AxisCommand::BRAKE);
}
