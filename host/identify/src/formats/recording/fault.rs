//! Faults of recordings in plain words.

use std::fmt;

use crate::formats::recording::signal::Signal;
use crate::formats::recording::{
    MINIMUM_DURATION_S, MINIMUM_RATE_HZ, MINIMUM_SAMPLES, MOST_BAD_PERCENT, MOST_SAMPLES,
};

/// Fault of a recording, in plain words.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Fault {
    /// The file is empty or has blank lines only.
    #[error("the file is empty")]
    Empty,
    /// Invalid CSV, for example an unclosed quotation mark.
    #[error("not a CSV file ({0})")]
    NotCsv(csv::Error),
    /// The header lacks a column that the leg needs.
    #[error("the header has no column `{column}`; its columns are: {}; needed are: {needed}{advice}", Excerpt(.present))]
    MissingColumn {
        /// Requested name.
        column: String,
        /// Names in the header.
        present: String,
        /// All names that are needed.
        needed: String,
        /// Complete command that would read the file, or how to find one.
        advice: String,
    },
    /// The first row has numbers only, and no columns are chosen by number.
    #[error("the file has no header: its first row has {columns} numbers ({}). {advice}", Excerpt(.first))]
    NoHeader {
        /// First row.
        first: String,
        /// Number of its fields.
        columns: usize,
        /// Example of a complete command, or the numbers that are needed.
        advice: String,
    },
    /// A column is chosen by a number beyond the last one.
    #[error("--columns {signal}={number}: the file has {columns} columns")]
    NoSuchColumn {
        /// Signal of the column.
        signal: Signal,
        /// Number, from 1.
        number: usize,
        /// Columns of the file.
        columns: usize,
    },
    /// One column is chosen for two signals.
    #[error(
        "--columns: {one} and {other} are both read from column `{column}`: give every signal its own column"
    )]
    SharedColumn {
        /// Column name.
        column: String,
        /// First signal.
        one: Signal,
        /// Second signal.
        other: Signal,
    },
    /// A file with times has no use for a rate.
    #[error(
        "the file has the column of time `{0}`: leave out --rate, or let an even clock replace it (--even-stamps)"
    )]
    RateAndTime(String),
    /// No row holds all signals.
    #[error(
        "angles and torques are in different rows: none of the first {rows} has all of {columns}; --merge-rows joins \
         them by time"
    )]
    Scattered {
        /// Rows looked at.
        rows: usize,
        /// Names of the columns.
        columns: String,
    },
    /// The name of a column states another unit than the one in use.
    #[error("column `{column}` is in {named} by its name or type, but {signal} is read in {used}{advice}")]
    OtherUnit {
        /// Column name.
        column: String,
        /// Unit in the name.
        named: &'static str,
        /// Signal of the column.
        signal: Signal,
        /// Unit in use.
        used: &'static str,
        /// Complete command with the unit of the name.
        advice: String,
    },
    /// The leg file does not state the conversion from the motor to the joint.
    #[error("column `{column}` is of the motor, but the leg file states no `{key}`{} for joint `{joint}`: add it below that joint's `name` (docs/files.md)",
        if *.key == "encoder" { " at the motor" } else { "" })]
    NoDrive {
        /// Column name.
        column: String,
        /// Missing key of the leg file.
        key: &'static str,
        /// Name of the joint.
        joint: String,
    },
    /// The first rows allow two readings.
    #[error("{what}: state which is right by {options}")]
    Ambiguous {
        /// Both readings.
        what: String,
        /// Options that settle it.
        options: String,
    },
    /// The bytes cannot be read, or are not text.
    #[error("{0}")]
    Unreadable(String),
    /// A damaged row, which may be skipped.
    #[error("{0} (--skip-bad skips such rows, up to {MOST_BAD_PERCENT} %)")]
    Skippable(Box<Fault>),
    /// More rows are invalid than may be skipped.
    #[error(
        "{skipped} of {rows} rows are invalid, --skip-bad skips at most {MOST_BAD_PERCENT} %; the first: {first}"
    )]
    TooManyBad {
        /// Invalid rows.
        skipped: usize,
        /// All rows.
        rows: usize,
        /// Line and fault of the first invalid one.
        first: String,
    },
    /// The samples would not fit into memory.
    #[error("more than {MOST_SAMPLES} samples: split the file")]
    TooManySamples,
    /// Two columns have the same name, which is ambiguous.
    #[error("the header has the column `{0}` twice")]
    RepeatedColumn(String),
    /// A truncated line, decimal commas, or a line of another file.
    #[error("{found} field{}, but the header has {expected}: {}", if *.found == 1 { "" } else { "s" },
        if .found < .expected { "is the line truncated?" } else { "are these decimal commas?" })]
    FieldCount {
        /// Fields in this line.
        found: usize,
        /// Fields in the header.
        expected: usize,
    },
    /// The field is empty or not a number.
    #[error("`{}` in column `{column}` is not a number{}", Excerpt(.text), CommaHint(.text))]
    NotANumber {
        /// Column name.
        column: String,
        /// Field as written in the file.
        text: String,
    },
    /// The number is `NaN` or infinite.
    #[error("`{}` in column `{column}` is not finite", Excerpt(.text))]
    NotFinite {
        /// Column name.
        column: String,
        /// Field as written in the file.
        text: String,
    },
    /// The number is beyond any leg's range.
    #[error(
        "{} in column `{column}` exceeds {}{}", Short(*.value), Short(*.limit),
        if .advice.is_empty() { ": is it in another unit?" } else { .advice.as_str() }
    )]
    Absurd {
        /// Column name.
        column: String,
        /// The number.
        value: f64,
        /// Largest magnitude accepted.
        limit: f64,
        /// Unit in which the time would be valid, with the complete command.
        advice: String,
    },
    /// The numbers are finite, but their torque is not.
    #[error("the torque of this state exceeds the range of double precision")]
    OutOfRange,
    /// Time does not increase.
    #[error(
        "time {} s does not exceed the previous {} s{}", Short(*.time), Short(*.previous),
        if .time == .previous { "; if the times are rounded, --even-stamps replaces them" } else { "" }
    )]
    TimeNotIncreasing {
        /// Previous stamp.
        previous: f64,
        /// Stamp of this line.
        time: f64,
    },
    /// A row is written twice.
    #[error("the row repeats the one before it; --skip-bad keeps one of repeated rows")]
    Repeated,
    /// Samples are missing.
    #[error(
        "{gap:.3} s without a sample before this line; at most {limit:.3} s are bridged: cut the file before this line and \
         give both parts"
    )]
    Gap {
        /// Duration of the gap, s.
        gap: f64,
        /// Longest accepted gap in this recording, s.
        limit: f64,
    },
    /// An angle was wrapped into one turn.
    #[error(
        "q{joint}_rad jumps by {jump:.2} rad, a whole turn, in one sample: unwrap the angle (in Python: numpy.unwrap)"
    )]
    Wrapped {
        /// Joint, from 1.
        joint: usize,
        /// Change within one sample, rad.
        jump: f64,
    },
    /// Most samples are too far apart.
    #[error(
        "the median step of the time is {} s, which is {} Hz; at least {MINIMUM_RATE_HZ} Hz are needed{advice}",
        Short(*.step_s), rounded(1.0 / .step_s)
    )]
    TooSlow {
        /// Median time between two samples, s.
        step_s: f64,
        /// Unit in which the time would be valid, with the complete command.
        advice: String,
    },
    /// The recording is too short for an identification.
    #[error(
        "too short: {samples} samples over {duration:.3} s, but at least {MINIMUM_SAMPLES} over {MINIMUM_DURATION_S} s are \
         needed{advice}"
    )]
    TooShort {
        /// Number of samples.
        samples: usize,
        /// Time from first to last sample, s.
        duration: f64,
        /// Unit in which the time would be valid, with the complete command.
        advice: String,
    },
}

impl Fault {
    /// Whether the fault is one row's, so that the row can be skipped.
    pub(crate) fn is_of_row(&self) -> bool {
        matches!(
            self,
            Self::FieldCount { .. }
                | Self::NotANumber { .. }
                | Self::NotFinite { .. }
                | Self::Absurd { .. }
                | Self::TimeNotIncreasing { .. }
                | Self::Repeated
        )
    }

    /// Whether the fault is the unit of all rows.
    pub(crate) fn is_of_unit(&self) -> bool {
        matches!(self, Self::Absurd { advice, .. } if !advice.is_empty())
    }
}

/// Limit of characters of a file in a message: the file may be of any kind and size.
const EXCERPT: usize = 200;

/// Excerpt of a file on one line.
struct Excerpt<'a>(&'a str);

impl fmt::Display for Excerpt<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for character in self.0.chars().take(EXCERPT) {
            if character.is_control() {
                write!(formatter, "{}", character.escape_default())?;
            } else {
                write!(formatter, "{character}")?;
            }
        }
        if self.0.chars().nth(EXCERPT).is_some() { formatter.write_str(" ..") } else { Ok(()) }
    }
}

/// Hint for a number with a comma.
struct CommaHint<'a>(&'a str);

impl fmt::Display for CommaHint<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.contains(',') && self.0.replacen(',', ".", 1).parse::<f64>().is_ok() {
            formatter.write_str(" (if the comma is a decimal comma: --decimal comma)")
        } else {
            Ok(())
        }
    }
}

/// Rounds to four digits.
pub(crate) fn rounded(rate: f64) -> f64 {
    format!("{rate:.3e}").parse().unwrap_or(rate)
}

/// Short form of a number without hundreds of digits.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.abs() < 1e7 { write!(formatter, "{}", self.0) } else { write!(formatter, "{:e}", self.0) }
    }
}
