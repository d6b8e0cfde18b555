//! `faults`: the fault catalogue injected into the whole firmware, and what it makes of each.

use std::path::PathBuf;

use clap::Args;

use super::common::write_json;
use super::leg_options::LegOptions;
use crate::tool::error::{EXIT_ACCEPTED, EXIT_REFUSED, ToolError};
use crate::tool::faults::campaign::{CampaignOptions, campaign};
use crate::tool::faults::catalogue::{self, Row, row};
use crate::tool::faults::report::{CampaignReport, told};
use crate::tool::faults::run::{Manner, Outcome};
use crate::tool::html::{self, Circumstances};
use crate::tool::leg_file::LegFile;
use crate::tool::paper::document;
use crate::tool::{figures, tables};

/// More runs of one fault are a mistake.
const MOST_SEEDS: u64 = 1_000_000;

/// Which faults, how often.
#[derive(Args, Debug)]
pub struct FaultsArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// A row of the catalogue by its id; may be repeated. All of them unless given.
    #[arg(long, value_name = "ID")]
    fault: Vec<String>,
    /// Runs of each fault.
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    seeds: u64,
    /// The emergency stop also at every servo tick of a whole identification, and at every current tick of one second of it.
    #[arg(long)]
    every_tick: bool,
    /// Switch the detectors of each fault off: every run has to be missed, or nothing would notice a broken one. Exit code 0 if so.
    #[arg(long, conflicts_with = "every_tick")]
    blind: bool,
    /// Only the run of this seed of each fault, told in full.
    #[arg(long, value_name = "SEED", conflicts_with_all = ["seeds", "every_tick"], value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    replay: Option<u64>,
    /// Inject only in the first seconds of each identification.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Write the table here, for exit codes 0 and 3.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write table, failures and the runs of --replay with their curves as one HTML page here.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Put the table into this document, between its markers.
    #[arg(long)]
    docs: Option<PathBuf>,
}

fn rows(names: &[String]) -> Result<Vec<&'static Row>, ToolError> {
    if names.is_empty() {
        return Ok(catalogue::rows().collect());
    }
    let mut rows: Vec<&'static Row> = Vec::new();
    for name in names {
        let found = row(name).ok_or_else(|| {
            let known: Vec<_> = catalogue::rows().map(|row| row.id).collect();
            ToolError::input(format!("--fault {name}: is none of {}", known.join(", ")))
        })?;
        if !rows.iter().any(|row| row.id == found.id) {
            rows.push(found);
        }
    }
    Ok(rows)
}

fn page(leg: &LegFile, report: &CampaignReport, outcomes: &[Outcome]) -> Result<String, ToolError> {
    let recorded = || outcomes.iter().filter_map(|outcome| Some((outcome, outcome.recording.as_ref()?)));
    let lines: Vec<String> = recorded().map(|(outcome, _)| told(outcome)).collect();
    let figures = recorded()
        .map(|(outcome, recording)| {
            let what = format!("{}, seed {}", outcome.fault, outcome.seed);
            figures::faults::drawn(format!("{}-{}.svg", outcome.fault, outcome.seed), &what, recording)
        })
        .collect::<Result<Vec<_>, _>>()?;
    Ok(html::faults::page(&Circumstances::now(leg), report, &lines, &figures))
}

/// Injects and reports; exit code 3 where anything was missed.
pub fn run(arguments: &FaultsArguments) -> Result<u8, ToolError> {
    let rows = rows(&arguments.fault)?;
    if arguments.every_tick && !rows.iter().any(|row| row.id == "X1") {
        return Err(ToolError::input("--every-tick: is about the emergency stop, and --fault leaves X1 out"));
    }
    if let Some(seconds) = arguments.seconds
        && !(0.01..=300.0).contains(&seconds)
    {
        return Err(ToolError::input(format!("--seconds: {seconds} is not from 0.01 to 300")));
    }
    let leg = arguments.leg.load()?;
    let seeds = arguments.replay.map_or_else(|| (1..=arguments.seeds).collect(), |seed| vec![seed]);
    let options = CampaignOptions {
        rows: rows.clone(),
        seeds,
        every_tick: arguments.every_tick,
        manner: Manner { blind: arguments.blind, recorded: arguments.replay.is_some() },
        seconds: arguments.seconds,
    };
    let campaign = campaign(&leg, &options)?;
    let report = CampaignReport::new(&rows, &campaign);
    if let Some(path) = &arguments.json {
        write_json(path, &report)?;
    }
    if let Some(path) = &arguments.docs {
        document::replace(path, "faults", "table", &report.markdown())?;
    }
    tables::print(&report.table())?;
    tables::print(&report.notes())?;
    if arguments.replay.is_some() {
        for outcome in &campaign.outcomes {
            tables::print(&format!("{}\n", told(outcome)))?;
        }
    }
    if let Some(path) = &arguments.report {
        let page = page(&leg, &report, &campaign.outcomes)?;
        std::fs::write(path, page).map_err(|error| ToolError::cannot_write(path, &error))?;
        tables::print(&format!("report: {}\n", path.display()))?;
    }
    if arguments.blind {
        let unnoticed: Vec<_> =
            report.rows.iter().filter(|row| row.missed == 0).map(|row| row.fault).collect();
        let words = if unnoticed.is_empty() { "none" } else { &unnoticed.join(", ") };
        tables::print(&format!("detectors that nobody would miss: {words}\n"))?;
        return Ok(if unnoticed.is_empty() { EXIT_ACCEPTED } else { EXIT_REFUSED });
    }
    Ok(if report.is_good() { EXIT_ACCEPTED } else { EXIT_REFUSED })
}
