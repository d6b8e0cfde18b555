//! `replay`: identifies a leg from recordings.

use std::path::Path;
use std::str::FromStr;

use clap::Args;
use scarab_base::error::{FileError, ToolError};
use scarab_identify::formats::recording::import::Import;
use scarab_identify::formats::recording::{Read, Recording};
use scarab_identify::leg::placed_mass::PlacedMass;
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_identify::run::replay::{Recordings, ReplayOptions, replay};

use crate::cli::arguments::{Input, Output};
use crate::cli::common::{Common, draw, finish};
use crate::cli::import::ImportArguments;
use crate::cli::model::ModelArguments;
use crate::view::tables;

/// Recordings, and outputs.
#[derive(Args, Debug)]
pub(crate) struct ReplayArguments {
    /// Recordings, CSV (also .csv.gz): t_s, q1_rad[, q2_rad..], tau1_Nm[, tau2_Nm..]; several form one
    /// training set.
    #[arg(required = true)]
    files: Vec<Input>,
    #[command(flatten)]
    import: ImportArguments,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    model: ModelArguments,
    /// Recordings held out for validation.
    #[arg(long, num_args = 1.., conflicts_with = "split", help_heading = "Recordings")]
    validate: Vec<Input>,
    /// Share of each file that trains, above 0 and below 1; the rest validates.
    #[arg(long, allow_negative_numbers = true, help_heading = "Recordings")]
    split: Option<f64>,
    /// Frequency at which the filter chain's low-pass is 3 dB down, Hz. Default: that of the leg file, else
    /// 8. `auto`: the largest up to 16 Hz at which the encoders' steps are negligible.
    #[arg(long, value_name = "HZ|auto", allow_negative_numbers = true, help_heading = "Identification")]
    bandwidth: Option<Bandwidth>,
    /// Error of a held-out torque that is accepted beside noise, percent of its rms, 0 to 70. Default: that
    /// of the leg file, else 5. Where noise does not explain the misfit, the error may also be at most twice
    /// that of the training part plus 5 %.
    #[arg(long, value_name = "PERCENT", allow_negative_numbers = true, help_heading = "Identification")]
    accept_error: Option<f64>,
    /// Remove this delay of the torque against the angle, ms: one value, or one for each joint, by comma.
    #[arg(
        long,
        value_name = "MS",
        value_delimiter = ',',
        allow_negative_numbers = true,
        help_heading = "Identification"
    )]
    torque_delay: Vec<f64>,
    /// Known mass that the leg carries in every recording, KG@JOINT:X_M[:Y_M]. The parameters are those of
    /// the leg without it.
    #[arg(long, help_heading = "Recordings")]
    load: Option<PlacedMass>,
    /// Known mass that the leg carries in the recordings of --with-payload, in the same format; it determines
    /// the scale of the torques.
    #[arg(long, requires = "with_payload", help_heading = "Recordings")]
    payload: Option<PlacedMass>,
    /// Recordings with the mass of --payload.
    #[arg(long, num_args = 1.., requires = "payload", help_heading = "Recordings")]
    with_payload: Vec<Input>,
    /// Write measured and predicted torque of the validation part as CSV here.
    #[arg(long, help_heading = "Output")]
    csv: Option<Output>,
}

/// Requested bandwidth.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bandwidth {
    Auto,
    Hertz(f64),
}

impl FromStr for Bandwidth {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        text.parse().map(Self::Hertz).map_err(|_| "must be a number of Hz, or `auto`".into())
    }
}

fn read(files: &[Input], import: &Import) -> Result<Vec<Read>, FileError> {
    files.iter().map(|file| Recording::read(file, import)).collect()
}

/// Identifies and reports; returns the exit code.
pub fn run(arguments: &ReplayArguments) -> Result<u8, ToolError> {
    arguments.common.leg.require("replay run.csv --leg my-leg.toml")?;
    let leg = &arguments.common.leg()?;
    let import = &arguments.import.import(leg, arguments.common.leg.name())?;
    let options = &ReplayOptions {
        split: arguments.split,
        bandwidth_hz: match arguments.bandwidth {
            Some(Bandwidth::Hertz(hz)) => hz,
            _ => leg.bandwidth_hz,
        },
        chooses_bandwidth: arguments.bandwidth == Some(Bandwidth::Auto),
        plan: arguments.common.plan,
        prior: arguments.common.prior.unwrap_or_default(),
        accept_error_percent: arguments.accept_error.unwrap_or(leg.accept_error_percent),
        estimator: arguments.common.estimator,
        swarm_seed: arguments.common.swarm_seed.unwrap_or(DEFAULT_SEED),
        csv: arguments.csv.as_deref().map(Path::to_owned),
        torque_delay_ms: arguments.torque_delay.clone(),
        even_stamps: import.even_stamps,
        load: arguments.load.as_ref().map(|mass| mass.on(leg, "--load")).transpose()?,
        payload: arguments.payload.as_ref().map(|mass| mass.on(leg, "--payload")).transpose()?,
        import: Some(import.clone()),
    };
    let kept = arguments.model.kept(leg)?;
    let recordings = &Recordings {
        training: read(&arguments.files, import)?,
        held_out: read(&arguments.validate, import)?,
        with_payload: read(&arguments.with_payload, import)?,
    };
    let mut replayed = replay(leg, recordings, options)?;
    replayed.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    arguments.model.compare(kept.as_ref(), &mut replayed.run);
    let mut sources = format!("{}{}\n\n", tables::sources(&replayed.sources).to_text(), tables::SOURCES);
    let read = replayed.run.read.as_deref().unwrap_or_default();
    if let Some(table) = tables::conversions(read) {
        let notes = tables::reading_notes(read).join("\n");
        sources.push_str(&format!("{}{notes}\n\n", table.to_text()));
    }
    let code = finish(leg, &replayed.run, &arguments.common, &sources)?;
    draw(leg, &arguments.common, &replayed.run, &replayed.series, &replayed.sources)?;
    arguments.model.save(leg, &replayed.run, replayed.bandwidth_hz)?;
    Ok(code)
}
