//! Why a file is no recording: every refusal in plain words, with the place where it shows.

use std::fmt;
use std::io;
use std::path::PathBuf;

use super::{MINIMUM_DURATION_S, MINIMUM_RATE_HZ, MINIMUM_SAMPLES};

/// Why a file is no recording, and where it shows. Displays as `file:line: reason`.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {fault}", .file.display(), LineSuffix(*.line))]
pub struct RecordingError {
    /// The file as it was named.
    pub file: PathBuf,
    /// Counted from 1, header included; none where the whole file is meant.
    pub line: Option<usize>,
    /// The reason.
    pub fault: Fault,
}

/// What is wrong with a recording, in plain words.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The file cannot be opened or read.
    #[error("cannot be read ({0})")]
    Unreadable(io::Error),
    /// The bytes are not UTF-8.
    #[error("not a text file")]
    NotText,
    /// Nothing, or blank lines only.
    #[error("the file is empty")]
    Empty,
    /// A quotation mark that is never closed, or the like.
    #[error("not a CSV file ({0})")]
    NotCsv(csv::Error),
    /// The header lacks a column that the leg needs.
    #[error("the header has no column `{column}`; its columns are: {}{}", Excerpt(.present), Separator(.present))]
    MissingColumn {
        /// Name looked for.
        column: String,
        /// Names found.
        present: String,
    },
    /// Two columns of one name: nobody can know which is meant.
    #[error("the header has the column `{0}` twice")]
    RepeatedColumn(String),
    /// A truncated line, decimal commas, or a line of another file.
    #[error("{found} fields, but the header has {expected}: {}",
        if .found < .expected { "is the line truncated?" } else { "are these decimal commas?" })]
    FieldCount {
        /// In this line.
        found: usize,
        /// In the header.
        expected: usize,
    },
    /// Letters, an empty field.
    #[error("`{}` in column `{column}` is not a number", Excerpt(.text))]
    NotANumber {
        /// Column name.
        column: String,
        /// The field as it stands in the file.
        text: String,
    },
    /// `NaN` or `inf`.
    #[error("`{}` in column `{column}` is not finite", Excerpt(.text))]
    NotFinite {
        /// Column name.
        column: String,
        /// The field as it stands in the file.
        text: String,
    },
    /// A number no leg can reach.
    #[error("{} in column `{column}` is beyond {}: is it in another unit?", Short(*.value), Short(*.limit))]
    Absurd {
        /// Column name.
        column: String,
        /// The number.
        value: f64,
        /// Largest magnitude accepted.
        limit: f64,
    },
    /// Finite numbers whose torque is not.
    #[error("the torque of this state is beyond the range of the numbers computed with")]
    OutOfRange,
    /// Time does not increase.
    #[error("time {} from {} s to {} s",
        if *.time < *.previous { "goes back" } else { "stands still" }, Short(*.previous), Short(*.time))]
    TimeNotIncreasing {
        /// The stamp before.
        previous: f64,
        /// This line's stamp.
        time: f64,
    },
    /// Samples are missing.
    #[error("{gap:.3} s without a sample before this line; at most {limit:.3} s are bridged")]
    Gap {
        /// Length, s.
        gap: f64,
        /// Longest accepted in this recording, s.
        limit: f64,
    },
    /// Most samples are too far apart.
    #[error(
        "the median step of `t_s` is {} s, which is {} Hz; at least {MINIMUM_RATE_HZ} Hz are needed. `t_s` is in seconds{}",
        Short(*.step_s), rounded(1.0 / .step_s), OtherUnit(*.step_s, *.counts)
    )]
    TooSlow {
        /// Median distance of two samples, s.
        step_s: f64,
        /// Each stamp is one more than the one before.
        counts: bool,
    },
    /// Too little to identify anything.
    #[error(
        "too short: {samples} samples over {duration:.3} s, but at least {MINIMUM_SAMPLES} over {MINIMUM_DURATION_S} s are needed"
    )]
    TooShort {
        /// Number of samples.
        samples: usize,
        /// From first to last, s.
        duration: f64,
    },
}

/// `:12` after the file's name, or nothing.
struct LineSuffix(Option<usize>);

impl fmt::Display for LineSuffix {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.map_or(Ok(()), |line| write!(formatter, ":{line}"))
    }
}

/// Most characters of a file that a message repeats: it may be any file, of any size.
const EXCERPT: usize = 200;

/// What stands in a file, on one line and not at length.
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

/// A hint where the header is a single column with another separator in it.
struct Separator<'a>(&'a str);

impl fmt::Display for Separator<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.0.contains(',') && self.0.contains([';', '\t']) {
            formatter.write_str(" (columns are separated by commas, numbers written with points)")
        } else {
            Ok(())
        }
    }
}

/// Units of time that recorders use, in seconds.
const UNITS: [(&str, f64); 3] = [("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)];

/// The unit in which stamps so far apart would be a recording's, if there is one.
struct OtherUnit(f64, bool);

impl fmt::Display for OtherUnit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rates = UNITS.map(|(unit, second)| (unit, 1.0 / (self.0 * second)));
        let Some((unit, rate)) = rates.into_iter().find(|(_, rate)| *rate >= MINIMUM_RATE_HZ) else {
            return Ok(());
        };
        let or_numbers = if self.1 { " or sample numbers" } else { "" };
        write!(formatter, ": are these {unit}{or_numbers}? In {unit} it would be {} Hz", rounded(rate))
    }
}

/// Four digits.
fn rounded(rate: f64) -> f64 {
    format!("{rate:.3e}").parse().unwrap_or(rate)
}

/// A number as one reads it, not with three hundred digits.
struct Short(f64);

impl fmt::Display for Short {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.abs() < 1e7 { write!(formatter, "{}", self.0) } else { write!(formatter, "{:e}", self.0) }
    }
}
