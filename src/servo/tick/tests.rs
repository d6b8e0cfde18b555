//! Tests of the tick on an independent joint in double precision.
//!
//! The joint is an inertia with viscous friction and gravity, a lagging drive and an encoder that counts.

use super::*;
use crate::hal::JointSample;
use crate::motion::{Motion, Ramp};
use crate::real::{atan2, sin_cos, sqrt};
use crate::safety::{Derating, Fault, FaultCode};
use crate::servo::NoModel;
use crate::servo::scale::tests::{HIP, KNEE};
use crate::units::{Ampere, Hertz, KilogramMetreSquared, RadianPerSecondSquared};
use core::f64::consts::TAU;

mod bench;

use bench::{Bench, JOINTS, NOWHERE, Plant};

/// Amplitude ratio and phase (rad, negative is late) of the first joint's true angle to a commanded sine.
fn closed_loop(frequency_hz: f64, with_velocity: bool) -> (f64, f64) {
    let mut bench = Bench::enabled(JOINTS, Plant::KNEE);
    let period_ticks = (f64::from(SERVO_RATE_HZ) / frequency_hz).round();
    let omega = TAU * f64::from(SERVO_RATE_HZ) / period_ticks;
    // Small enough that no torque is capped at any frequency measured.
    let amplitude = 0.0005;
    let (settle, measure) = (8 * period_ticks as u32 + 8000, 8 * period_ticks as u32);
    let (mut in_phase, mut quadrature) = (0.0, 0.0);
    for tick in 0..settle + measure {
        let (sine, cosine) = sin_cos(omega * f64::from(tick) / f64::from(SERVO_RATE_HZ));
        let mut motion = MotionState::at_rest([(amplitude * sine) as f32; 2]);
        if with_velocity {
            motion.velocity_rad_per_s = [(amplitude * omega * cosine) as f32; 2];
        }
        let angle = bench.plants[0].angle;
        let output = bench.tick(motion, None::<&NoModel>, None);
        assert!(!output.decision.limited[0].any());
        if tick >= settle {
            in_phase += angle * sine * 2.0 / f64::from(measure);
            quadrature += angle * cosine * 2.0 / f64::from(measure);
        }
    }
    (sqrt(in_phase * in_phase + quadrature * quadrature) / amplitude, atan2(quadrature, in_phase))
}

/// Highest frequency at which the angle follows with at least half the power, Hz.
fn bandwidth(with_velocity: bool) -> f64 {
    let (mut low, mut high) = (1.0, 64.0);
    for _ in 0..10 {
        let middle = sqrt(low * high);
        if closed_loop(middle, with_velocity).0 > core::f64::consts::FRAC_1_SQRT_2 {
            low = middle
        } else {
            high = middle
        }
    }
    low
}

#[test]
fn the_checksum_stays_in_motion_and_differs_for_other_gains_and_limits() {
    let joints = JOINTS;
    let servo = Servo::new(joints).expect("sensible");
    let sum = servo.checksum();
    let mut derated = servo;
    derated.monitor.derate(&Derating::NONE);
    derated.restart();
    assert_eq!(derated.checksum(), sum);
    let mut changed = joints;
    changed[1].torque.0 += 1e-5;
    assert_ne!(Servo::new(changed).expect("sensible").checksum(), sum);
    let mut changed = joints;
    changed[0].bandwidth.0 *= 1.000_001;
    assert_ne!(Servo::new(changed).expect("sensible").checksum(), sum);
}

#[test]
fn the_position_loop_follows_beyond_four_hertz() {
    // Found: 6.27 Hz, designed for 6.0 without integral, delay and friction.
    let position_only = bandwidth(false);
    assert!(position_only > 4.0 && (position_only - 6.27).abs() < 0.1, "{position_only} Hz");
    // The servo's commands carry the velocity as well. Found: 40 Hz.
    let with_velocity = bandwidth(true);
    assert!(with_velocity > 20.0, "{with_velocity} Hz");
    for frequency in [0.15, 0.5, 1.0, 2.0, 4.0] {
        let (ratio, _) = closed_loop(frequency, true);
        // The integral and the observer's delay overshoot by 8 % at 4 Hz.
        assert!((ratio - 1.0).abs() < 0.1, "{frequency} Hz: {ratio}");
    }
}

/// A torque as feedforward, independent of the command.
struct Injected([f32; 2]);

impl TorqueModel<2> for Injected {
    fn torques(&self, _: &[f32; 2], _: &[f32; 2], _: &[f32; 2], _: [f32; 3]) -> [f32; 2] {
        self.0
    }
}

/// Gain and phase (rad) of the loop at a frequency, for a plant. A torque d injected where the controller's
/// torque u leaves gives u = d / (1 + L), so L = d / u - 1.
fn open_loop(frequency_hz: f64, joints: [JointConfiguration; 2], plant: Plant) -> (f64, f64) {
    let mut bench = Bench::enabled(joints, plant);
    let period_ticks = (f64::from(SERVO_RATE_HZ) / frequency_hz).round();
    let omega = TAU * f64::from(SERVO_RATE_HZ) / period_ticks;
    let injected = 5.0;
    let (settle, measure) = (8 * period_ticks as u32 + 8000, 16 * period_ticks as u32);
    let (mut in_phase, mut quadrature) = (0.0, 0.0);
    for tick in 0..settle + measure {
        let (sine, cosine) = sin_cos(omega * f64::from(tick) / f64::from(SERVO_RATE_HZ));
        let model = Injected([(injected * sine) as f32; 2]);
        let output = bench.tick(MotionState::at_rest([0.0; 2]), Some(&model), None);
        assert!(!output.decision.limited[0].any());
        if tick >= settle {
            let torque = f64::from(output.wanted_torque[0].0) / injected;
            in_phase += torque * sine * 2.0 / f64::from(measure);
            quadrature += torque * cosine * 2.0 / f64::from(measure);
        }
    }
    let power = in_phase * in_phase + quadrature * quadrature;
    let (real, imaginary) = (in_phase / power - 1.0, -quadrature / power);
    (sqrt(real * real + imaginary * imaginary), atan2(imaginary, real))
}

/// Crossover frequency in Hz and phase margin in degrees.
fn margin(joints: [JointConfiguration; 2], plant: Plant) -> (f64, f64) {
    let (mut low, mut high) = (8.0, 80.0);
    for _ in 0..10 {
        let middle = sqrt(low * high);
        if open_loop(middle, joints, plant).0 > 1.0 { low = middle } else { high = middle }
    }
    let phase = open_loop(low, joints, plant).1.to_degrees();
    (low, 180.0 + if phase > 0.0 { phase - 360.0 } else { phase })
}

#[test]
fn the_loop_keeps_its_phase_margin_down_to_half_the_inertia() {
    for (share, found_hz, found_deg) in [(1.0, 19.5, 47.4), (0.75, 25.2, 41.8), (0.5, 35.5, 29.5)] {
        let plant = Plant { inertia: share * Plant::KNEE.inertia, ..Plant::KNEE };
        let (crossover, margin) = margin(JOINTS, plant);
        // Bisection to a quarter of a per cent, projection over 16 periods.
        assert!((crossover - found_hz).abs() < 0.5, "{share}: {crossover} Hz");
        assert!((margin - found_deg).abs() < 1.0, "{share}: {margin} degrees");
    }
}

#[test]
fn half_the_bandwidth_has_the_larger_phase_margin() {
    // The drive's lag of 1 ms is longer than that of a current loop at 500 Hz, the least, 0.3 ms.
    let slower =
        JOINTS.map(|joint| JointConfiguration { bandwidth: Hertz(0.5 * joint.bandwidth.0), ..joint });
    for share in [1.0, 0.5] {
        let plant = Plant { inertia: share * Plant::KNEE.inertia, ..Plant::KNEE };
        let [designed, half] = [JOINTS, slower].map(|joints| margin(joints, plant));
        assert!(half.0 < designed.0 && half.1 > designed.1, "{share}: {half:?}, designed {designed:?}");
    }
}

#[test]
fn a_pose_is_held_against_gravity_without_error() {
    let mut bench = Bench::enabled(JOINTS, Plant { gravity: 30.0, angle: 0.7, ..Plant::KNEE });
    let pose = bench.pose();
    for _ in 0..4 * SERVO_RATE_HZ {
        let _ = bench.tick(MotionState::at_rest(pose), None::<&NoModel>, None);
    }
    for plant in &bench.plants {
        // Two counts; the reading is rounded down.
        assert!((plant.angle - 0.7).abs() < 2.0 * TAU / 409_600.0, "{}", plant.angle - 0.7);
    }
}

#[test]
fn the_integral_is_empty_when_the_drive_does_not_follow() {
    let mut bench = Bench::enabled(JOINTS, Plant { gravity: 30.0, angle: 0.7, ..Plant::KNEE });
    let hold = MotionState::at_rest(bench.pose());
    let mut output = bench.tick(hold, None::<&NoModel>, None);
    for _ in 0..2 * SERVO_RATE_HZ {
        output = bench.tick(hold, None::<&NoModel>, None);
    }
    // 30 N m times sin(0.7), by the integral alone.
    assert!((output.wanted_torque[0].0 - 19.3).abs() < 1.0, "{:?}", output.wanted_torque);
    let _ = bench.tick(hold, None::<&NoModel>, Some(PowerRequest::DisableVoltage));
    let output = bench.tick(hold, None::<&NoModel>, None);
    assert!(output.wanted_torque[0].abs().0 < 1.0, "{:?}", output.wanted_torque);
}

/// Exact law of the plant, in the model's angles: the second joint's angles and
/// torques have the opposite sign.
struct Exact;

impl TorqueModel<2> for Exact {
    fn torques(&self, q: &[f32; 2], qd: &[f32; 2], qdd: &[f32; 2], _: [f32; 3]) -> [f32; 2] {
        core::array::from_fn(|joint| 2.53 * qdd[joint] + 3.26 * qd[joint] + 30.0 * sin_cos(q[joint]).0)
    }
}

#[test]
fn an_exact_model_in_the_feedforward_tracks_many_times_better() {
    let ramp = |bench: &Bench| {
        let speed = [RadianPerSecond(1.5); 2];
        let acceleration = [RadianPerSecondSquared(6.0); 2];
        Motion::<2>::Ramp(
            Ramp::between(bench.pose(), [1.0, -1.0], speed, acceleration, SERVO_RATE_HZ).expect("positive"),
        )
    };
    let worst = |with_model: bool| {
        let mut bench = Bench::enabled(JOINTS, Plant { gravity: 30.0, ..Plant::KNEE });
        let motion = ramp(&bench);
        let mut worst = 0.0_f32;
        for tick in 0..motion.duration_ticks().expect("a ramp ends") {
            let output = bench.tick(motion.state_at(tick), with_model.then_some(&Exact), None);
            worst = worst.max(output.tracking_error[0].abs().0).max(output.tracking_error[1].abs().0);
        }
        worst
    };
    let (with_model, without) = (worst(true), worst(false));
    assert!(with_model < 0.2 * without, "{with_model} rad with, {without} without");
}

#[test]
fn nothing_that_is_not_finite_passes_the_tick_and_nothing_of_it_stays() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for field in 0..5 {
            let mut bench = Bench::enabled(JOINTS, Plant::KNEE);
            let mut sample = bench.sample();
            let mut motion = MotionState::at_rest(bench.pose());
            let mut model = Injected([0.0; 2]);
            match field {
                0 => sample.joints[1].current.0 = bad,
                1 => motion.position_rad[1] = bad,
                2 => motion.velocity_rad_per_s[1] = bad,
                3 => motion.acceleration_rad_per_s2[1] = bad,
                _ => model.0[1] = bad,
            }
            let feedforward = if field == 3 { None } else { Some(&model) };
            let command = ServoCommand { motion, feedforward, power: None };
            let output = bench.servo.tick(&sample, &command, None, NOWHERE);
            // An acceleration affects only observer and model; alone it must not get into the observer.
            if field == 3 {
                assert!(output.drive().enabled);
                assert_eq!(output.velocity[1], RadianPerSecond::ZERO);
                let model = Exact;
                let command = ServoCommand { motion, feedforward: Some(&model), power: None };
                assert_eq!(*bench.servo.tick(&sample, &command, None, NOWHERE).drive(), DriveCommand::OFF);
            } else {
                assert_eq!(*output.drive(), DriveCommand::OFF, "{bad} in {field}");
            }
            let here = bench.pose();
            use PowerRequest::{EnableOperation, ResetFault, Shutdown, SwitchOn};
            for power in [ResetFault, Shutdown, SwitchOn, EnableOperation] {
                let output = bench.tick(MotionState::at_rest(here), None::<&NoModel>, Some(power));
                assert!(output.position[1].is_finite() && output.velocity[1].is_finite());
            }
            assert_eq!(bench.servo.state(), DriveState::OperationEnabled);
        }
    }
}

#[test]
fn a_command_that_runs_out_of_range_stops_at_the_limit() {
    for (speed, gravity) in [(0.5, 0.0), (2.0, 0.0), (4.5, 0.0), (4.5, 30.0), (4.5, -30.0)] {
        let mut bench = Bench::enabled(JOINTS, Plant { gravity, ..Plant::KNEE });
        let mut limited = false;
        for tick in 0..3 * SERVO_RATE_HZ {
            // Both of the model's angles run upwards at full speed and stay 1 rad beyond the end.
            let target = (speed * tick as f32 / SERVO_RATE_HZ as f32).min(2.5);
            let mut motion = MotionState::at_rest([target; 2]);
            motion.velocity_rad_per_s = [if target < 2.5 { speed } else { 0.0 }; 2];
            let output = bench.tick(motion, None::<&NoModel>, None);
            limited |= output.decision.limited[0].range;
            assert_eq!(output.decision.fault, None, "tick {tick} at {speed}");
            for plant in &bench.plants {
                assert!((plant.angle.abs() - 1.5).to_degrees() < 0.5, "{} at {speed}", plant.angle);
                assert!(plant.velocity.abs() < 1.1 * 4.5);
            }
        }
        assert!(limited);
    }
}

#[test]
fn a_joint_that_is_driven_too_fast_is_damped_and_then_off() {
    let mut bench = Bench::enabled(JOINTS, Plant::KNEE);
    bench.plants[1].velocity = 6.5;
    let fault = Fault { code: FaultCode::Overspeed, joint: 1 };
    let hold = MotionState::at_rest([0.0; 2]);
    // The observer sees a sudden speed after its delay.
    let seen = (0..40).find(|_| bench.tick(hold, None::<&NoModel>, None).decision.fault == Some(fault));
    assert!(seen.is_some_and(|ticks| ticks < 24), "{seen:?}");
    let mut damped = 1;
    while bench.tick(hold, None::<&NoModel>, None).drive().enabled {
        damped += 1;
    }
    assert_eq!((damped, bench.servo.state()), (SERVO_RATE_HZ * 3 / 10, DriveState::Fault { fault }));
    assert!(bench.plants[1].velocity.abs() < 0.05, "{}", bench.plants[1].velocity);
}

#[test]
fn a_single_outlier_does_not_move_the_torque() {
    let mut bench = Bench::enabled(JOINTS, Plant::KNEE);
    let hold = MotionState::at_rest(bench.pose());
    for _ in 0..400 {
        let _ = bench.tick(hold, None::<&NoModel>, None);
    }
    let mut sample = bench.sample();
    sample.joints[0].encoder_counts ^= 1 << 14;
    let command = ServoCommand { motion: hold, feedforward: None::<&NoModel>, power: None };
    let output = bench.servo.tick(&sample, &command, None, NOWHERE);
    // At rest within a count: stiffness 8,700 N m/rad times 1.5e-5 rad, and the velocity's noise.
    assert!(output.wanted_torque[0].abs().0 < 1.0, "{:?}", output.wanted_torque);
    assert_eq!(output.decision.fault, None);
}

#[test]
fn a_servo_that_is_begun_anew_is_off_and_takes_counts_from_another_zero_for_good_ones() {
    let mut bench = Bench::enabled(JOINTS, Plant::KNEE);
    let here = bench.pose();
    bench.tick(MotionState::at_rest(here), None::<&NoModel>, None);
    bench.servo.restart();
    bench.plants.iter_mut().for_each(|plant| plant.angle += 1.0);
    for _ in 0..100 {
        let here = bench.pose();
        let output = bench.tick(MotionState::at_rest(here), None::<&NoModel>, None);
        assert!(!output.drive().enabled && output.decision.fault.is_none(), "{output:?}");
    }
    assert_eq!(bench.servo.state(), DriveState::SwitchOnDisabled);
}

#[test]
fn absurd_joints_are_refused_by_name() {
    use crate::safety::{LimitQuantity, LimitsError};
    let refused = |change: fn(&mut JointConfiguration)| {
        let mut joints = JOINTS;
        change(&mut joints[1]);
        Servo::new(joints).expect_err("absurd")
    };
    assert_eq!(refused(|joint| joint.bandwidth = Hertz(100.0)), ServoError::Bandwidth { joint: 1 });
    assert_eq!(refused(|joint| joint.bandwidth = Hertz(f32::NAN)), ServoError::Bandwidth { joint: 1 });
    assert_eq!(refused(|joint| joint.scale.radian_per_count = Radian(0.0)), ServoError::Scale { joint: 1 });
    let limits = LimitsError { joint: 1, quantity: LimitQuantity::Inertia };
    assert_eq!(refused(|joint| joint.inertia.0 = f32::NAN), ServoError::Limits(limits));
}

#[test]
fn every_number_whose_bits_flip_is_another_one() {
    let sound = Bench::enabled(JOINTS, Plant::KNEE).servo;
    let flip_bit = |number| {
        let mut servo = sound;
        servo.flip_bit(0, number, 3);
        servo
    };
    let all: [_; Servo::<2>::NUMBERS as usize] = core::array::from_fn(|number| flip_bit(number as u8));
    for (number, one) in all.iter().enumerate() {
        assert!(*one != sound && all.iter().filter(|other| *other == one).count() == 1, "{number}");
        let mut twice = *one;
        twice.flip_bit(0, number as u8, 3);
        assert!(twice == sound, "{number}");
    }
}
