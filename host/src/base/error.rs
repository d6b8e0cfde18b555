//! Errors of the tool and their exit codes.

use std::path::Path;

/// Exit code of an accepted result.
pub const EXIT_ACCEPTED: u8 = 0;
/// Exit code of a rejected result.
pub const EXIT_REFUSED: u8 = 3;
/// Exit code of bad input.
pub const EXIT_INPUT: u8 = 2;

/// Reason for a missing result; names file, line and cause.
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
    #[must_use]
    pub fn input(reason: impl Into<String>) -> Self {
        Self::Input(reason.into())
    }

    /// Exit code of the process.
    #[must_use]
    pub fn exit_code(&self) -> u8 {
        if matches!(self, Self::Refused(_)) { EXIT_REFUSED } else { EXIT_INPUT }
    }

    /// Error of a file that cannot be written.
    #[must_use]
    pub fn cannot_write(path: &Path, error: &dyn std::fmt::Display) -> Self {
        Self::Input(format!("{}: cannot be written: {error}", path.display()))
    }
}
