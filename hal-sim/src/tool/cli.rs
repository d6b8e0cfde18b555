//! The command line.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use scarab::ident::Plan;

use super::error::{EXIT_ACCEPTED, EXIT_INPUT, EXIT_REFUSED, ToolError};
use super::identify::{identify_many, identify_one, print_runs};
use super::leg_file::{DEFAULT_LEG, LegFile};
use super::regressor::{self, RegressorOptions};
use super::replay::{ReplayOptions, replay};
use super::report::RunReport;
use super::setup::{DEFAULT_SEED, PriorChoice};
use super::simulate::SimulationOptions;
use super::tables;
use crate::with_leg_size;

/// Identifies legs, simulated or recorded. Exit codes: 0 accepted, 3 refused, 2 bad input.
#[derive(Parser, Debug)]
#[command(name = "scarab-sim", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Identify a simulated leg: drive it, log it, solve, validate, track.
    Identify(IdentifyArguments),
    /// Identify a leg from recordings.
    Replay(ReplayArguments),
    /// Print torques and regressor of given states: rigid bodies only, CSV.
    Regressor(RegressorArguments),
}

/// How parameters are found from the joints' rows.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum PlanArgument {
    /// All joints at once, weighted by their noise.
    OneTime,
    /// Distal joint first, then substitution.
    Sequential,
}

impl From<PlanArgument> for Plan {
    fn from(plan: PlanArgument) -> Self {
        match plan {
            PlanArgument::OneTime => Self::OneTime,
            PlanArgument::Sequential => Self::Sequential,
        }
    }
}

/// What identification and replay have in common.
#[derive(Args, Debug)]
struct Common {
    /// Name of a shipped leg, or a leg file.
    #[arg(long, default_value = DEFAULT_LEG)]
    leg: String,
    /// Of the swarm's random numbers.
    #[arg(long)]
    swarm_seed: Option<u64>,
    /// One-time or sequential.
    #[arg(long, value_enum, default_value = "one-time")]
    plan: PlanArgument,
    /// none, file, or wrong:PERCENT; the leg file's unless given.
    #[arg(long)]
    prior: Option<PriorChoice>,
    /// Write the report here, for exit codes 0 and 3.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Print all fourteen parameters of every joint with their status.
    #[arg(long)]
    parameters: bool,
}

#[derive(Args, Debug)]
struct IdentifyArguments {
    #[command(flatten)]
    common: Common,
    /// Of noise, pushes and a wrong prior.
    #[arg(long, conflicts_with = "seeds")]
    seed: Option<u64>,
    /// A run for each seed, A..B with both ends.
    #[arg(long, value_parser = parse_seeds, conflicts_with = "log")]
    seeds: Option<(u64, u64)>,
    /// Noise of the logged torque in percent of each joint's mean absolute torque; the leg file's unless given.
    #[arg(long)]
    torque_noise: Option<f64>,
    /// Write the training motion here, in the format that replay reads.
    #[arg(long)]
    log: Option<PathBuf>,
    /// Draw the run into this directory, as SVG; a run without any arguments draws into target/sim.
    #[arg(long, conflicts_with = "seeds")]
    figures: Option<PathBuf>,
}

/// Where a run without any arguments is drawn.
const DEFAULT_FIGURES: &str = "target/sim";

fn parse_seeds(text: &str) -> Result<(u64, u64), String> {
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

/// More runs at once are a mistake.
const LARGEST_SEED_COUNT: u64 = 100_000;

#[derive(Args, Debug)]
struct ReplayArguments {
    /// Recordings: t_s, q1_rad[, q2_rad..], tau1_Nm[, tau2_Nm..]; several are one training set.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    #[command(flatten)]
    common: Common,
    /// Held-out recordings.
    #[arg(long, num_args = 1.., conflicts_with = "split")]
    validate: Vec<PathBuf>,
    /// The first fraction of each file trains, the rest validates.
    #[arg(long, allow_negative_numbers = true)]
    split: Option<f64>,
    /// Where the low-pass of the filter chain is 3 dB down, Hz; the leg file's (8 unless it says otherwise) unless given.
    #[arg(long, allow_negative_numbers = true)]
    bandwidth: Option<f64>,
    /// Write measured and predicted torque of the validation part here.
    #[arg(long)]
    csv: Option<PathBuf>,
}

#[derive(Args, Debug)]
struct RegressorArguments {
    /// Name of a shipped leg, or a leg file.
    #[arg(long, default_value = DEFAULT_LEG)]
    leg: String,
    /// States: columns q1.., qd1.., qdd1.. in rad and s, D-H angles.
    #[arg(long)]
    states: PathBuf,
    /// Compute in the device's single precision.
    #[arg(long)]
    f32: bool,
}

/// Runs the tool on the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    let mut words: Vec<_> = std::env::args_os().collect();
    match words.get(1).and_then(|word| word.to_str()) {
        // Without a subcommand the main job is meant.
        None => words.extend(["identify", "--figures", DEFAULT_FIGURES].map(Into::into)),
        Some(option) if option.starts_with("--") && !["--help", "--version"].contains(&option) => {
            words.insert(1, "identify".into());
        }
        Some(_) => {}
    }
    let outcome = match Cli::parse_from(words).command {
        Command::Replay(arguments) => run_replay(&arguments),
        Command::Regressor(arguments) => run_regressor(&arguments),
        Command::Identify(arguments) => run_identify(&arguments),
    };
    match outcome {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(EXIT_INPUT)
        }
    }
}

fn run_identify(arguments: &IdentifyArguments) -> Result<u8, ToolError> {
    let leg = &LegFile::load(&arguments.common.leg)?;
    if arguments.torque_noise.is_some_and(|percent| !(0.0..=1000.0).contains(&percent)) {
        return Err(ToolError::input("--torque-noise: a percentage from 0 to 1000"));
    }
    let options = |seed: u64| SimulationOptions {
        seed,
        swarm_seed: arguments.common.swarm_seed.unwrap_or(seed),
        torque_noise_percent: arguments.torque_noise,
        plan: arguments.common.plan.into(),
        prior: arguments.common.prior.unwrap_or_default(),
        with_series: false,
    };
    let Some((first, last)) = arguments.seeds else {
        let options = &options(arguments.seed.unwrap_or(DEFAULT_SEED));
        let (log, figures) = (arguments.log.as_deref(), arguments.figures.as_deref());
        let run = with_leg_size!(leg, identify_one(leg, options, log, figures))?;
        let code = finish(&run, &arguments.common, "");
        if let Some(directory) = figures {
            tables::print(&format!("figures: {}\n", directory.display()))?;
        }
        return code;
    };
    let options: &Vec<_> = &(first..=last).map(options).collect();
    let runs = with_leg_size!(leg, identify_many(leg, options))?;
    if let Some(path) = &arguments.common.json {
        write_json(path, &runs)?;
    }
    print_runs(&runs)?;
    Ok(if runs.runs.iter().all(RunReport::accepted) { EXIT_ACCEPTED } else { EXIT_REFUSED })
}

fn run_replay(arguments: &ReplayArguments) -> Result<u8, ToolError> {
    let leg = &LegFile::load(&arguments.common.leg)?;
    if arguments.split.is_some_and(|fraction| !(fraction > 0.0 && fraction < 1.0)) {
        return Err(ToolError::input("--split: a fraction above 0 and below 1"));
    }
    let options = &ReplayOptions {
        files: arguments.files.clone(),
        validate: arguments.validate.clone(),
        split: arguments.split,
        bandwidth_hz: arguments.bandwidth.unwrap_or(leg.bandwidth_hz),
        plan: arguments.common.plan.into(),
        prior: arguments.common.prior.unwrap_or_default(),
        swarm_seed: arguments.common.swarm_seed.unwrap_or(DEFAULT_SEED),
        csv: arguments.csv.clone(),
    };
    let replayed = with_leg_size!(leg, replay(leg, options))?;
    finish(&replayed.run, &arguments.common, &tables::sources(&replayed.sources))
}

fn run_regressor(arguments: &RegressorArguments) -> Result<u8, ToolError> {
    let leg = LegFile::load(&arguments.leg)?;
    let options = RegressorOptions { states: arguments.states.clone(), single_precision: arguments.f32 };
    tables::print(&regressor::table(&leg, &options)?)?;
    Ok(EXIT_ACCEPTED)
}

/// Writes and prints what was found; `preface` stands before it.
fn finish(run: &RunReport, common: &Common, preface: &str) -> Result<u8, ToolError> {
    if let Some(path) = &common.json {
        write_json(path, run)?;
    }
    tables::print(preface)?;
    tables::print_run(run)?;
    if common.parameters {
        tables::print(&format!("\n{}", tables::parameters(run)))?;
    }
    Ok(if run.accepted() { EXIT_ACCEPTED } else { EXIT_REFUSED })
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), ToolError> {
    let mut text =
        serde_json::to_string_pretty(value).map_err(|error| ToolError::cannot_write(path, &error))?;
    text.push('\n');
    std::fs::write(path, text).map_err(|error| ToolError::cannot_write(path, &error))
}
