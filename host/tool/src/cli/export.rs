//! `export`: writes a stored model for other rigid-body software.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::{files, output};
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::formats::urdf;
use scarab_identify::leg::matching::refuse_another_leg;

use crate::cli::arguments::{Input, Output};
use crate::cli::leg_options::LegOptions;

/// Model and destination.
#[derive(Args, Debug)]
pub(crate) struct ExportArguments {
    /// Model written by --save-model.
    #[arg(long)]
    model: Input,
    /// Write a robot description (URDF) here.
    #[arg(long)]
    urdf: Output,
    /// With any of these options, a model of another leg is rejected.
    #[command(flatten)]
    leg: Option<LegOptions>,
}

/// Writes the file and returns the exit code.
pub(crate) fn run(arguments: &ExportArguments) -> Result<u8, ToolError> {
    let file = arguments.model.display().to_string();
    let leg = arguments.leg.as_ref().map(LegOptions::load).transpose()?;
    let model = ModelFile::load(&arguments.model)?;
    if let Some(leg) = &leg {
        refuse_another_leg(&model, &file, leg)?;
    }
    let text = urdf::text(&model, &file)?;
    let path = &arguments.urdf;
    files::write(path, text)?;
    output::print(&format!("robot description: {}\n", path.display()))?;
    Ok(EXIT_ACCEPTED)
}
