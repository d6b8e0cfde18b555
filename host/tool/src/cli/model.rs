//! Model files of `identify` and `replay`: comparison and storage.

use clap::Args;
use scarab_base::error::ToolError;
use scarab_base::output;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::model_file::{BaseSet, ModelFile};
use scarab_identify::leg::matching::refuse_another_leg;
use scarab_identify::report::RunReport;
use scarab_identify::run::compare_model as comparison;

use crate::cli::arguments::{Input, Output};

/// Model to compare with, and destination of the result.
#[derive(Args, Debug)]
pub(crate) struct ModelArguments {
    /// Store an accepted result here, for predict, export and comparison; a refused one is not written.
    #[arg(long, help_heading = "Output")]
    save_model: Option<Output>,
    /// Compare the result with this model of the same leg.
    #[arg(long, help_heading = "Output")]
    compare_model: Option<Input>,
}

impl ModelArguments {
    /// Reads the model to compare with, if named; a model of another leg is refused before anything runs.
    pub(crate) fn kept(&self, leg: &LegFile) -> Result<Option<ModelFile>, ToolError> {
        let Some(path) = &self.compare_model else { return Ok(None) };
        let model = ModelFile::load(path)?;
        refuse_another_leg(&model, &path.display().to_string(), leg)?;
        Ok(Some(model))
    }

    /// Adds the comparison to the report.
    pub(crate) fn compare(&self, kept: Option<&ModelFile>, run: &mut RunReport) {
        if let (Some(path), Some(model)) = (&self.compare_model, kept) {
            let (file, found) = (path.display().to_string(), BaseSet::from_run(run));
            run.compared = comparison::compare(model, &file, &found, run.temperature_c.known());
        }
    }

    /// Stores an accepted result, identified with this bandwidth (Hz).
    pub(crate) fn save(&self, leg: &LegFile, run: &RunReport, bandwidth_hz: f64) -> Result<(), ToolError> {
        let Some(path) = &self.save_model else { return Ok(()) };
        match ModelFile::from_run(leg, run, bandwidth_hz) {
            Some(model) => {
                model.write(path)?;
                output::print(&format!("model: {}\n", path.display()))
            }
            None => {
                output::print(&format!("model: not saved to {}, the result was refused\n", path.display()))
            }
        }
    }
}
