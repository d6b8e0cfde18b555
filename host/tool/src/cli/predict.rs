//! `predict`: torque of given states from a stored model.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::{files, output};
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::formats::temperature;
use scarab_identify::leg::matching::refuse_another_leg;
use scarab_identify::run::predict;

use crate::cli::arguments::{Input, Output};
use crate::cli::leg_options::LegOptions;
use crate::cli::states::StatesOptions;

/// Model and states.
#[derive(Args, Debug)]
pub(crate) struct PredictArguments {
    /// Model written by --save-model.
    #[arg(long)]
    model: Input,
    #[command(flatten)]
    states: StatesOptions,
    /// With any of these options, a model of another leg is rejected.
    #[command(flatten)]
    leg: Option<LegOptions>,
    /// Write the table here instead of to standard output.
    #[arg(long)]
    out: Option<Output>,
}

/// Prints or writes the table; returns the exit code.
pub(crate) fn run(arguments: &PredictArguments) -> Result<u8, ToolError> {
    let leg = arguments.leg.as_ref().map(LegOptions::load).transpose()?;
    let model = ModelFile::load(&arguments.model)?;
    if let Some(leg) = &leg {
        refuse_another_leg(&model, &arguments.model.display().to_string(), leg)?;
        if let Some(words) = temperature::warning(model.conditions.temperature_c, leg.temperature_c) {
            eprintln!("warning: {}: {words}", arguments.model.display());
        }
    }
    let table = predict::table(&model, &arguments.states.states, arguments.states.angles())?;
    match &arguments.out {
        Some(path) => files::write(path, table)?,
        None => output::print(&table)?,
    }
    Ok(EXIT_ACCEPTED)
}
