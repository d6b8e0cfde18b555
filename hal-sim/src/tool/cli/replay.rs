//! `replay`: identifies a leg from recordings.

use std::path::{Path, PathBuf};

use clap::Args;

use super::common::{Common, draw, finish};
use super::model::ModelArguments;
use crate::tool::error::ToolError;
use crate::tool::files::{Input, Output};
use crate::tool::replay::{ReplayOptions, replay};
use crate::tool::setup::DEFAULT_SEED;
use crate::tool::tables;
use crate::with_leg_size;

/// Recordings, and outputs.
#[derive(Args, Debug)]
pub struct ReplayArguments {
    /// Recordings: t_s, q1_rad[, q2_rad..], tau1_Nm[, tau2_Nm..]; several are one training set.
    #[arg(required = true)]
    files: Vec<Input>,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    model: ModelArguments,
    /// Held-out recordings.
    #[arg(long, num_args = 1.., conflicts_with = "split")]
    validate: Vec<Input>,
    /// The first fraction of each file trains, the rest validates.
    #[arg(long, allow_negative_numbers = true)]
    split: Option<f64>,
    /// -3 dB frequency of the filter chain's low-pass, Hz; the leg file's (8 by default) unless given.
    #[arg(long, allow_negative_numbers = true)]
    bandwidth: Option<f64>,
    /// Write measured and predicted torque of the validation part here.
    #[arg(long)]
    csv: Option<Output>,
}

fn paths(files: &[Input]) -> Vec<PathBuf> {
    files.iter().map(|file| file.to_path_buf()).collect()
}

/// Identifies and reports; returns the exit code.
pub fn run(arguments: &ReplayArguments) -> Result<u8, ToolError> {
    arguments.common.leg.require("cargo sim replay run.csv --leg my-leg.toml")?;
    let leg = &arguments.common.leg()?;
    if arguments.split.is_some_and(|fraction| !(fraction > 0.0 && fraction < 1.0)) {
        return Err(ToolError::input("--split: a fraction above 0 and below 1"));
    }
    let options = &ReplayOptions {
        files: paths(&arguments.files),
        validate: paths(&arguments.validate),
        split: arguments.split,
        bandwidth_hz: arguments.bandwidth.unwrap_or(leg.bandwidth_hz),
        plan: arguments.common.plan.into(),
        prior: arguments.common.prior.unwrap_or_default(),
        estimator: arguments.common.estimator.into(),
        swarm_seed: arguments.common.swarm_seed.unwrap_or(DEFAULT_SEED),
        csv: arguments.csv.as_deref().map(Path::to_owned),
    };
    let kept = arguments.model.kept(leg)?;
    let mut replayed = with_leg_size!(leg, replay(leg, options))?;
    arguments.model.compare(kept.as_ref(), &mut replayed.run);
    let code = finish(&replayed.run, &arguments.common, &tables::sources(&replayed.sources))?;
    draw(leg, &arguments.common, &replayed.run, &replayed.series, &replayed.sources)?;
    arguments.model.save(leg, &replayed.run, options.bandwidth_hz)?;
    Ok(code)
}
