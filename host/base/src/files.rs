//! Texts that are read, and files that are written: a temporary file in the same folder, then renamed. No
//! other module writes files.

pub mod serial;
pub mod write;

pub use write::{NewFile, check_new, write, write_new};

use std::path::{Path, PathBuf};

use crate::error::FileError;

/// Streams of the process, which may be files opened by the shell.
const OPEN_STREAMS: [&str; 3] = ["/dev/stdout", "/dev/stderr", "/dev/fd"];
/// Limit of followed links before a path counts as a cycle.
const MOST_LINKS: usize = 40;

/// Reads a text.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::unreadable(path, &error))?;
    String::from_utf8(bytes).map_err(|_| FileError::new(path.display(), "not a text file"))
}

/// Path without links, `.` and `..`, as far as its parts exist. All spellings of one file give the
/// same result, whether it exists or not.
pub fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        if let Ok(real) = path.canonicalize() {
            return real;
        }
        // Link to a file that does not exist yet.
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

/// Folder of a path.
pub fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
        Some(parent) => parent.to_owned(),
        None => path.to_owned(),
    }
}

/// Whether the path is a terminal, pipe or other device, which is written directly and may be shared.
pub fn is_device(path: &Path) -> bool {
    OPEN_STREAMS.iter().any(|stream| path.starts_with(stream))
        || path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}
