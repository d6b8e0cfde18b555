//! Simulated world at its interface to the firmware: sensors, drives, seeds, copies and signs.
#![expect(clippy::disallowed_methods, reason = "expected values by another library than the plant's")]

use crate::plant::common::{planar_leg, turned, worn_leg};
use core::f64::consts::TAU;
use hal_sim::description::{EncoderDescription, LegDescription, PushDescription};
use hal_sim::sensors::Encoder;
use hal_sim::world::{TICK_S, World};
use scarab::hal::{DriveCommand, LegDrives, Sample};
use scarab::units::Ampere;

fn noisy_leg() -> LegDescription<2> {
    let mut noisy = worn_leg();
    for joint in &mut noisy.joints {
        joint.current_sensor.noise = 0.5;
    }
    noisy.pushes = Some(PushDescription { rate: 3.0, torque: 20.0, duration: 0.2 });
    noisy
}

fn shaken(tick: u32) -> DriveCommand<2> {
    let swing = (tick % 2000) as f32 * 0.04 - 40.0;
    DriveCommand { enabled: true, currents: [Ampere(swing), Ampere(-0.4 * swing)] }
}

fn run(world: &mut World<2>, ticks: core::ops::Range<u32>) -> Vec<Sample<2>> {
    ticks.map(|tick| world.tick(&shaken(tick))).collect()
}

#[test]
fn equal_seeds_give_equal_bits_and_different_seeds_do_not() {
    let samples = |seed: u64| run(&mut World::new(&noisy_leg(), seed), 0..8000);
    assert!(samples(7) == samples(7));
    assert!(samples(7) != samples(8));
}

#[test]
fn reading_the_sensors_twice_changes_nothing() {
    let mut world = World::new(&noisy_leg(), 7);
    run(&mut world, 0..10);
    let before = world.clone();
    assert_eq!(world.sample(), world.sample());
    assert!(world == before);
}

#[test]
fn encoder_rounds_to_counts_and_wraps_in_32_bits() {
    let motor = EncoderDescription { counts: 8192.0, ratio: 50.0 };
    let encoder = Encoder::new(&motor);
    let count = TAU / (8192.0 * 50.0);
    for counts in [-70_000, -1, 0, 1, 12_345, 409_600] {
        let angle = f64::from(counts) * count;
        assert_eq!(encoder.read(angle + 0.49 * count), counts);
        assert_eq!(encoder.read(angle - 0.49 * count), counts);
        assert_eq!(encoder.read(angle + 0.51 * count), counts + 1);
    }
    let last = (f64::from(i32::MAX) + 0.25) * count;
    assert_eq!(encoder.read(last), i32::MAX);
    assert_eq!(encoder.read(last + count), i32::MIN);
    let joint = EncoderDescription { counts: 16384.0, ratio: 1.0 };
    assert_eq!(Encoder::new(&joint).read(-TAU / 4.0), -4096);
}

#[test]
fn current_noise_has_its_stated_size_in_the_mean_of_eight_samples() {
    let mut description = planar_leg();
    description.joints[0].current_sensor.noise = 0.7;
    description.joints[0].current_sensor.offset = 0.2;
    let mut world = World::new(&description, 11);
    let rows = 10_000;
    let (mut sum, mut squares, mut single_squares) = (0.0, 0.0, 0.0);
    for _ in 0..rows {
        let mut mean = 0.0;
        for _ in 0..8 {
            let reading = f64::from(world.tick(&DriveCommand::OFF).joints[0].current.0) - 0.2;
            mean += reading / 8.0;
            single_squares += reading * reading / f64::from(8 * rows);
        }
        sum += mean / f64::from(rows);
        squares += mean * mean / f64::from(rows);
        assert_eq!(
            world.sample().joints[1].current,
            Ampere(0.0),
            "the other joint's sensor must be noise-free"
        );
    }
    // 10,000 rows determine a standard deviation to 0.7 %, a mean to 0.007 A; the tolerance is four
    // times that.
    assert!((squares.sqrt() / 0.7 - 1.0).abs() < 0.028, "{}", squares.sqrt());
    assert!(sum.abs() < 0.028, "{sum}");
    assert!(
        (single_squares.sqrt() / (0.7 * 8.0_f64.sqrt()) - 1.0).abs() < 0.01,
        "the noise is not white: {single_squares}"
    );
}

#[test]
fn current_reading_is_a_whole_number_of_conversion_steps() {
    let mut description = noisy_leg();
    description.joints[0].current_sensor.step = 0.12;
    let mut world = World::new(&description, 11);
    for sample in run(&mut world, 0..500) {
        let steps = sample.joints[0].current.0 / 0.12;
        assert!((steps - steps.round()).abs() < 1e-4, "{steps}");
    }
}

#[test]
fn drive_follows_its_target_with_the_exact_lag_and_never_beyond_its_limit() {
    let mut description = worn_leg();
    description.joints[1].drive.current_limit = 30.0;
    let mut world = World::new(&description, 1);
    let command = DriveCommand { enabled: true, currents: [Ampere(20.0), Ampere(-50.0)] };
    for tick in 1..=40 {
        let sample = world.tick(&command);
        let reached = 1.0 - (-f64::from(tick) * TICK_S / 5e-4).exp();
        // Readings have single precision.
        assert!((f64::from(sample.joints[0].current.0) - 20.0 * reached).abs() < 2e-6);
        assert!((f64::from(sample.joints[1].current.0) + 30.0 * reached).abs() < 4e-6);
    }
    world.command(&DriveCommand { enabled: true, currents: [Ampere(f32::NAN), Ampere(f32::INFINITY)] });
    run(&mut world, 0..10);
    assert!(world.truth().position.iter().all(|angle| angle.is_finite()));
}

#[test]
fn a_mirrored_or_turned_description_behaves_identically_at_the_ports() {
    let plain = worn_leg();
    let (mut one, mut other) = (World::new(&plain, 1), World::new(&turned(&plain), 1));
    for tick in 0..8000 {
        one.tick(&shaken(tick));
        other.tick(&shaken(tick));
    }
    let (one, other) = (one.truth(), other.truth());
    assert!(one.position[1].abs() > 0.01, "the leg did not move: {one:?}");
    assert_eq!(one.sticking, other.sticking);
    for joint in 0..2 {
        // Rounding differs by the turned frames; two seconds of motion hardly amplify it.
        assert!((one.position[joint] - other.position[joint]).abs() < 1e-10, "{one:?} {other:?}");
        assert!((one.velocity[joint] - other.velocity[joint]).abs() < 1e-9, "{one:?} {other:?}");
        assert!((one.acceleration[joint] - other.acceleration[joint]).abs() < 1e-8, "{one:?} {other:?}");
    }
}

#[test]
fn pushes_move_the_leg_without_motor_torque() {
    let mut pushed = worn_leg();
    pushed.pushes = Some(PushDescription { rate: 5.0, torque: 60.0, duration: 0.2 });
    let mut quiet = World::new(&worn_leg(), 2);
    let mut world = World::new(&pushed, 2);
    let mut fastest = [0.0_f64; 2];
    for _ in 0..40_000 {
        quiet.advance();
        world.advance();
        for (largest, rate) in fastest.iter_mut().zip(world.truth().velocity) {
            *largest = largest.max(rate.abs());
        }
    }
    assert!(fastest.iter().all(|&rate| rate > 0.1), "{fastest:?}");
    assert_eq!(world.truth().motor_torque, [0.0; 2]);
    assert_eq!(quiet.truth().velocity, [0.0; 2]);
}

#[test]
fn a_mass_fixed_to_a_link_adds_its_own_weight_and_inertia() {
    let description = worn_leg();
    let bare = World::new(&description, 1);
    let mut loaded = bare.clone();
    let (mass, along, across) = (3.0, 0.2, 0.05);
    loaded.attach(1, mass, [along, across, 0.0]);
    // Separate body on a massless second link: its own torque is the added one.
    let mut alone = description;
    for joint in &mut alone.joints {
        joint.body = hal_sim::description::BodyDescription { mass: 1e-9, ..Default::default() };
        joint.rotor_inertia = 0.0;
        joint.friction = Default::default();
    }
    let mut alone = World::new(&alone, 1);
    alone.attach(1, mass, [along, across, 0.0]);
    for (angle, rate) in [(0.3, 0.0), (0.9, 1.5), (1.4, -2.0)] {
        let state = ([angle, 0.7 * angle], [rate, 0.5 - rate], [3.0, -4.0 * rate]);
        let torque = |world: &World<2>| world.inverse_dynamics(&state.0, &state.1, &state.2);
        for joint in 0..2 {
            let added = torque(&loaded)[joint] - torque(&bare)[joint];
            // Rounding of torques up to some tens of N m.
            assert!((added - torque(&alone)[joint]).abs() < 1e-6, "{added}");
        }
    }
    loaded.attach(1, -mass, [along, across, 0.0]);
    let state = ([0.3, 0.4], [1.0, 1.0], [2.0, 2.0]);
    let difference = loaded.inverse_dynamics(&state.0, &state.1, &state.2)[0]
        - bare.inverse_dynamics(&state.0, &state.1, &state.2)[0];
    assert!(difference.abs() < 1e-9, "{difference:e}");
}
