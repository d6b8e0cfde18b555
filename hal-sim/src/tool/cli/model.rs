//! Model files of `identify` and `replay`: comparison and storage.

use clap::Args;

use crate::tool::error::ToolError;
use crate::tool::files::{Input, Output};
use crate::tool::leg_file::LegFile;
use crate::tool::model_file::{ModelFile, comparison, refuse_another_leg};
use crate::tool::report::RunReport;
use crate::tool::tables;

/// Model to be compared with, and destination of the result.
#[derive(Args, Debug)]
pub struct ModelArguments {
    /// Store an accepted result here, for predict, export and comparison; a rejected one is not written.
    #[arg(long)]
    save_model: Option<Output>,
    /// Compare the result with this model, which must be one of the same leg.
    #[arg(long)]
    compare_model: Option<Input>,
}

impl ModelArguments {
    /// Reads the model to compare with, if named; a model of another leg is rejected before anything runs.
    pub fn kept(&self, leg: &LegFile) -> Result<Option<ModelFile>, ToolError> {
        let Some(path) = &self.compare_model else { return Ok(None) };
        let model = ModelFile::load(path)?;
        refuse_another_leg(&model, &path.display().to_string(), leg)?;
        Ok(Some(model))
    }

    /// Adds the comparison to the report.
    pub fn compare(&self, kept: Option<&ModelFile>, run: &mut RunReport) {
        if let (Some(path), Some(model)) = (&self.compare_model, kept) {
            run.compared = comparison::compare(model, &path.display().to_string(), run);
        }
    }

    /// Stores an accepted result, identified with this bandwidth (Hz).
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
