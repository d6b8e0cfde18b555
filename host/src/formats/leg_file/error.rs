//! Error of a leg file with its position.

use core::fmt;

use toml::de::{DeTable, DeValue};

use crate::base::error::ToolError;
use crate::base::toml_fault::reason;
use crate::formats::leg_file::check::Fault;

/// Leg file that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct LegFileError {
    /// Path or name as given.
    pub file: String,
    /// Line, from 1, if the error has one.
    pub line: Option<usize>,
    /// Description.
    pub reason: String,
}

impl fmt::Display for LegFileError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(formatter, "{}:{line}: {}", self.file, self.reason),
            None => write!(formatter, "{}: {}", self.file, self.reason),
        }
    }
}

impl LegFileError {
    /// Error of the file as a whole.
    pub(super) fn of_file(file: &str, reason: String) -> Self {
        Self { file: file.to_owned(), line: None, reason }
    }

    /// Error of syntax, types or unknown keys.
    pub(super) fn of_text(file: &str, text: &str, fault: &toml::de::Error) -> Self {
        let line = fault.span().map(|span| line_of(text, span.start));
        Self { file: file.to_owned(), line, reason: reason(fault) }
    }

    /// Error of a value outside its bounds.
    pub(super) fn of_value(file: &str, text: &str, fault: &Fault) -> Self {
        let line = locate(text, fault.joint, &fault.keys).map(|start| line_of(text, start));
        Self { file: file.to_owned(), line, reason: fault.reason.clone() }
    }
}

fn line_of(text: &str, start: usize) -> usize {
    1 + text.as_bytes().iter().take(start).filter(|&&byte| byte == b'\n').count()
}

/// Start of the deepest existing key of a path. A default has no line of its own; its joint has one.
fn locate(text: &str, joint: Option<usize>, keys: &[&str]) -> Option<usize> {
    let root = DeTable::parse(text).ok()?;
    let mut table = root.get_ref();
    let mut found = None;
    if let Some(number) = joint {
        let entry = find(table, "joint")?.1.as_array()?.get(number)?;
        found = Some(entry.span().start);
        table = entry.get_ref().as_table()?;
    }
    for key in keys {
        let Some((start, value)) = find(table, key) else { break };
        found = Some(start);
        let Some(inner) = value.as_table() else { break };
        table = inner;
    }
    found
}

fn find<'a, 'i>(table: &'a DeTable<'i>, key: &str) -> Option<(usize, &'a DeValue<'i>)> {
    let (name, value) = table.iter().find(|(name, _)| name.get_ref().as_ref() == key)?;
    Some((name.span().start, value.get_ref()))
}

impl From<LegFileError> for ToolError {
    fn from(error: LegFileError) -> Self {
        Self::Input(error.to_string())
    }
}
