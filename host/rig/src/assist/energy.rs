//! Energy that the leg gives to limp and resisting wearers, and what a leg does at rest.
//!
//! ```text
//! X(t)  = W(t) - (V(t) - V(0))        W: energy received through the cuffs, V: gravity energy of the limb
//! given = max over t1 < t2 of X(t2) - X(t1)
//! ```
//!
//! Each run draws a wearer with cuffs and neural delay, a payload of up to `LARGEST_PAYLOAD_KG` that no
//! model knows, and models at the surface of three sigma of their estimates, in a random direction. The leg
//! starts at rest in a random posture with the wearer limp or resisting. Energy of an earlier motion is thus
//! not counted as given.
//!
//! At rest: a wearer walks and then holds still. After `REST_S` the velocities of a drawn exoskeleton must
//! be below one encoder count per 0.1 s; otherwise the friction compensation keeps it moving.

use crate::report::assist::EnergyReport;
use hal_sim::wearer::muscles::Intention;
use hal_sim::world::TICK_S;
use rayon::prelude::*;
use scarab::ident::Estimate;
use scarab::leg::{AssistShares, IdentifiedModel};
use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_base::random::Random;
use scarab_base::stats::rms;
use scarab_identify::formats::leg_file::JointFile;
use scarab_identify::leg::exercise::{Exercise, hip_and_knee};

use super::draws;
use super::subject::{Models, Subject};
use super::trial::{Drives, LimbAlone, Stage};
use crate::options::SimulationOptions;
use crate::pair::Context;
use crate::worn::certain;

/// Largest payload at the shank, kg.
const LARGEST_PAYLOAD_KG: f64 = 2.0;
/// Standard deviations by which the models err.
const MODEL_ERROR_SIGMAS: f64 = 3.0;
/// Duration of an energy run, s.
const ENERGY_S: f64 = 12.0;
/// Walking and resting times before velocities are measured, and time of the measurement, s.
const WALK_S: f64 = 5.0;
const REST_S: f64 = 5.0;
const OBSERVED_S: f64 = 2.0;
/// Time in which a leg at rest moves by at most one encoder count, s.
const COUNT_S: f64 = 0.1;

/// Model at the surface of three sigma of an estimate, in a random direction of the base values.
fn mistaken<const B: usize>(
    context: &Context<2, B>,
    models: &Models<B>,
    random: &mut Random,
) -> IdentifiedModel<2> {
    let Estimate { values, covariance, .. } = &models.estimate;
    let direction: [f64; B] = core::array::from_fn(|base| {
        let sigma = f64::from(covariance[base][base]).sqrt();
        if sigma > 0.0 { random.normal() / sigma } else { 0.0 }
    });
    let moved: [f64; B] = core::array::from_fn(|row| {
        (0..B).map(|column| f64::from(covariance[row][column]) * direction[column]).sum()
    });
    let variance: f64 = moved.iter().zip(direction).map(|(moved, direction)| moved * direction).sum();
    let scale = if variance > 0.0 { MODEL_ERROR_SIGMAS / variance.sqrt() } else { 0.0 };
    let values = core::array::from_fn(|base| values[base] + (scale * moved[base]) as f32);
    let estimate = Estimate { values, ..models.estimate.clone() };
    IdentifiedModel::from_estimate(&context.configuration.model, &estimate)
}

/// Energy given in one run, J.
fn given<const B: usize>(subject: &Subject<B>, shares: AssistShares, seed: u64) -> Result<f64, ToolError> {
    let mut random = Random::new("energy", seed);
    let wearer = draws::wearer(&subject.bodies.person, seed);
    let mut wrong = |models: &Models<B>| mistaken(&subject.context, models, &mut random);
    let empty = wrong(&subject.empty);
    let worn = subject.worn.as_ref().map(&mut wrong);
    let limb = LimbAlone::new(subject, &wearer)?;
    let drives = match &worn {
        Some(worn) => Drives::Assist(shares, [&empty, worn]),
        None => Drives::AssistEmpty(shares, &empty),
    };
    let mut within = |joint: &JointFile| {
        let [low, high] = joint.range_deg;
        random.uniform(low + 0.15 * (high - low), high - 0.15 * (high - low)).to_radians()
    };
    let posture = hip_and_knee(&subject.exoskeleton).map(|joints| joints.map(&mut within));
    let mut stage = Stage::begin(subject, &wearer, drives, posture)?;
    stage.pair.world.attach(1, random.uniform(0.0, LARGEST_PAYLOAD_KG), [random.uniform(0.1, 0.4), 0.0, 0.0]);
    stage.intend(if random.coin() { Intention::Limp } else { Intention::Resist })?;
    Ok(stage.given(&limb, ENERGY_S))
}

/// Energy of many random runs against a budget, J.
///
/// # Errors
/// A wearer does not fit, or the firmware refuses a session.
pub(crate) fn energy<const B: usize>(
    subject: &Subject<B>,
    shares: &[AssistShares],
    runs: usize,
    budget_j: f64,
) -> Result<EnergyReport, ToolError> {
    let sessions: Vec<_> = shares.iter().cycle().zip(1..).take(runs).collect();
    let found = sessions
        .par_iter()
        .map(|(shares, seed)| given(subject, **shares, *seed))
        .collect::<Result<Vec<f64>, ToolError>>()?;
    Ok(EnergyReport {
        budget_j,
        worst_j: found.iter().copied().reduce(f64::max).map_or(Number::UNKNOWN, Number::from),
        runs: found.len(),
        exceeded: found.iter().filter(|given| **given > budget_j).count(),
    })
}

/// Whether a drawn exoskeleton still moves after a rest.
fn oscillates<const B: usize>(
    subject: &Subject<B>,
    shares: AssistShares,
    seed: u64,
) -> Result<bool, ToolError> {
    let exoskeleton = draws::exoskeleton(&subject.exoskeleton, seed);
    let context = Context::<2, B>::new(&exoskeleton, &SimulationOptions::with_seed(seed))?;
    let truth = context.background.truth.as_ref().ok_or_else(|| exoskeleton.error("has no `truth`"))?;
    let model = certain(&context, truth);
    let steps: Vec<f64> = exoskeleton.joints.iter().map(|joint| joint.encoder.step_rad()).collect();
    let motion = Exercise::Gait(0.8).intended(
        hip_and_knee(&exoskeleton).ok_or_else(|| exoskeleton.error("is not a hip and a knee"))?,
        seed,
    );
    let wearer = draws::wearer(&subject.bodies.person, seed);
    let drawn = Subject { exoskeleton: exoskeleton.clone(), context, seed, ..subject.clone() };
    let mut stage = Stage::begin(&drawn, &wearer, Drives::AssistEmpty(shares, &model), None)?;
    stage.intend(Intention::Follow(motion))?;
    stage.run(WALK_S);
    stage.intend(Intention::Resist)?;
    stage.run(REST_S);
    let velocities: Vec<[f64; 2]> = (0..(OBSERVED_S / TICK_S) as u64)
        .map(|_| {
            stage.tick();
            stage.pair.world.velocity()
        })
        .collect();
    let is_moving = |(joint, step): (usize, &f64)| {
        rms(velocities.iter().map(|velocity| velocity[joint])) > step / COUNT_S
    };
    Ok(steps.iter().enumerate().any(is_moving))
}

/// Drawn exoskeletons that still move after a rest.
///
/// # Errors
/// A wearer does not fit, or the firmware refuses a session.
pub(crate) fn limit_cycles<const B: usize>(
    subject: &Subject<B>,
    shares: AssistShares,
    legs: usize,
) -> Result<usize, ToolError> {
    let found = (1..=legs as u64)
        .into_par_iter()
        .map(|seed| oscillates(subject, shares, seed))
        .collect::<Result<Vec<bool>, ToolError>>()?;
    Ok(found.into_iter().filter(|oscillates| *oscillates).count())
}
