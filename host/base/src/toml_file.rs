//! TOML files: parsing, and errors with the line of the value at fault.

use serde::de::DeserializeOwned;
use toml::de::{DeTable, DeValue};

use crate::error::FileError;

/// Likeness (Jaro and Winkler, 0 to 1) from which a known word is proposed.
const ALIKE: f64 = 0.8;

/// Text as a TOML string, with quotation marks.
pub fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// One step of a path into a file.
#[derive(Clone, Copy, Debug)]
pub enum Step {
    /// Key of a table.
    Key(&'static str),
    /// Entry of a list, from 0.
    Entry(usize),
}

/// Rejected value, its position and the reason.
#[derive(Clone, Debug)]
pub struct Fault {
    /// Path to the value.
    pub steps: Vec<Step>,
    /// Description.
    pub reason: String,
}

impl Fault {
    /// Error with the line of the value; a default has no line of its own, what contains it has.
    pub fn in_file(self, file: &str, text: &str) -> FileError {
        FileError::at(file, text, locate(text, &self.steps), self.reason)
    }
}

/// Parses a text; an error of syntax, types or keys has its line.
pub fn parse<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, FileError> {
    toml::from_str(text)
        .map_err(|fault| FileError::at(file, text, fault.span().map(|span| span.start), reason(&fault)))
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

/// Reason in one line; for an unknown key or value with the known word that is most like it.
fn reason(fault: &toml::de::Error) -> String {
    let reason = fault.message().replace('\n', ", ");
    match proposal(&reason) {
        Some(word) => format!("{reason}; did you mean `{word}`?"),
        None => reason,
    }
}

/// The reader writes "unknown field `a`, expected one of `b`, `c`": the first word is the wrong one.
fn proposal(reason: &str) -> Option<&str> {
    if !reason.starts_with("unknown ") {
        return None;
    }
    let mut words = reason.split('`').skip(1).step_by(2);
    let wrong = words.next()?;
    words
        .map(|word| (strsim::jaro_winkler(wrong, word), word))
        .filter(|(likeness, _)| *likeness >= ALIKE)
        .max_by(|one, other| one.0.total_cmp(&other.0))
        .map(|(_, word)| word)
}

#[cfg(test)]
mod tests {
    use super::proposal;

    #[test]
    fn a_misspelt_key_is_answered_with_the_nearest_one() {
        assert_eq!(proposal("unknown field `viscos`, expected one of `mass`, `viscous`"), Some("viscous"));
        assert_eq!(proposal("unknown variant `moter`, expected `motor` or `joint`"), Some("motor"));
        assert_eq!(proposal("unknown field `colour`, expected one of `mass`, `com`"), None);
        assert_eq!(proposal("missing field `name`"), None);
    }
}
