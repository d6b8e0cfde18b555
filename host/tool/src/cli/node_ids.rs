//! `node-ids`: lists the boards of a bus and gives them other node-IDs.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::output;
use scarab_client::node_ids::{Board, NodeIds, check};

use crate::cli::adapter::AdapterOptions;

/// Bus and node-IDs.
#[derive(Args, Debug)]
pub(crate) struct NodeIdsArguments {
    #[command(flatten)]
    adapter: AdapterOptions,
    /// Node-IDs of hip and knee for the board with this serial number; stored. Can be repeated.
    #[arg(long, value_name = "SERIAL=ID,ID", value_parser = wanted)]
    set: Vec<(u32, [u8; 2])>,
}

/// Parses a serial number (hexadecimal) and two node-IDs.
fn wanted(text: &str) -> Result<(u32, [u8; 2]), String> {
    let expected = "expected a serial number as listed and two node-IDs, for example 0000004D=3,4";
    let (serial, nodes) = text.split_once('=').ok_or(expected)?;
    let (hip, knee) = nodes.split_once(',').ok_or(expected)?;
    let serial = u32::from_str_radix(serial, 16).map_err(|error| format!("{serial}: {error}; {expected}"))?;
    let number = |text: &str| text.parse::<u8>().map_err(|error| format!("{text}: {error}; {expected}"));
    Ok((serial, [number(hip)?, number(knee)?]))
}

/// Lists and sets; exit code 3 where a board refuses, 2 where the bus fails.
pub(crate) fn run(arguments: &NodeIdsArguments) -> Result<u8, ToolError> {
    let mut ids = NodeIds::new(arguments.adapter.client()?);
    let mut boards = ids.find()?;
    if boards.is_empty() {
        return Err(ToolError::input(
            "no board answers: is one powered, the bit rate right, the bus terminated?".to_owned(),
        ));
    }
    // All are checked before the first is set.
    let mut after = boards.clone();
    for (serial, nodes) in &arguments.set {
        check(&after, *serial, *nodes).map_err(|why| ToolError::input(format!("--set: {why}")))?;
        ids.check_off(*serial, &boards)?;
        after.iter_mut().filter(|board| board.serial == *serial).for_each(|board| board.nodes = *nodes);
    }
    let mut result = Ok(());
    for (serial, nodes) in &arguments.set {
        for board in boards.iter_mut().filter(|board| board.serial == *serial) {
            if result.is_ok() {
                result = ids.set(*board, *nodes);
                board.nodes = if result.is_ok() { *nodes } else { board.nodes };
            }
        }
    }
    boards.iter().try_for_each(|board| output::print(&line(board, &boards)))?;
    result.map(|()| EXIT_ACCEPTED)
}

/// Line of a board, with those that share a node-ID.
fn line(board: &Board, boards: &[Board]) -> String {
    let Board { serial, nodes: [hip, knee], .. } = *board;
    let shares =
        |other: &&Board| other.serial != serial && other.nodes.iter().any(|node| board.nodes.contains(node));
    let others: Vec<_> = boards.iter().filter(shares).map(|other| format!("{:08X}", other.serial)).collect();
    let warning = if others.is_empty() {
        String::new()
    } else {
        format!("; shared with {}: use --set, and enable nothing before", others.join(", "))
    };
    format!("board {serial:08X}: node {hip} hip, {knee} knee{warning}\n")
}
