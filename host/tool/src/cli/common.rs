//! Arguments shared by several commands.

use std::path::Path;

use crate::view::spread::Spread;
use clap::Args;
use scarab::ident::{Estimator, Plan};
use scarab_base::error::{EXIT_ACCEPTED, EXIT_REFUSED, ToolError};
use scarab_base::{files, output};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::shard::{CampaignHeader, Program};
use scarab_identify::formats::temperature;
use scarab_identify::leg::setup::PriorChoice;
use scarab_identify::report::series::Series;
use scarab_identify::report::{RunReport, Source};

use crate::cli::arguments::{Choice, Output, OutputFolder, one_of};
use crate::cli::leg_options::LegOptions;
use crate::view::{figures, html, tables};

/// Program that computes a campaign: this one.
pub(crate) fn program() -> Program {
    Program::from_sources(env!("SCARAB_SOURCES"))
}

/// Plan of the estimate: word, value and help.
const PLANS: &[Choice<Plan>] = &[
    ("one-time", Plan::OneTime, "All joints at once, weighted by their noise"),
    ("sequential", Plan::Sequential, "Distal joint first, then substitution"),
];

/// Treatment of disturbances.
const ESTIMATORS: &[Choice<Estimator>] = &[
    (
        "robust",
        Estimator::Robust,
        "Replace outliers, reduce the weight of disturbed stretches, and search Stribeck friction",
    ),
    ("plain", Estimator::Plain, "Weight every sample alike"),
];

/// Arguments shared by identification and replay.
#[derive(Args, Debug)]
pub struct Common {
    #[command(flatten)]
    pub(crate) leg: LegOptions,
    /// Seed of the swarm's random numbers.
    #[arg(long, help_heading = "Identification")]
    pub(crate) swarm_seed: Option<u64>,
    /// Order of the estimate.
    #[arg(long, value_parser = one_of(PLANS), default_value = "one-time", help_heading = "Identification")]
    pub(crate) plan: Plan,
    /// Treatment of outliers and disturbances.
    #[arg(long, value_parser = one_of(ESTIMATORS), default_value = "robust", help_heading = "Identification")]
    pub(crate) estimator: Estimator,
    /// Prior of the search: none, file, or wrong:PERCENT. Default: that of the leg file.
    #[arg(long, help_heading = "Identification")]
    pub(crate) prior: Option<PriorChoice>,
    /// Temperature of the drives, degrees Celsius (-40 to 125), stored with the result. Default: that of the
    /// leg file.
    #[arg(long, value_name = "C", allow_negative_numbers = true, value_parser = temperature::parse, help_heading = "Identification")]
    temperature: Option<f64>,
    /// Write the report as JSON here, for exit codes 0 and 3.
    #[arg(long, help_heading = "Output")]
    pub(crate) json: Option<Output>,
    /// Print all fourteen parameters of every joint with their status.
    #[arg(long, help_heading = "Output")]
    pub(crate) parameters: bool,
    /// Draw the run into this directory, as SVG files.
    #[arg(long, help_heading = "Output")]
    pub(crate) figures: Option<OutputFolder>,
    /// Write the run as one HTML page here: figures, tables, verdict.
    #[arg(long, help_heading = "Output")]
    pub(crate) report: Option<Output>,
}

impl Common {
    /// Leg with its options and the stated temperature.
    pub(crate) fn leg(&self) -> Result<LegFile, ToolError> {
        let leg = self.leg.load()?;
        Ok(LegFile { temperature_c: self.temperature.or(leg.temperature_c), ..leg })
    }

    /// Whether curves are needed.
    pub(crate) fn is_drawn(&self) -> bool {
        self.figures.is_some() || self.report.is_some()
    }
}

/// Draws requested figures and page, and prints their paths.
pub fn draw(
    leg: &LegFile,
    common: &Common,
    run: &RunReport,
    series: &Series,
    sources: &[Source],
) -> Result<(), ToolError> {
    let (directory, page) = (common.figures.as_deref(), common.report.as_deref());
    draw_into(leg, directory, page, run, series, sources)
}

/// Draws into a directory and a page, if given.
pub(crate) fn draw_into(
    leg: &LegFile,
    directory: Option<&Path>,
    page: Option<&Path>,
    run: &RunReport,
    series: &Series,
    sources: &[Source],
) -> Result<(), ToolError> {
    if directory.is_none() && page.is_none() {
        return Ok(());
    }
    let names: Vec<_> = leg.joints.iter().map(|joint| joint.name.as_str()).collect();
    let drawn = figures::all(&names, run, series)?;
    if let Some(directory) = directory {
        figures::write(directory, &drawn)?;
        output::print(&format!("figures: {}\n", directory.display()))?;
    }
    if let Some(path) = page {
        let circumstances = html::Circumstances::now(leg);
        let page = html::page(&circumstances, run, sources, &drawn)?;
        files::write(path, page)?;
        output::print(&format!("report: {}\n", path.display()))?;
    }
    Ok(())
}

/// Draws the runs of a campaign if requested, and prints the paths.
pub(crate) fn draw_runs(
    campaign: &CampaignHeader,
    common: &Common,
    runs: &[RunReport],
) -> Result<(), ToolError> {
    let Some(leg) = campaign.leg.as_ref().filter(|_| common.is_drawn()) else { return Ok(()) };
    let spreads = Spread::from_runs(runs);
    let figure = figures::spread(&leg.name, &spreads)?;
    if let Some(directory) = &common.figures {
        figures::write(directory, std::slice::from_ref(&figure))?;
        output::print(&format!("figures: {}\n", directory.display()))?;
    }
    if let Some(path) = &common.report {
        let circumstances = html::Circumstances::from_command(leg, campaign.command_line());
        let page = html::seeds::page(&circumstances, runs, &spreads, &figure)?;
        files::write(path, page)?;
        output::print(&format!("report: {}\n", path.display()))?;
    }
    Ok(())
}

/// Writes and prints the result for a leg; `preface` precedes it.
pub(crate) fn finish(
    leg: &LegFile,
    run: &RunReport,
    common: &Common,
    preface: &str,
) -> Result<u8, ToolError> {
    if let Some(path) = &common.json {
        write_json(path, run)?;
    }
    output::print(preface)?;
    tables::print_run(run, leg)?;
    if common.parameters {
        output::print(&format!("\n{}", tables::all_parameters(run)))?;
    }
    Ok(if run.accepted() { EXIT_ACCEPTED } else { EXIT_REFUSED })
}

pub fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), ToolError> {
    let mut text =
        serde_json::to_string_pretty(value).map_err(|error| ToolError::cannot_write(path, &error))?;
    text.push('\n');
    files::write(path, text)
}
