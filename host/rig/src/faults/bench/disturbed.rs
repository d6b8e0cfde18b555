//! H2, H3, H4: identifications of a leg that the wearer pushes, whose foot touches the floor, or that differs
//! from the firmware's configuration. Ideal drives: only the result of the identification is judged.
//!
//! A run counts as missed if a model is accepted whose torque error on an unseen motion exceeds
//! [`HARMFUL_PERCENT`] of the mean. It counts as detected if the result is refused, or if rows are excluded
//! and the remaining model is good. A good model without any detection means that the disturbance was
//! negligible. The report states which case it was.

use hal_sim::world::World;
use rayon::prelude::*;
use scarab::ident::{Estimator, Reason, Verdict};
use scarab::leg::IdentifiedModel;
use scarab::model::AnatomicalJoint;
use scarab::servo::TorqueModel;
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::geometry::anatomy;
use scarab_identify::formats::leg_file::{LegFile, PushesFile};

use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::Fault;
use crate::faults::run::Outcome;
use crate::options::SimulationOptions;
use crate::pair::{Context, torque_at};
use crate::perturb::{self, Perturbation};
use crate::simulate::drive;
use scarab::model::planar::{BASE, JOINTS};

/// Twice the limit for an undisturbed identification.
const HARMFUL_PERCENT: f64 = 3.0;
/// Speed below which a row is not counted.
const SLOW_RAD_PER_S: f32 = 0.05;
/// Share of excluded rows above which a motion counts as disturbed; an undisturbed one has less.
const NOTICED_SHARE: f32 = 0.005;

/// Leg, disturbances, magnitude.
type Drawn = (LegFile, Vec<Perturbation>, Option<f64>);

pub(super) fn run(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let draw = match fault.id {
        "H2" => pushed,
        "H3" => other,
        _ => touching,
    };
    let one = |seed: &u64| {
        let (leg, perturbations, magnitude) = draw(&mut Random::new(fault.id, *seed), leg);
        judge(fault, &leg, perturbations, magnitude, *seed, blind)
    };
    seeds.par_iter().map(one).collect()
}

fn judge(
    fault: &Fault,
    leg: &LegFile,
    perturbations: Vec<Perturbation>,
    magnitude: Option<f64>,
    seed: u64,
    blind: bool,
) -> Result<Outcome, ToolError> {
    let estimator = if blind { Estimator::Plain } else { Estimator::Robust };
    let options = SimulationOptions { perturbations, estimator, ..SimulationOptions::with_seed(seed) };
    let wrong = options.perturbations.as_slice();
    let (believed, simulated) = (perturb::believed(leg, wrong)?, perturb::simulated(leg, wrong)?);
    let mut context = Context::<JOINTS, BASE>::new(&believed, &options)?;
    perturb::configure(&mut context, wrong)?;
    let pair = drive(leg, &simulated, &context, &options, &mut ())?.pair;
    let model = if blind {
        // Any result, from an estimate with equal weights: as without weights and verdict.
        let finding = pair.leg.identification();
        let found = finding.solver().filter(|_| finding.verdict().is_some());
        found.map(|solver| IdentifiedModel::new(finding.model(), &solver.estimate().values))
    } else {
        pair.leg.control().model().copied()
    };
    let anatomy = anatomy(&believed)?;
    let error = model.map(|model| error_percent(&anatomy, &context, &pair.world, &model));
    let shares = pair.leg.identification().solver().map(|solver| solver.record().outliers.disturbed_share);
    let noticed = shares.is_some_and(|shares| shares.iter().any(|share| *share > NOTICED_SHARE));
    let harmless = error.is_some_and(|error| error <= HARMFUL_PERCENT);
    let state = match error {
        // A different leg must be refused, whatever rows are excluded.
        Some(_) => (harmless && noticed && fault.id != "H3").then_some("Limit"),
        None => Some(refused(fault, pair.leg.identification().verdict())),
    };
    let seen = state.is_some();
    let mut found = outcome(fault, seed, state);
    found.undetectable = harmless && !seen;
    found.magnitude = magnitude;
    found.hash = format!("{:016x}", error.unwrap_or(-1.0).to_bits());
    Ok(found)
}

/// State where no model is in use; for foot contact, whether contact is among the reasons.
fn refused(fault: &Fault, verdict: Option<Verdict>) -> &'static str {
    match verdict {
        Some(verdict) if fault.id == "H4" && verdict.has(Reason::Contact) => "refused: contact",
        _ => "refused",
    }
}

/// Error of a model's torque on the predicted motions against the present leg, in percent of the mean, for
/// the worse joint. Rows with a nearly resting joint are excluded, since dry friction is undetermined there.
fn error_percent(
    anatomy: &[AnatomicalJoint<f64>; JOINTS],
    context: &Context<JOINTS, BASE>,
    world: &World<JOINTS>,
    model: &IdentifiedModel<JOINTS>,
) -> f64 {
    let (mut error, mut mean) = ([0.0; JOINTS], [0.0; JOINTS]);
    for motion in context.motions.validation {
        for tick in (0..motion.duration_ticks()).step_by(40) {
            let state = motion.state_at(tick);
            let (q, qd, qdd) = (state.position_rad, state.velocity_rad_per_s, state.acceleration_rad_per_s2);
            if qd.iter().any(|speed| speed.abs() < SLOW_RAD_PER_S) {
                continue;
            }
            let truth = torque_at(anatomy, world, &state);
            let predicted = model.torques(&q, &qd, &qdd, context.gravity);
            for joint in 0..JOINTS {
                error[joint] += (anatomy[joint].from_chain(f64::from(predicted[joint])) - truth[joint]).abs();
                mean[joint] += truth[joint].abs();
            }
        }
    }
    (0..JOINTS).map(|joint| 100.0 * error[joint] / mean[joint]).fold(0.0, f64::max)
}

fn pushed(random: &mut Random, leg: &LegFile) -> Drawn {
    let mut leg = leg.clone();
    let torque = random.logarithmic(0.5, 40.0);
    leg.pushes = Some(PushesFile {
        per_minute: random.logarithmic(2.0, 60.0),
        torque_nm: torque,
        duration_s: random.uniform(0.1, 1.5),
    });
    (leg, Vec::new(), Some(torque))
}

fn touching(random: &mut Random, leg: &LegFile) -> Drawn {
    let seconds = random.logarithmic(0.1, 10.0);
    (leg.clone(), vec![Perturbation::Contact(seconds)], Some(seconds))
}

fn other(random: &mut Random, leg: &LegFile) -> Drawn {
    let joint = || (1 + usize::from(leg.joints.len() > 1)).to_string();
    let first = random.coin();
    let named = if first { "1".to_owned() } else { joint() };
    let wrong = match random.below(6) {
        0 => Perturbation::Swap,
        1 => Perturbation::Sign(named),
        2 => Perturbation::Stuck(named),
        3 => Perturbation::AddedMass(random.logarithmic(0.1, 10.0)),
        4 => Perturbation::Length(random.uniform(0.7, 1.4)),
        _ => Perturbation::Zero(random.sign() * random.uniform(2.0, 20.0), Some(named)),
    };
    (leg.clone(), vec![wrong], None)
}
