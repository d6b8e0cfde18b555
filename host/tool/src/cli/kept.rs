//! `kept`: stored data of a board, as TOML and back.

use std::io::ErrorKind;
use std::path::Path;

use clap::{Args, Subcommand};
use scarab_base::error::{EXIT_ACCEPTED, EXIT_REFUSED, FileError, ToolError};
use scarab_base::{files, output};
use scarab_rig::parameter_file::ParameterFile;
use scarab_rig::parameter_file::memory::{BYTES, Memory};

use crate::cli::arguments::{Input, Output, Updated};

/// Boards in a flash file, as many as `serve` supports.
const BOARDS: usize = 4;
/// Size limit of a file, bytes.
const LARGEST_FILE_BYTES: u64 = 1 << 20;

/// Direction of the transfer.
#[derive(Args, Debug)]
pub(crate) struct KeptArguments {
    #[command(subcommand)]
    way: Way,
}

#[derive(Subcommand, Debug)]
enum Way {
    /// Read a board's flash and write its stored data as TOML; exit code 3 if data is damaged.
    Export {
        /// Flash file of `serve --flash`: 32 KB per board.
        flash: Input,
        /// Number of the board in the file, from 1.
        #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=BOARDS as i64))]
        board: u8,
        /// Write here instead of to standard output.
        #[arg(long, value_name = "FILE.toml")]
        out: Option<Output>,
    },
    /// Write a TOML file into a board's flash, all or nothing; data that the file does not name stays.
    Import {
        /// File written by `export`.
        file: Input,
        /// Flash file of `serve --flash`; created if missing.
        flash: Updated,
        /// Number of the board in the file, from 1.
        #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=BOARDS as i64))]
        board: u8,
    },
}

/// Reads or writes; returns the exit code.
pub(crate) fn run(arguments: &KeptArguments) -> Result<u8, ToolError> {
    match &arguments.way {
        Way::Export { flash, board, out } => export(flash, usize::from(*board), out.as_deref()),
        Way::Import { file, flash, board } => import(file, flash, usize::from(*board)),
    }
}

/// Flash of all boards of a file; `None` if there is no file.
fn read(path: &Path) -> Result<Option<Vec<u8>>, ToolError> {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(FileError::unreadable(path, &error).into()),
    };
    if bytes.is_empty() || !bytes.len().is_multiple_of(BYTES) || bytes.len() > BOARDS * BYTES {
        let reason = format!("{} bytes; the flash of 1 to {BOARDS} boards has {BYTES} each", bytes.len());
        return Err(FileError::new(path.display(), reason).into());
    }
    Ok(Some(bytes))
}

fn export(flash: &Path, board: usize, out: Option<&Path>) -> Result<u8, ToolError> {
    let file = flash.display();
    let Some(bytes) = read(flash)? else {
        return Err(ToolError::input(format!("{file}: does not exist")));
    };
    let Some(own) = bytes.get((board - 1) * BYTES..board * BYTES) else {
        let boards = bytes.len() / BYTES;
        return Err(ToolError::input(format!("--board {board}: {file} holds the flash of {boards}")));
    };
    let found = ParameterFile::from_flash(&Memory::new(Some(own)));
    for part in &found.absent {
        eprintln!("absent: {file}: board {board}: {part}");
    }
    for fault in &found.damaged {
        eprintln!("damaged: {file}: board {board}: {fault}");
    }
    let text = found.file.to_toml();
    match out {
        Some(path) => files::write(path, text)?,
        None => output::print(&text)?,
    }
    Ok(if found.damaged.is_empty() { EXIT_ACCEPTED } else { EXIT_REFUSED })
}

fn import(file: &Path, flash: &Path, board: usize) -> Result<u8, ToolError> {
    let name = file.display().to_string();
    let bytes = std::fs::metadata(file).map_err(|error| FileError::unreadable(file, &error))?.len();
    if bytes > LARGEST_FILE_BYTES {
        return Err(FileError::new(
            name,
            format!("{bytes} bytes, too large for stored data, limit {LARGEST_FILE_BYTES}"),
        )
        .into());
    }
    let kept = ParameterFile::parse(&files::read_text(file)?, &name)?;
    let mut bytes = read(flash)?.unwrap_or_default();
    // Boards beyond the end of the file count as erased.
    if bytes.len() < board * BYTES {
        bytes.resize(board * BYTES, 0xFF);
    }
    let own = &mut bytes[(board - 1) * BYTES..board * BYTES];
    let mut memory = Memory::new(Some(own));
    kept.write_into(&mut memory)
        .map_err(|why| ToolError::Refused(format!("{}: board {board}: {why}", flash.display())))?;
    own.copy_from_slice(memory.bytes());
    files::write(flash, &bytes)?;
    output::print(&format!("flash: {}, board {board}\n", flash.display()))?;
    Ok(EXIT_ACCEPTED)
}
