//! `emulate`: the whole firmware on an emulated microcontroller (`cargo emulate`).

use std::path::Path;

use clap::Args;

use crate::base::error::{EXIT_ACCEPTED, EXIT_REFUSED, FileError, ToolError};
use crate::base::output;
use crate::cli::arguments::Output;
use crate::cli::common::write_json;
use crate::cli::leg_options::LegOptions;
use crate::image::emulate::crash::{CrashKind, CrashReport};
use crate::image::emulate::report::EmulationReport;
use crate::image::emulate::run::{build, crash, run};
use crate::leg::setup::DEFAULT_SEED;
use crate::run::trace::{log, run as reading, run_report};
use crate::view::tables;

/// Exit code of a run with a missed tick, or of a crash that was not handled correctly.
const EXIT_MISSED: u8 = 1;

/// Leg, and outputs of its run.
#[derive(Args, Debug)]
pub struct EmulateArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// Seed of noise and swarm.
    #[arg(long, default_value_t = DEFAULT_SEED)]
    seed: u64,
    /// Write the records here, as sent by the image, for `cargo sim trace`.
    #[arg(long, value_name = "FILE")]
    trace: Option<Output>,
    /// Write the report here, for exit codes 0 and 3.
    #[arg(long, value_name = "FILE")]
    json: Option<Output>,
    /// Write the 500 Hz log of the training motion here, as a recording for replay; the image then sends
    /// every sample.
    #[arg(long, value_name = "FILE")]
    csv: Option<Output>,
    /// Crash while the leg identifies, and evaluate the crash. Exit code 0 if the bridges were off first, the
    /// record survived, and the next start refused to enable; else 1.
    #[arg(long, value_name = "KIND", conflicts_with_all = ["json", "csv"])]
    crash: Option<CrashKind>,
    /// Servo tick of the crash, 4,000 per second.
    #[arg(long, value_name = "TICK", requires = "crash", default_value_t = 4_000)]
    crash_tick: u32,
}

/// Builds, runs and decodes; returns the exit code.
pub fn emulate(arguments: &EmulateArguments) -> Result<u8, ToolError> {
    let leg = arguments.leg.load_for_image()?;
    let image = build(&leg, arguments.seed, arguments.csv.is_some())?;
    let path = arguments.trace.as_deref().map_or_else(|| image.with_extension("trace"), Path::to_owned);
    if let Some(kind) = arguments.crash {
        return show(kind, arguments.crash_tick, &image, &path);
    }
    let wall = run(&image, &path)?;
    let trace = reading::read(&path, Some(&image), None)?;
    output::print(&reading::preface(&trace))?;
    let attention = reading::attention(&trace);
    if let Some(csv) = &arguments.csv {
        let written = log::write(&trace, &leg, log::TRAINING, csv)?;
        output::print(&format!("log: {}, {} samples\n\n", csv.display(), written.samples))?;
    }
    let Some(loops) = trace.statistics.loops() else {
        return Err(ToolError::input(format!("the image sent no record `loops`\n{attention}")));
    };
    let identification =
        run_report(&trace, &leg).map_err(|error| ToolError::input(format!("{error}\n{attention}")))?;
    tables::print_run(&identification)?;
    let bytes = std::fs::read(&path).map_err(|error| FileError::unreadable(&path, &error))?;
    let accepted = identification.accepted();
    let report = EmulationReport::new(identification, &loops, &bytes);
    output::print(&report.lines(loops.stack_bytes, wall.as_secs_f64()))?;
    output::print(&attention)?;
    if let Some(json) = &arguments.json {
        write_json(json, &report)?;
    }
    Ok(match (report.missed_ticks, accepted) {
        (0, true) => EXIT_ACCEPTED,
        (0, false) => EXIT_REFUSED,
        _ => EXIT_MISSED,
    })
}

/// Crashes the image and prints the evaluation.
fn show(kind: CrashKind, tick: u32, image: &Path, trace: &Path) -> Result<u8, ToolError> {
    let [log, lines] = ["log", "txt"].map(|kind| image.with_extension(kind));
    let begun = crash(image, trace, &log, kind, tick)?;
    output::print(&reading::preface(&reading::read(trace, Some(image), Some(&lines))?))?;
    let text = |path: &Path| {
        let bytes = std::fs::read(path);
        let bytes = bytes.map_err(|error| FileError::unreadable(path, &error))?;
        Ok::<_, ToolError>(String::from_utf8_lossy(&bytes).into_owned())
    };
    let report = CrashReport::new(kind, &text(&lines)?, &text(&log)?, begun, image)?;
    // Logs of some megabytes.
    for file in [log, lines] {
        let _ = std::fs::remove_file(file);
    }
    output::print(&report.lines())?;
    Ok(if report.complaints.is_empty() { EXIT_ACCEPTED } else { EXIT_MISSED })
}
