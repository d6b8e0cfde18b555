//! `identify`: one or many simulated runs, their logs and statistics.

use std::path::Path;

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::RunReport;
use scarab_identify::report::series::Series;

use crate::options::SimulationOptions;
use crate::simulate::simulate;

/// Runs one identification, with curves on request; writes its log if a path is given.
pub fn identify_one(
    leg: &LegFile,
    options: &SimulationOptions,
    log: Option<&Path>,
) -> Result<(RunReport, Series), ToolError> {
    let run = simulate(leg, options)?;
    if let (Some(path), Some(training)) = (log, run.recordings.first()) {
        training.save(path)?;
    }
    Ok((run.report, run.series))
}

/// Runs one identification per seed, in parallel.
pub fn identify_many(leg: &LegFile, options: &[SimulationOptions]) -> Result<Vec<RunReport>, ToolError> {
    let progress = ProgressBar::new(options.len() as u64);
    if let Ok(style) =
        ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {elapsed} elapsed, {eta} left")
    {
        progress.set_style(style);
    }
    let runs = options
        .par_iter()
        .map(|options| {
            let run = simulate(leg, options).map(|run| run.report);
            progress.inc(1);
            run
        })
        .collect();
    progress.finish_and_clear();
    runs
}
