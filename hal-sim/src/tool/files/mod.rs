//! Files of a command: what it reads, what it writes, and how they are written.
//!
//! Why one place: a command that writes over its own recording destroys data that nobody can bring back. So every
//! command's files are checked before anything is computed, and no other module of the tool writes a file.
//!
//! | part | what it does |
//! | --- | --- |
//! | [`role`] | types of command-line arguments that say what a command does with a file |
//! | [`mod@check`] | finds files that a command would overwrite or cannot write, from the parsed arguments of any command |
//! | [`mod@write`] | writes a temporary file in the same folder and renames it |
//!
//! Known limits: names that differ in case only are different files, which some file systems do not know. A file that the
//! shell redirects the output to is the shell's.

pub mod check;
pub mod role;
pub mod write;

pub use check::check;
pub use role::{Input, LegName, Output, OutputFolder, Updated};
pub use write::{NewFile, write};

use std::path::{Path, PathBuf};

/// Streams of the process, which may lead to files that the shell has opened.
const OPEN_STREAMS: [&str; 3] = ["/dev/stdout", "/dev/stderr", "/dev/fd"];
/// Links that are followed by hand before a path counts as a circle.
const MOST_LINKS: usize = 40;

/// The path without links, `.` and `..`, as far as its parts exist: two spellings of one file, existing or not, give the
/// same.
fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        if let Ok(real) = path.canonicalize() {
            return real;
        }
        // A link to a file that does not exist yet.
        let Ok(target) = path.read_link() else { break };
        path = folder_of(&path).join(target);
    }
    match path.file_name() {
        Some(name) => match folder_of(&path) {
            folder if folder == path => path,
            folder => resolved(&folder).join(name),
        },
        None => path,
    }
}

/// The folder that a path lies in.
fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
        Some(parent) => parent.to_owned(),
        None => path.to_owned(),
    }
}

/// Whether the path is a terminal, a pipe or another device: it is written to directly, and by as many as like.
fn is_device(path: &Path) -> bool {
    OPEN_STREAMS.iter().any(|stream| path.starts_with(stream))
        || path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}
