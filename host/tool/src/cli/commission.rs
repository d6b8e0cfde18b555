//! `commission`: a guided procedure over the bus, from an unknown board to a stored identification.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, EXIT_INPUT, ToolError};
use scarab_base::{files, output};
use scarab_client::commission::{Commission, CommissionOptions, Step};

use crate::cli::adapter::AdapterOptions;
use crate::cli::arguments::OutputFolder;
use crate::cli::common::write_json;
use crate::view;

/// Bus, nodes and steps.
#[derive(Args, Debug)]
pub(crate) struct CommissionArguments {
    #[command(flatten)]
    adapter: AdapterOptions,
    /// Node-IDs of hip and knee.
    #[arg(long, value_name = "ID,ID", default_value = "1,2", value_delimiter = ',', num_args = 1, value_parser = clap::value_parser!(u8).range(1..=127))]
    nodes: Vec<u8>,
    /// Last step of this run; the next run resumes after it.
    #[arg(long, value_enum, default_value_t = Step::Store)]
    until: Step,
    /// Longest wait for the operator, s.
    #[arg(long, value_name = "S", default_value_t = 120.0)]
    patience: f64,
    /// Identify again, although the board has an accepted result since its start.
    #[arg(long)]
    again: bool,
    /// Write the page (commission.html) and the report (commission.json) into this directory.
    #[arg(long, value_name = "DIR")]
    out: Option<OutputFolder>,
}

/// Runs the procedure; exit code 3 where the board or the operator refuses, 2 where the bus fails.
pub(crate) fn run(arguments: &CommissionArguments) -> Result<u8, ToolError> {
    let nodes: [u8; 2] = arguments.nodes.as_slice().try_into().map_err(|_| {
        ToolError::input(format!("--nodes: {} numbers, the leg has two: hip and knee", arguments.nodes.len()))
    })?;
    if nodes[0] == nodes[1] {
        return Err(ToolError::input(format!("--nodes: both are {}", nodes[0])));
    }
    if !(arguments.patience > 0.0 && arguments.patience <= 86_400.0) {
        return Err(ToolError::input(format!(
            "--patience: {} s must be above 0 and at most 86400",
            arguments.patience
        )));
    }
    let client = arguments.adapter.client()?;
    let options = CommissionOptions {
        nodes,
        until: arguments.until,
        patience_s: arguments.patience,
        again: arguments.again,
    };
    let mut say = |words: &str| {
        let _ = output::print(&format!("{words}\n"));
    };
    let (report, result) = Commission::new(client, options, &mut say).run();
    if let Some(directory) = &arguments.out {
        write_json(&directory.join("commission.json"), &report)?;
        files::write(&directory.join("commission.html"), view::commission::page(&report))?;
        output::print(&format!("report: {}\n", directory.join("commission.html").display()))?;
    }
    match result {
        Ok(()) => Ok(EXIT_ACCEPTED),
        // The step's line has already said it.
        Err(error @ ToolError::Refused(_)) => Ok(error.exit_code()),
        Err(_) => Ok(EXIT_INPUT),
    }
}
