//! How the files of a replay were read: columns, units, conversions, skipped rows.

use serde::Serialize;

/// One file as it was read.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ReadReport {
    /// Name as given.
    pub file: String,
    /// Format in words.
    pub format: String,
    /// Whether a header named the columns.
    pub header: bool,
    /// Samples read.
    pub samples: usize,
    /// Column of every signal.
    pub columns: Vec<ColumnReport>,
    /// Rows that `--skip-bad` skipped.
    pub skipped: usize,
    /// Reasons for that, with the first line of each.
    pub skipped_why: Vec<SkippedReport>,
    /// Doubt about the file, in words; printed only.
    #[serde(skip)]
    pub warning: Option<String>,
}

/// Column of one signal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ColumnReport {
    /// Signal: `t`, `q1`, `motor1`, `tau1` or `i1`.
    pub signal: String,
    /// Name of the column in the file, or its number from 1.
    pub column: String,
    /// Unit of the column's numbers.
    pub unit: String,
    /// SI value of the time, joint angle or joint torque over the number in the file.
    pub factor: f64,
    /// Key of the leg file whose value is part of the factor.
    pub by: Option<&'static str>,
}

/// Rows skipped for one reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SkippedReport {
    /// Line of the first of them.
    pub line: usize,
    /// Reason of that one.
    pub reason: String,
    /// Rows with a reason of this kind.
    pub rows: usize,
}

impl ReadReport {
    /// Whether something is not as documented for a recording in SI units, and must be printed.
    pub fn is_notable(&self) -> bool {
        let is_plain = |column: &ColumnReport| column.factor == 1.0 && column.by.is_none();
        self.skipped > 0
            || !self.header
            || ![PLAIN_FORMAT, ARRAYS].contains(&self.format.as_str())
            || !self.columns.iter().all(is_plain)
            || self.columns.iter().any(|column| column.column != format!("{}_{}", column.signal, column.unit))
    }
}

/// Format that needs no mention.
pub(crate) const PLAIN_FORMAT: &str = "CSV with commas";
/// Format of samples that a program holds.
pub(crate) const ARRAYS: &str = "arrays";
