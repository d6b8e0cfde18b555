//! The command line.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use scarab::ident::Plan;

use super::error::{EXIT_ACCEPTED, EXIT_INPUT, EXIT_REFUSED, ToolError};
use super::leg_file::{DEFAULT_LEG, LegFile};
use super::replay::{ReplayOptions, replay};
use super::report::RunReport;
use super::setup::PriorChoice;
use super::tables;
use crate::with_leg_size;

/// Identifies legs, simulated or recorded. Exit codes: 0 accepted, 3 refused, 2 bad input.
#[derive(Parser, Debug)]
#[command(name = "scarab-sim", version)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Identify a leg from recordings.
    Replay(ReplayArguments),
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
    /// Write the report here.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Print all fourteen parameters of every joint with their status.
    #[arg(long)]
    parameters: bool,
}

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
    #[arg(long)]
    split: Option<f64>,
    /// Where the low-pass of the filter chain is 3 dB down, Hz.
    #[arg(long, default_value_t = super::setup::DEFAULT_BANDWIDTH_HZ)]
    bandwidth: f64,
    /// Write measured and predicted torque of the validation part here.
    #[arg(long)]
    csv: Option<PathBuf>,
}

/// Runs the tool on the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let outcome = match cli.command {
        Some(Command::Replay(arguments)) => run_replay(&arguments),
        None => Err(ToolError::input("not yet")),
    };
    match outcome {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(EXIT_INPUT)
        }
    }
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
        bandwidth_hz: arguments.bandwidth,
        plan: arguments.common.plan.into(),
        prior: arguments.common.prior.unwrap_or_default(),
        swarm_seed: arguments.common.swarm_seed.unwrap_or(super::setup::DEFAULT_SEED),
        csv: arguments.csv.clone(),
    };
    let run = with_leg_size!(leg, replay(leg, options))?;
    finish(&run, &arguments.common)
}

fn finish(run: &RunReport, common: &Common) -> Result<u8, ToolError> {
    if let Some(path) = &common.json {
        write_json(path, run)?;
    }
    tables::print_run(run);
    if common.parameters {
        println!("\n{}", tables::parameters(run));
    }
    Ok(if run.accepted() { EXIT_ACCEPTED } else { EXIT_REFUSED })
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), ToolError> {
    let mut text =
        serde_json::to_string_pretty(value).map_err(|error| ToolError::cannot_write(path, &error))?;
    text.push('\n');
    std::fs::write(path, text).map_err(|error| ToolError::cannot_write(path, &error))
}
