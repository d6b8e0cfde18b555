//! `identify`: a simulated leg from excitation to verdict.

use clap::Args;
use scarab::model::Payload;
use scarab_base::error::{EXIT_ACCEPTED, EXIT_REFUSED, ToolError};
use scarab_base::shard::Shard;
use scarab_identify::formats::excitation::Excitation;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::shard::{Argument, CampaignHeader, ShardResults};
use scarab_identify::leg::placed_mass::PlacedMass;
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_identify::report::{RunReport, RunsReport, SCHEMA};
use scarab_rig::excite::run::check;
use scarab_rig::identify::{identify_many, identify_one};
use scarab_rig::options::{DriveModel, SimulationOptions};
use scarab_rig::perturb::Perturbation;
use serde::{Deserialize, Serialize};

use crate::cli::arguments::{Choice, Input, Output, one_of};
use crate::cli::common::{Common, draw, draw_runs, finish, program, write_json};
use crate::cli::model::ModelArguments;
use crate::cli::noise::NoiseOptions;
use crate::view::runs::print_runs;

/// Leg to be identified, and outputs.
#[derive(Args, Debug)]
pub(crate) struct IdentifyArguments {
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    model: ModelArguments,
    /// Seed of noise, pushes and a wrong prior.
    #[arg(long, conflicts_with = "seeds")]
    seed: Option<u64>,
    /// A run for each seed, A..B with both ends.
    #[arg(long, value_parser = parse_seeds, conflicts_with_all = ["log", "save_model", "compare_model"], help_heading = "Simulation")]
    seeds: Option<(u64, u64)>,
    /// Only the runs of shard I of N, from 1, into --json; `merge` joins all of them.
    #[arg(long, value_name = "I/N", requires_all = ["seeds", "json"], conflicts_with_all = ["figures", "report"], help_heading = "Simulation")]
    shard: Option<Shard>,
    #[command(flatten)]
    noise: NoiseOptions,
    /// Ideal currents, or motors, bridges and sensors under the board's current loops.
    #[arg(long, value_parser = one_of(DRIVES), default_value = "ideal", help_heading = "Simulation")]
    drive: DriveModel,
    /// Identify again with a known mass, KG@JOINT:X_M[:Y_M] (JOINT: name or number; X along the
    /// link): determines the torque constants.
    #[arg(long, help_heading = "Simulation")]
    payload: Option<PlacedMass>,
    /// Known mass that the leg carries all the time, in the same format; the parameters are those
    /// of the leg without it.
    #[arg(long, help_heading = "Simulation")]
    load: Option<PlacedMass>,
    /// Inject a deliberate error to test the verdict: NAME or NAME=VALUE, repeatable.
    #[arg(long, value_name = "NAME[=VALUE]", help_heading = "Simulation")]
    perturb: Vec<Perturbation>,
    /// Excite with this motion (from `excite`) instead of the default one.
    #[arg(long, help_heading = "Simulation")]
    excitation: Option<Input>,
    /// Write the training motion here, in the format that replay reads.
    #[arg(long, help_heading = "Output")]
    log: Option<Output>,
}

/// Kinds of simulated drives.
pub(super) const DRIVES: &[Choice<DriveModel>] = &[
    ("ideal", DriveModel::Ideal, "A current that follows its target with a lag"),
    (
        "full",
        DriveModel::Full,
        "Motor, inverter, current and angle sensors, supply; needs `[joint.motor]` in the leg file",
    ),
];

pub(super) fn parse_seeds(text: &str) -> Result<(u64, u64), String> {
    let ends = text
        .split_once("..")
        .map(|(first, last)| (first.parse::<u64>(), last.trim_start_matches('=').parse::<u64>()));
    match ends {
        Some((Ok(first), Ok(last))) if first <= last && last - first < LARGEST_SEED_COUNT => {
            Ok((first, last))
        }
        Some((Ok(first), Ok(last))) if first <= last => Err(format!("at most {LARGEST_SEED_COUNT} runs")),
        _ => Err(format!("`{text}` is not A..B with A at most B")),
    }
}

/// Limit of the runs at once.
const LARGEST_SEED_COUNT: u64 = 100_000;

/// Identifies and reports; returns the exit code.
pub(crate) fn run(arguments: &IdentifyArguments, stated: Vec<Argument>) -> Result<u8, ToolError> {
    let leg = &arguments.noise.on(arguments.common.leg()?)?;
    let torque_noise_percent = arguments.noise.percent()?;
    let on_leg = |mass: &Option<PlacedMass>, option: &str| -> Result<Option<Payload<f64>>, ToolError> {
        mass.as_ref().map(|mass| mass.on(leg, option)).transpose()
    };
    let payload = on_leg(&arguments.payload, "--payload")?;
    let load = on_leg(&arguments.load, "--load")?;
    if (payload.is_some() || load.is_some()) && arguments.perturb.iter().any(Perturbation::tampers) {
        return Err(ToolError::input(
            "--perturb inertia and com change the validated values, and --payload and --load replace them: \
             give one of the two",
        ));
    }
    let excitation = arguments.excitation.as_deref().map(Excitation::load).transpose()?;
    if let (Some(motion), Some(file)) = (&excitation, &arguments.excitation) {
        // Checked without and with the mass of the second run.
        let carried: &Vec<_> = &load.into_iter().collect();
        check(leg, file, motion, carried)?;
        if let Some(payload) = payload {
            let carried = &load.into_iter().chain([payload]).collect::<Vec<_>>();
            check(leg, file, motion, carried)?;
        }
    }
    let options = |seed: u64| SimulationOptions {
        seed,
        swarm_seed: arguments.common.swarm_seed.unwrap_or(seed),
        torque_noise_percent,
        drive: arguments.drive,
        plan: arguments.common.plan,
        prior: arguments.common.prior.unwrap_or_default(),
        payload,
        load,
        estimator: arguments.common.estimator,
        with_series: arguments.common.is_drawn() && arguments.seeds.is_none(),
        perturbations: arguments.perturb.clone(),
        excitation: excitation.clone(),
    };
    let Some((first, last)) = arguments.seeds else {
        return run_once(arguments, leg, &options(arguments.seed.unwrap_or(DEFAULT_SEED)));
    };
    let program = program();
    let campaign =
        CampaignHeader { command: "identify".into(), arguments: stated, leg: Some(leg.clone()), program };
    let shard = arguments.shard.unwrap_or(Shard::WHOLE);
    let seeds: Vec<u64> = (first..=last).collect();
    let options: &Vec<_> = &shard.part(&seeds).iter().copied().map(options).collect();
    let runs = identify_many(leg, options)?;
    let part = ShardResults::new(shard, SeedRuns { runs });
    if let (Some(_), Some(path)) = (arguments.shard, &arguments.common.json) {
        return part.write(path, &campaign, &format!("{} of {} runs", options.len(), seeds.len()));
    }
    conclude(arguments, &campaign, vec![part])
}

/// Identifies once and reports; returns the exit code.
fn run_once(
    arguments: &IdentifyArguments,
    leg: &LegFile,
    options: &SimulationOptions,
) -> Result<u8, ToolError> {
    let log = arguments.log.as_deref();
    let kept = arguments.model.kept(leg)?;
    let (mut run, series) = identify_one(leg, options, log)?;
    arguments.model.compare(kept.as_ref(), &mut run);
    let code = finish(leg, &run, &arguments.common, "")?;
    draw(leg, &arguments.common, &run, &series, &[])?;
    arguments.model.save(leg, &run, leg.bandwidth_hz)?;
    Ok(code)
}

/// Results of a shard: its runs, in the order of their seeds.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct SeedRuns {
    runs: Vec<RunReport>,
}

/// Reports the runs of all shards; returns the exit code.
pub(super) fn conclude(
    arguments: &IdentifyArguments,
    campaign: &CampaignHeader,
    parts: Vec<ShardResults<SeedRuns>>,
) -> Result<u8, ToolError> {
    let seeds: Vec<u64> = arguments.seeds.into_iter().flat_map(|(first, last)| first..=last).collect();
    for part in &parts {
        let (due, runs) = (part.shard.part(&seeds), &part.results.runs);
        part.check_count("runs", runs.len(), seeds.len())?;
        if let Some((run, due)) = runs.iter().zip(due).find(|(run, due)| run.seed != Some(**due)) {
            return Err(part.damaged(&format!("a run of seed {}, {due} is due", run.seed.unwrap_or(0))));
        }
    }
    let runs = parts.into_iter().flat_map(|part| part.results.runs).collect();
    let report = RunsReport { schema: SCHEMA, runs };
    if let Some(path) = &arguments.common.json {
        write_json(path, &report)?;
    }
    print_runs(&report)?;
    draw_runs(campaign, &arguments.common, &report.runs)?;
    Ok(if report.runs.iter().all(RunReport::accepted) { EXIT_ACCEPTED } else { EXIT_REFUSED })
}
