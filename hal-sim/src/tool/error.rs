//! Errors of the tool and the exit codes they become.

use std::path::Path;

use super::leg_file::LegFileError;
use super::model_file::ModelFileError;
use super::recording::RecordingError;
use super::setup::SetupError;

/// Done, and the result was accepted.
pub const EXIT_ACCEPTED: u8 = 0;
/// Done, and the result was refused.
pub const EXIT_REFUSED: u8 = 3;
/// Bad input.
pub const EXIT_INPUT: u8 = 2;

/// Why there is no result, in words that name file, line and reason.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// A leg file.
    #[error(transparent)]
    LegFile(#[from] LegFileError),
    /// A model file.
    #[error(transparent)]
    ModelFile(#[from] ModelFileError),
    /// Readable and well-formed, but not to be used: exit code [`EXIT_REFUSED`], not [`EXIT_INPUT`].
    #[error("{0}")]
    Refused(String),
    /// A recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A leg that cannot be worked with.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// Anything else a user can mend.
    #[error("{0}")]
    Input(String),
}

impl ToolError {
    /// Bad input, in words.
    #[must_use]
    pub fn input(reason: impl Into<String>) -> Self {
        Self::Input(reason.into())
    }

    /// What it becomes of the process.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        if matches!(self, Self::Refused(_)) { EXIT_REFUSED } else { EXIT_INPUT }
    }

    /// A file that cannot be written.
    #[must_use]
    pub fn cannot_write(path: &Path, error: &dyn std::fmt::Display) -> Self {
        Self::Input(format!("{}: cannot be written: {error}", path.display()))
    }
}
