//! Calibration of motors that carry gear and leg: random legs, loads and poses.
//!
//! Figures: `cargo test -p hal-sim --test calibration in_place -- --nocapture`.

use core::f64::consts::{PI, TAU};

use hal_sim::drive::stand::{Geared, Load};
use scarab::motor::{CalibrationSettings, Refusal};
use scarab::units::{Ampere, KilogramMetreSquared, Volt};

use crate::offset_error;
use crate::trial::{TestRandom, Trial};

/// Settings of the board (`drives::CALIBRATION`), with an inertia between those of hip and knee.
const SETTINGS: CalibrationSettings = CalibrationSettings {
    current: Ampere(15.0),
    voltage: Volt(3.0),
    turns_per_s: 6.0,
    travel_turns: 1.25,
    inertia: KilogramMetreSquared(1e-3),
};

/// A motor like those of the default leg, with gear and leg. `load` is gravity's torque at the start as a
/// share of what the current holds; `None` for any up to 0.6.
pub fn geared(seed: u64, load: Option<f64>) -> Trial {
    let mut trial = Trial::sound(seed);
    let mut random = TestRandom::new(seed + 1_000_000);
    let motor = &mut trial.axis.motor;
    motor.pole_pairs = random.one_of([7, 10, 14]);
    motor.resistance = 0.039 * random.between(0.8, 1.3);
    motor.inductance_d = 15e-6 * random.between(0.8, 1.5);
    motor.inductance_q = motor.inductance_d * random.between(1.0, 1.25);
    // 1.5 N m/A at the joint.
    let ratio = 50.0;
    let torque_per_ampere = 0.03 * random.between(0.8, 1.2);
    motor.flux = torque_per_ampere / (1.5 * f64::from(motor.pole_pairs));
    let holding = torque_per_ampere * f64::from(SETTINGS.current.0);
    motor.cogging = random.between(0.0, 0.04) * holding;
    motor.cogging_periods = 6 * motor.pole_pairs;
    trial.configuration.pole_pairs = motor.pole_pairs as u8;
    // The flux of the data sheet is up to 10 % off.
    trial.configuration.flux.0 = (motor.flux * random.between(0.9, 1.1)) as f32;
    trial.settings = SETTINGS;

    // Hip and knee of the default leg, with 0.3 to 1.3 times its load.
    let share = random.between(0.3, 1.3);
    let (gravity, inertia) = random.one_of([(64.0, 2.6), (17.0, 0.64)]);
    let gravity = share * gravity;
    let held = ratio * holding;
    let most = (0.6 * held / gravity).min(1.0);
    let angle = match load {
        Some(load) => (load * held / gravity).clamp(-1.0, 1.0).asin(),
        None => random.between(-most, most).asin(),
    };
    let friction = random.between(0.7, 1.3) * 4.6;
    let viscous = random.between(0.7, 1.3) * 4.0;
    let at_rotor = random.between(0.3, 1.0);
    trial.load = Load::Geared(Geared {
        rotor_inertia: random.between(1.5, 2.2) / (ratio * ratio),
        rotor_coulomb: at_rotor * friction / ratio,
        rotor_viscous: at_rotor * viscous / (ratio * ratio),
        ratio,
        backlash: random.between(0.0, 0.3) * PI / 180.0,
        inertia: share * inertia,
        coulomb: (1.0 - at_rotor) * friction,
        viscous: (1.0 - at_rotor) * viscous,
        gravity,
        start: angle,
        // Until the current holds the leg.
        supported_s: 2.0,
    });
    trial
}

/// Error of the offset, electrical degrees; furthest motion of the rotor and its place at the end, turns.
fn outcome(seed: u64) -> [f64; 3] {
    let trial = geared(seed, None);
    let (mut stand, result, furthest) = trial.run(seed);
    let found = result.unwrap_or_else(|reason| panic!("seed {seed}: {reason:?}\n{trial:?}"));
    let end = (stand.rotor().angle - trial.angle) / TAU;
    [offset_error(&mut stand, &trial, &found, seed), furthest, end]
}

fn calibrates(seeds: core::ops::RangeInclusive<u64>) {
    let mut worst = [0.0_f64; 3];
    for seed in seeds {
        let found = outcome(seed);
        println!(
            "{seed:>3}  offset {:+.2} degrees  travel {:.3} turns  end {:+.4} turns",
            found[0], found[1], found[2]
        );
        for (worst, found) in worst.iter_mut().zip(found) {
            *worst = worst.max(found.abs());
        }
    }
    println!("worst offset {:.2} degrees, travel {:.3} turns, end {:.4} turns", worst[0], worst[1], worst[2]);
    assert!(worst[0] < 0.6 && worst[1] < 1.25 && worst[2] < 0.02, "{worst:?}");
}

#[test]
fn a_motor_is_calibrated_with_gear_and_leg_in_poses_that_its_current_holds() {
    calibrates(1..=25);
}

/// Takes a minute: `cargo test -p hal-sim --test calibration 200_legs -- --ignored --nocapture`.
#[test]
#[ignore = "a minute"]
fn motors_of_200_legs_are_calibrated_in_place() {
    calibrates(1..=200);
}

#[test]
fn a_load_that_the_current_hardly_holds_is_refused_with_its_size() {
    for seed in 1..=10 {
        for load in [0.75, -0.75] {
            let trial = geared(seed, Some(load));
            let (_, result, furthest) = trial.run(seed);
            let Load::Geared(leg) = trial.load else { unreachable!() };
            // A leg of which gravity makes less than this load is not refused.
            let held = 50.0 * trial.axis.motor.flux * 1.5 * f64::from(trial.axis.motor.pole_pairs) * 15.0;
            if leg.gravity < 0.75 * held {
                continue;
            }
            match result {
                Err(Refusal::Load(percent)) => {
                    assert!((65..=85).contains(&percent), "seed {seed}: {percent}")
                }
                other => panic!("seed {seed}: {other:?}, {furthest}"),
            }
        }
    }
}
