//! `compare`: the difference of two stored models.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::output;
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::leg::matching::refuse_another_leg;
use scarab_identify::run::compare_model as comparison;

use crate::cli::arguments::{Input, Output};
use crate::cli::common::write_json;
use crate::view::tables;

/// Two models of one leg.
#[derive(Args, Debug)]
pub(crate) struct CompareArguments {
    /// Model written by --save-model.
    before: Input,
    /// Later model of the same leg.
    after: Input,
    /// Write the comparison as JSON.
    #[arg(long)]
    json: Option<Output>,
}

/// Compares and reports; returns the exit code.
pub(crate) fn run(arguments: &CompareArguments) -> Result<u8, ToolError> {
    let (before, after) = (ModelFile::load(&arguments.before)?, ModelFile::load(&arguments.after)?);
    refuse_another_leg(&before, &arguments.before.display().to_string(), &after.leg.to_leg_file())?;
    let file = arguments.before.display().to_string();
    let temperature = after.conditions.temperature_c;
    let compared = comparison::compare(&before, &file, &after.base_set, temperature)
        .ok_or_else(|| ToolError::input(format!("{file}: the models have no base parameter in common")))?;
    if let Some(path) = &arguments.json {
        write_json(path, &compared)?;
    }
    output::print(&(tables::comparison_lines(&compared).join("\n") + "\n"))?;
    Ok(EXIT_ACCEPTED)
}
