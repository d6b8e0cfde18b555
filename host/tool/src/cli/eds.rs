//! `eds`: electronic data sheets of the nodes, for host software of the bus.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::{files, output};

use crate::cli::arguments::OutputFolder;
use crate::eds;

/// Joints with a node: hip and knee of a board.
const JOINTS: [&str; 2] = ["hip", "knee"];

/// Destination of the data sheets.
#[derive(Args, Debug)]
pub(crate) struct EdsArguments {
    /// Folder for the sheets, one per joint; created if missing.
    #[arg(long)]
    out: OutputFolder,
}

/// Writes the files and returns the exit code.
pub(crate) fn run(arguments: &EdsArguments) -> Result<u8, ToolError> {
    let folder = &arguments.out;
    for joint in JOINTS {
        let path = folder.join(format!("scarab-{joint}.eds"));
        files::write(&path, eds::text(joint))?;
        output::print(&format!("electronic data sheet: {}\n", path.display()))?;
    }
    Ok(EXIT_ACCEPTED)
}
