//! What is wrong with a leg file, and where.

use super::check::Fault;
use core::fmt;
use toml::de::{DeTable, DeValue};

/// A leg file that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct LegFileError {
    /// Path or name, as it was given.
    pub file: String,
    /// Counted from 1, where one line is to blame.
    pub line: Option<usize>,
    /// In words.
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
    /// The file as a whole.
    pub(super) fn of_file(file: &str, reason: String) -> Self {
        Self { file: file.to_owned(), line: None, reason }
    }

    /// Syntax, types and unknown keys.
    pub(super) fn of_text(file: &str, text: &str, fault: &toml::de::Error) -> Self {
        let line = fault.span().map(|span| line_of(text, span.start));
        Self { file: file.to_owned(), line, reason: fault.message().replace('\n', ", ") }
    }

    /// A value that was read but cannot be meant.
    pub(super) fn of_value(file: &str, text: &str, fault: &Fault) -> Self {
        let line = locate(text, fault.joint, &fault.keys).map(|start| line_of(text, start));
        Self { file: file.to_owned(), line, reason: fault.reason.clone() }
    }
}

fn line_of(text: &str, start: usize) -> usize {
    1 + text.as_bytes().iter().take(start).filter(|&&byte| byte == b'\n').count()
}

/// Where the deepest key of a path that exists begins: a default has no line of its own, its joint has.
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
