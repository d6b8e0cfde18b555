//! `predict`: torque of given states after a kept model.

use std::path::PathBuf;

use clap::Args;

use super::leg_options::LegOptions;
use crate::tool::error::{EXIT_ACCEPTED, ToolError};
use crate::tool::model_file::{ModelFile, refuse_another_leg};
use crate::tool::predict::{self, PredictOptions};
use crate::tool::{tables, temperature};

/// Which model and which states.
#[derive(Args, Debug)]
pub struct PredictArguments {
    /// Written by --save-model.
    #[arg(long)]
    model: PathBuf,
    /// States: columns q1.., qd1.., qdd1.. in rad and s, D-H angles; t_s is copied if there.
    #[arg(long)]
    states: PathBuf,
    /// Angles and torques are anatomical (flexion positive) instead of D-H.
    #[arg(long)]
    anatomical: bool,
    /// With any of these a model that is not this leg's is refused.
    #[command(flatten)]
    leg: Option<LegOptions>,
    /// Write the table here instead of to standard output.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Prints or writes the table; the exit code.
pub fn run(arguments: &PredictArguments) -> Result<u8, ToolError> {
    let leg = arguments.leg.as_ref().map(LegOptions::load).transpose()?;
    let model = ModelFile::load(&arguments.model)?;
    if let Some(leg) = &leg {
        refuse_another_leg(&model, &arguments.model.display().to_string(), leg)?;
        if let Some(words) = temperature::warning(model.conditions.temperature_c, leg.temperature_c) {
            eprintln!("warning: {}: {words}", arguments.model.display());
        }
    }
    let options = PredictOptions { states: arguments.states.clone(), anatomical: arguments.anatomical };
    let table = predict::table(&model, &options)?;
    match &arguments.out {
        Some(path) => std::fs::write(path, table).map_err(|error| ToolError::cannot_write(path, &error))?,
        None => tables::print(&table)?,
    }
    Ok(EXIT_ACCEPTED)
}
