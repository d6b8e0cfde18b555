//! `update`: a new image for a board, over its bus.

use std::path::Path;

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, FileError, ToolError};
use scarab_base::output;
use scarab_client::update::{Update, check};

use crate::cli::adapter::AdapterOptions;
use crate::cli::arguments::Input;

/// Bus, board and image.
#[derive(Args, Debug)]
pub(crate) struct UpdateArguments {
    #[command(flatten)]
    adapter: AdapterOptions,
    /// Either node-ID of the board.
    #[arg(long, value_name = "ID", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=127))]
    node: u8,
    /// Program for an update, which `cargo fw` writes (scarab-image.bin).
    #[arg(value_name = "IMAGE.bin")]
    image: Input,
}

/// Updates; exit code 3 where the board refuses, 2 where file or bus are wrong.
pub(crate) fn run(arguments: &UpdateArguments) -> Result<u8, ToolError> {
    let path: &Path = &arguments.image;
    let program = std::fs::read(path).map_err(|error| FileError::unreadable(path, &error))?;
    let header = check(&program).map_err(|why| ToolError::input(format!("{}: {why}", path.display())))?;
    let client = arguments.adapter.client()?;
    let mut say = |words: &str| {
        let _ = output::print(&format!("{words}\n"));
    };
    Update { client, node: arguments.node, say: &mut say }.run(&program, &header)?;
    Ok(EXIT_ACCEPTED)
}
