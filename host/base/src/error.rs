//! Errors of the tool and their exit codes.

use std::fmt;
use std::path::Path;

/// Exit code of an accepted result.
pub const EXIT_ACCEPTED: u8 = 0;
/// Exit code of a rejected result.
pub const EXIT_REFUSED: u8 = 3;
/// Exit code of bad input.
pub const EXIT_INPUT: u8 = 2;

/// Reason for a missing result, with file, line and cause.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// Well-formed input that must not be used: exit code [`EXIT_REFUSED`], not [`EXIT_INPUT`].
    #[error("{0}")]
    Refused(String),
    /// Any other error that a user can correct.
    #[error("{0}")]
    Input(String),
}

impl ToolError {
    /// Bad input with a reason.
    pub fn input(reason: impl Into<String>) -> Self {
        Self::Input(reason.into())
    }

    /// Exit code of the process.
    pub fn exit_code(&self) -> u8 {
        if matches!(self, Self::Refused(_)) { EXIT_REFUSED } else { EXIT_INPUT }
    }

    /// Error of a file that cannot be written.
    pub fn cannot_write(path: &Path, error: &dyn fmt::Display) -> Self {
        FileError::new(path.display(), format!("cannot be written: {error}")).into()
    }
}

/// Content of a file that cannot be used. Displays as `file:line: reason`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{file}{}: {reason}", .line.map_or_else(String::new, |line| format!(":{line}")))]
pub struct FileError {
    /// Path as given, or name of the leg in it.
    pub file: String,
    /// Line, from 1; `None` for the whole file.
    pub line: Option<usize>,
    /// Description.
    pub reason: String,
}

impl FileError {
    /// Error of the whole file.
    pub fn new(file: impl fmt::Display, reason: impl fmt::Display) -> Self {
        Self { file: file.to_string(), line: None, reason: reason.to_string() }
    }

    /// Error of a file that cannot be read.
    pub fn unreadable(path: &Path, error: &std::io::Error) -> Self {
        Self::new(path.display(), format!("cannot be read ({error})"))
    }

    /// Error at a byte of the text.
    pub(crate) fn at(file: &str, text: &str, start: Option<usize>, reason: String) -> Self {
        let line = |start| 1 + text.bytes().take(start).filter(|byte| *byte == b'\n').count();
        Self { file: file.to_owned(), line: start.map(line), reason }
    }
}

impl From<FileError> for ToolError {
    fn from(error: FileError) -> Self {
        Self::Input(error.to_string())
    }
}
