//! What `identify` and `replay` do with model files: compare with one, keep one.

use clap::Args;

use crate::tool::error::ToolError;
use crate::tool::files::{Input, Output};
use crate::tool::leg_file::LegFile;
use crate::tool::model_file::{ModelFile, comparison, refuse_another_leg};
use crate::tool::report::RunReport;
use crate::tool::tables;

/// Where a model is kept and with which one the result is compared.
#[derive(Args, Debug)]
pub struct ModelArguments {
    /// Keep an accepted result here, for predict, export and comparison; a refused one is not written.
    #[arg(long)]
    save_model: Option<Output>,
    /// Compare the result with this model, which must be one of the same leg.
    #[arg(long)]
    compare_model: Option<Input>,
}

impl ModelArguments {
    /// The model to compare with, if one is named: read, and refused where it is not the leg's, before anything runs.
    pub fn kept(&self, leg: &LegFile) -> Result<Option<ModelFile>, ToolError> {
        let Some(path) = &self.compare_model else { return Ok(None) };
        let model = ModelFile::load(path)?;
        refuse_another_leg(&model, &path.display().to_string(), leg)?;
        Ok(Some(model))
    }

    /// Notes in the report how the result compares.
    pub fn compare(&self, kept: Option<&ModelFile>, run: &mut RunReport) {
        if let (Some(path), Some(model)) = (&self.compare_model, kept) {
            run.compared = comparison::compare(model, &path.display().to_string(), run);
        }
    }

    /// Keeps an accepted result, found with this bandwidth (Hz).
    pub fn save(&self, leg: &LegFile, run: &RunReport, bandwidth_hz: f64) -> Result<(), ToolError> {
        let Some(path) = &self.save_model else { return Ok(()) };
        match ModelFile::of(leg, run, bandwidth_hz) {
            Some(model) => {
                model.write(path)?;
                tables::print(&format!("model: {}\n", path.display()))
            }
            None => {
                tables::print(&format!("model: not saved to {}, the result was refused\n", path.display()))
            }
        }
    }
}
