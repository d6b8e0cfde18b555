//! `battery`: the table of cases by which the verdict of `replay` is judged.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::{files, output};

use crate::battery::{Selection, list, run};
use crate::cli::arguments::{Output, OutputFolder};

/// Exit code where a case misses.
const EXIT_MISSES: u8 = 1;

/// Selection of cases, and outputs.
#[derive(Args, Debug)]
pub(crate) struct BatteryArguments {
    /// Cases by a part of their names, by comma: damage, mujoco, delay, random, faults/spring,
    /// mujoco/delay/0.02/1. Default: all.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    kind: Vec<String>,
    /// Number of seeds of logs, random legs and faults.
    #[arg(long, value_name = "N", default_value_t = 100)]
    count: u64,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print the misses only.
    #[arg(long)]
    failures: bool,
    /// Print the names of the cases.
    #[arg(long, conflicts_with_all = ["json", "failures"])]
    list: bool,
    /// Write every case as JSON here; an existing file is not replaced.
    #[arg(long)]
    json: Option<Output>,
    /// Write leg and recordings of every case that misses into a folder of its name here.
    #[arg(long, value_name = "DIR", conflicts_with = "list")]
    out: Option<OutputFolder>,
}

/// Judges and reports; returns the exit code.
pub(crate) fn run_battery(arguments: &BatteryArguments) -> Result<u8, ToolError> {
    let selection = Selection { kinds: arguments.kind.clone(), seed: arguments.seed, count: arguments.count };
    if arguments.list {
        output::print(&list(&selection)?)?;
        return Ok(EXIT_ACCEPTED);
    }
    if let Some(path) = &arguments.json {
        files::check_new(path)?;
    }
    let battery = run(&selection, arguments.out.as_deref())?;
    if let Some(path) = &arguments.json {
        let text =
            serde_json::to_string_pretty(&battery).map_err(|error| ToolError::cannot_write(path, &error))?;
        files::write_new(path, &text)?;
    }
    if !arguments.failures {
        output::print(&battery.matrix())?;
    }
    output::print(&battery.failures())?;
    Ok(if battery.misses { EXIT_MISSES } else { EXIT_ACCEPTED })
}
