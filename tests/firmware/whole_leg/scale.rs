//! Torque constants that differ from the firmware's, known masses that reveal them, known loads.

use hal_sim::world::World;
use nalgebra::Vector3;
use scarab::leg::{IdentifiedModel, LoggedSample};
use scarab::model::Payload;
use scarab::servo::TorqueModel;
use scarab_identify::formats::leg_file::BodySide;
use scarab_identify::leg::posture::on_side;
use scarab_identify::run::scale::Scale;
use scarab_rig::scale::{self, Corrected};

use super::*;

const ON_THE_KNEE: Payload<f64> = Payload { joint: 1, mass: 5.0, position: Vector3::new(0.2, 0.0, 0.0) };

/// The default leg with motors that make `factors` times the torque of the firmware's constants.
fn leg_with_constants(factors: [f64; JOINTS]) -> LegFile {
    let mut leg = default_leg();
    for (joint, factor) in leg.joints.iter_mut().zip(factors) {
        joint.current_limit_a = Some(joint.current_limit());
        joint.torque_per_ampere *= factor;
    }
    leg
}

/// A leg that has identified itself once.
struct FirstRun {
    pair: Pair,
    /// Verdict on that run alone.
    verdict: Option<Verdict>,
    log: Vec<LoggedSample<JOINTS>>,
}

fn first_run(factors: [f64; JOINTS], seed: u64) -> FirstRun {
    let mut pair = enabled(&leg_with_constants(factors), seed);
    let mut log = Vec::new();
    let mut request = Some(ControlRequest::Identify);
    while request.is_some() || matches!(activity(&pair), Activity::Identify(_)) {
        log.extend(tick(&mut pair, request.take()).logged);
    }
    FirstRun { verdict: pair.leg.control().verdict(), pair, log }
}

fn corrected(
    run: &FirstRun,
    stated: &Payload<f64>,
) -> (Scale<JOINTS, BASE>, Option<Corrected<JOINTS, BASE>>) {
    let scale = second_run(&run.pair, &ON_THE_KNEE, stated);
    let identification = run.pair.leg.identification();
    let solver = identification.solver().expect("solved");
    let corrected = scale::corrected(&scale, context(), solver, identification.validation(), &run.log);
    (scale, corrected)
}

/// Second run with a mass `carried` on the leg and a mass `stated` to the firmware.
fn second_run(pair: &Pair, carried: &Payload<f64>, stated: &Payload<f64>) -> Scale<JOINTS, BASE> {
    scale::find_with(context(), pair, carried, stated).expect("the drive holds 5 kg")
}

#[test]
fn a_wrong_torque_constant_is_found_only_with_a_known_mass() {
    for seed in 1..=3 {
        let run = first_run([1.2; JOINTS], seed);
        assert_eq!(run.verdict, Some(Verdict::ACCEPTED), "undetectable in one run");
        let relative = run.pair.leg.identification().solver().expect("solved").estimate().values;
        let rotor = BASE - 1;
        // All values are too small by the factor; sigma of this rotor's inertia is 0.3 %.
        assert!((f64::from(relative[rotor]) * 1.2 / true_base()[rotor] - 1.0).abs() < 0.02);

        let (scale, corrected) = corrected(&run, &ON_THE_KNEE);
        let ratios = scale.trusted().expect("the mass loads both joints");
        for ratio in ratios {
            let constant = 1.5 / f64::from(ratio.ratio);
            let sigma = constant * f64::from(ratio.sigma / ratio.ratio);
            println!("seed {seed}: {constant:.4} N m/A, sigma {sigma:.4}");
            // Expected 1.8 N m/A within 1 %: four sigma of 0.22 %.
            assert!((constant / 1.8 - 1.0).abs() < 0.01, "{constant}");
        }
        let corrected = corrected.expect("a correction");
        assert!(corrected.verdict.is_accepted());
        // Among 39 errors in sigma, one beyond 4 has a probability of 0.2 %.
        let worst = worst_pull(&corrected.solver.estimate());
        assert!(worst < 4.0, "{worst}");
    }
}

#[test]
fn different_constants_of_the_joints_are_each_identified() {
    let run = first_run([0.8, 1.15], 4);
    let (scale, corrected) = corrected(&run, &ON_THE_KNEE);
    let ratios = scale.trusted().expect("the mass loads both joints").map(|ratio| f64::from(ratio.ratio));
    assert!((ratios[0] * 0.8 - 1.0).abs() < 0.01 && (ratios[1] * 1.15 - 1.0).abs() < 0.01, "{ratios:?}");
    let corrected = corrected.expect("a correction");
    assert!(corrected.verdict.is_accepted(), "{:?}", corrected.verdict.reasons().collect::<Vec<_>>());
    assert!(worst_pull(&corrected.solver.estimate()) < 4.0);
}

#[test]
fn a_wrong_mass_scales_the_result_a_wrong_position_is_detected() {
    let run = first_run([1.0; JOINTS], 5);
    let (heavy, _) = corrected(&run, &Payload { mass: 5.5, ..ON_THE_KNEE });
    for ratio in heavy.trusted().expect("nothing contradicts") {
        assert!((f64::from(ratio.ratio) * 1.1 - 1.0).abs() < 0.01, "10 % of mass are 10 % of the constant");
    }
    let far = Payload { position: Vector3::new(0.3, 0.0, 0.0), ..ON_THE_KNEE };
    let (contradicted, corrected) = corrected(&run, &far);
    assert!(contradicted.trusted().is_none() && corrected.is_none());
}

#[test]
fn a_mass_on_the_thigh_measures_the_hip_alone_without_correction() {
    let run = first_run([1.2; JOINTS], 6);
    let thigh = Payload { joint: 0, mass: 5.0, position: Vector3::new(0.3, 0.0, 0.0) };
    let scale = second_run(&run.pair, &thigh, &thigh);
    let hip = scale.ratios[0].expect("felt");
    assert!((f64::from(hip.ratio) * 1.2 - 1.0).abs() < 0.02, "{}", hip.ratio);
    assert!(scale.ratios[1].is_none() && scale.trusted().is_none());
}

#[test]
fn a_model_with_a_known_load_predicts_like_one_identified_with_it() {
    let load = Payload { joint: 1, mass: 3.0, position: Vector3::new(0.3, 0.02, 0.0) };
    let pair = identified();
    let model = pair.leg.control().model().expect("accepted");
    let mut carrying = enabled(&default_leg(), 1);
    carrying.world.attach(load.joint, load.mass, load.position.into());
    let plant = carrying.world.clone();
    assert!(identify(&mut carrying).is_some_and(Verdict::is_accepted));
    let again = carrying.leg.control().model().expect("accepted");
    let [without, with, identified_again] =
        [*model, model.with_load(&load.convert()), *again].map(|model| prediction_error(&model, &plant));
    println!("N m rms without {without:?}, added {with:?}, identified again {identified_again:?}");
    for joint in 0..JOINTS {
        // Both are estimates at one noise level; they may differ by that noise, but not by several times it.
        assert!(with[joint] < 2.0 * identified_again[joint], "joint {joint}");
        assert!(without[joint] > 10.0 * with[joint], "the load has too small an effect for this test");
    }
}

/// Root mean square of predicted minus noise-free torque over the 3 s gait, where the joint moves.
fn prediction_error(model: &IdentifiedModel<JOINTS>, plant: &World<JOINTS>) -> [f64; JOINTS] {
    let motion = context().motions.validation[1];
    let mut squares = [(0.0, 0_u32); JOINTS];
    for tick in (motion.blend_ticks()..motion.duration_ticks() - motion.blend_ticks()).step_by(40) {
        let state = motion.state_at(tick);
        let (q, qd, qdd) = (state.position_rad, state.velocity_rad_per_s, state.acceleration_rad_per_s2);
        // The knee's chain angle is minus the anatomical one.
        let anatomical = |values: [f32; JOINTS]| [f64::from(values[0]), -f64::from(values[1])];
        let real = plant.inverse_dynamics(&anatomical(q), &anatomical(qd), &anatomical(qdd));
        let predicted = model.torques(&q, &qd, &qdd, context().gravity);
        for (joint, (sum, count)) in squares.iter_mut().enumerate() {
            if qd[joint].abs() > 0.05 {
                let error = anatomical(predicted)[joint] - real[joint];
                *sum += error * error;
                *count += 1;
            }
        }
    }
    squares.map(|(sum, count)| scarab::real::sqrt(sum / f64::from(count.max(1))))
}

#[test]
fn the_firmware_of_a_right_leg_refuses_to_drive_a_left_one() {
    let left = on_side(&default_leg(), BodySide::Left).expect("parallel axes");
    let mut pair = Pair::new(&left, context(), 1).expect("the firmware accepts the default leg");
    // A bent leg reads as bent backwards, outside its range.
    assert!(!pair.enable(context().gravity) && !is_enabled(&pair));
}
