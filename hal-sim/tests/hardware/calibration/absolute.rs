//! Motors with an absolute magnetic encoder, which errs by 0.8 degrees over a turn: calibrated with gear and
//! leg, confirmed after a power-up elsewhere in the turn, without a hand that turns the joint.
//!
//! Figures: `cargo test -p hal-sim --test hardware calibration::absolute -- --nocapture`.

use core::f64::consts::TAU;

use hal_sim::drive::description::{AS5047P_ERROR, EncoderWiring, SupplyDescription};
use hal_sim::drive::stand::{Geared, Load, Stand};
use scarab::hal::AxisCommand;
use scarab::motor::{
    AbsoluteAngle, Calibration, CalibrationStep, Calibrator, Direction, Refusal, StoredCalibration,
};

use crate::calibration::in_place::geared;
use crate::calibration::offset_error;
use crate::calibration::trial::{TestRandom, Trial};

const COUNTS: i32 = 4096;

/// A leg with an absolute encoder at the rotor.
fn equipped(seed: u64) -> Trial {
    let mut trial = geared(seed, None);
    let counter = &mut trial.axis.counter;
    (counter.counts, counter.error, counter.absolute) = (f64::from(COUNTS), AS5047P_ERROR, true);
    trial.axis.wiring.encoder = EncoderWiring::Forward;
    let configuration = &mut trial.configuration;
    (configuration.index, configuration.absolute) = (false, true);
    (configuration.counts_per_turn, configuration.counter) = (COUNTS as u32, Direction::Up);
    trial
}

/// Runs a calibration that begins with a reading of the absolute encoder. Also returns the largest distance
/// of the rotor from its start, electrical turns.
fn calibrate(stand: &mut Stand, calibrator: Calibrator) -> (Result<Calibration, Refusal>, f64) {
    let mut sample = stand.period(&AxisCommand::OFF, 0.0);
    let steps = stand.axis().rotor_steps().expect("an encoder");
    let counts = AbsoluteAngle::from_steps(steps).counts(COUNTS);
    let mut calibrator = calibrator.at_position(sample.encoder_count, counts);
    let (begin, mut furthest) = (stand.rotor().angle, 0.0_f64);
    loop {
        let command = match calibrator.tick(&sample) {
            CalibrationStep::Running(command) => command,
            CalibrationStep::Done(found) => return (Ok(found), furthest),
            CalibrationStep::Refused(reason) => return (Err(reason), furthest),
        };
        sample = stand.period(&command, 0.0);
        let pairs = f64::from(stand.axis().description().motor.pole_pairs);
        furthest = furthest.max((stand.rotor().angle - begin).abs() / TAU * pairs);
    }
}

fn placed(trial: &Trial, angle: f64, seed: u64) -> Stand {
    Stand::new(&trial.axis, &SupplyDescription::default(), trial.load, angle, seed)
}

/// With more pole pairs the encoder's error may turn a leg with little friction: 1.6 degrees are 22
/// electrical ones with 14. That leg is refused as moved, and its next calibration turns the motor.
fn confirmed_anywhere_in_the_turn(legs: u64) {
    let (mut worst_error, mut worst_travel, mut moved) = (0.0_f64, 0.0_f64, 0);
    for seed in 1..=legs {
        let trial = equipped(seed);
        let calibrator = || Calibrator::new(&trial.configuration, trial.settings).expect("sensible");
        let mut stand = placed(&trial, trial.angle, seed);
        let (result, _) = calibrate(&mut stand, calibrator());
        let found = result.unwrap_or_else(|reason| panic!("seed {seed}: {reason:?}\n{trial:?}"));
        assert!(found.is_proven() && found.indexed(), "seed {seed}");
        let stored = found.stored().expect("positions count from the encoder's zero");

        // The next day: the counter begins again, and the leg rests elsewhere.
        let mut random = TestRandom::new(seed + 3_000_000);
        let mut next = equipped(seed);
        next.axis.counter.start = random.one_of([0, 20_000, 65_500]);
        if let Load::Geared(leg) = next.load {
            next.load = Load::Geared(Geared { supported_s: f64::INFINITY, ..leg });
        }
        let angle = trial.angle + random.between(-3.0, 3.0) * TAU;
        let mut stand = placed(&next, angle, seed);
        let (confirmed, travel) = calibrate(&mut stand, from_stored(&next, stored));
        if confirmed == Err(Refusal::Moved) && trial.configuration.pole_pairs > 7 {
            moved += 1;
            continue;
        }
        let confirmed = confirmed.unwrap_or_else(|reason| panic!("seed {seed}: {reason:?}\n{next:?}"));
        assert!(!confirmed.is_proven() && confirmed.offset() == stored.offset, "seed {seed}");
        let pairs = f64::from(trial.axis.motor.pole_pairs);
        let error = offset_error(&mut stand, &next, &confirmed, seed).abs();
        println!("{seed:>3}  {pairs} pole pairs  offset {error:.2} electrical degrees  travel {travel:.4}");
        worst_error = worst_error.max(error / pairs);
        worst_travel = worst_travel.max(travel);
    }
    println!(
        "worst offset {worst_error:.2} degrees of the rotor, travel {worst_travel:.4} electrical turns; {moved} of {legs} moved"
    );
    // The encoder's error at both ends of the calibration's path and here, 0.8 degrees each.
    assert!(worst_error < 1.6 && worst_travel < 1.0 / 32.0, "{worst_error} {worst_travel}");
    assert!(5 * moved < 2 * legs, "{moved}");
}

#[test]
fn legs_are_calibrated_once_and_confirmed_anywhere_in_the_turn() {
    confirmed_anywhere_in_the_turn(3);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn absolute_encoders_of_25_legs_are_confirmed_anywhere_in_the_turn() {
    confirmed_anywhere_in_the_turn(25);
}

fn from_stored(trial: &Trial, stored: StoredCalibration) -> Calibrator {
    Calibrator::from_stored(&trial.configuration, trial.settings, stored).expect("sensible")
}

#[test]
fn a_calibration_that_turns_accepts_the_encoders_own_error_and_no_more() {
    accepts_its_own_error_and_no_more(1);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn calibrations_of_five_legs_accept_the_encoders_own_error_and_no_more() {
    accepts_its_own_error_and_no_more(5);
}

fn accepts_its_own_error_and_no_more(legs: u64) {
    for seed in 1..=legs {
        let trial = equipped(seed);
        let turning = |stored: StoredCalibration, angle: f64| {
            let mut stand = placed(&trial, angle, seed);
            calibrate(&mut stand, from_stored(&trial, stored).turning()).0
        };
        let mut stand = placed(&trial, trial.angle, seed);
        let calibrator = Calibrator::new(&trial.configuration, trial.settings).expect("sensible");
        let stored = calibrate(&mut stand, calibrator).0.expect("sound").stored().expect("a zero");
        let found = turning(stored, trial.angle);
        assert!(found.is_ok_and(|found| found.offset() == stored.offset), "seed {seed}");
        // The magnet was turned on its shaft by 5 degrees.
        let pairs = f32::from(trial.configuration.pole_pairs);
        let offset = stored.offset.plus(scarab::motor::ElectricalAngle::from_turns(5.0 / 360.0 * pairs));
        let moved = turning(StoredCalibration { offset, ..stored }, trial.angle);
        assert!(matches!(moved, Err(Refusal::StoredOffset(_))), "seed {seed}: {moved:?}");
    }
}
