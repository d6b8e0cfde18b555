//! Error of a model file with its position.

use core::fmt;

use toml::de::{DeTable, DeValue};

use crate::base::error::ToolError;
use crate::base::toml_fault::reason;

/// File that is not a valid model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct ModelFileError {
    /// Path as given.
    pub file: String,
    /// Line, from 1, if the error has one.
    pub line: Option<usize>,
    /// Description.
    pub reason: String,
}

impl fmt::Display for ModelFileError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(formatter, "{}:{line}: {}", self.file, self.reason),
            None => write!(formatter, "{}: {}", self.file, self.reason),
        }
    }
}

/// One step of a path into a file.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Key(&'static str),
    Entry(usize),
}

/// Rejected value and its position.
pub(super) struct Fault {
    pub steps: Vec<Step>,
    pub reason: String,
}

impl ModelFileError {
    pub(super) fn of_file(file: &str, reason: String) -> Self {
        Self { file: file.to_owned(), line: None, reason }
    }

    /// Error of syntax, types, unknown or missing keys.
    pub(super) fn of_text(file: &str, text: &str, fault: &toml::de::Error) -> Self {
        let line = fault.span().map(|span| line_of(text, span.start));
        Self { file: file.to_owned(), line, reason: reason(fault) }
    }

    /// Error of a value outside its bounds.
    pub(super) fn of_value(file: &str, text: &str, steps: &[Step], reason: String) -> Self {
        let line = locate(text, steps).map(|start| line_of(text, start));
        Self { file: file.to_owned(), line, reason }
    }
}

fn line_of(text: &str, start: usize) -> usize {
    1 + text.as_bytes().iter().take(start).filter(|&&byte| byte == b'\n').count()
}

/// Start of the deepest existing step.
fn locate(text: &str, steps: &[Step]) -> Option<usize> {
    let root = DeTable::parse(text).ok()?;
    let (first, rest) = steps.split_first()?;
    let Step::Key(key) = first else { return None };
    let (mut start, mut value) = entry_of(root.get_ref(), key)?;
    for step in rest {
        let inner = match step {
            Step::Key(key) => value.as_table().and_then(|table| entry_of(table, key)),
            Step::Entry(index) => value
                .as_array()
                .and_then(|array| array.get(*index))
                .map(|entry| (entry.span().start, entry.get_ref())),
        };
        let Some(inner) = inner else { break };
        (start, value) = inner;
    }
    Some(start)
}

fn entry_of<'a, 'i>(table: &'a DeTable<'i>, key: &str) -> Option<(usize, &'a DeValue<'i>)> {
    let (name, value) = table.iter().find(|(name, _)| name.get_ref().as_ref() == key)?;
    Some((name.span().start, value.get_ref()))
}

impl From<ModelFileError> for ToolError {
    fn from(error: ModelFileError) -> Self {
        Self::Input(error.to_string())
    }
}
