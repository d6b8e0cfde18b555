//! Recordings in Parquet and MCAP files, as columns of numbers.
//!
//! Why a crate of its own: these libraries take minutes to compile, and `parquet` is under Apache-2.0 only.
//! `scarab-identify` uses it with the feature `readers`.
//!
//! Every file is untrusted. A record or page that claims more than 64 MB is refused before it is decoded, and
//! the file is read piece by piece. Memory therefore does not grow with the file.

mod guarded;
pub mod mcap;
pub mod parquet;

use std::fmt;
use std::ops::ControlFlow;

/// Largest record of an MCAP file, and largest page of a Parquet file, bytes.
pub const LARGEST_PIECE: usize = 64 << 20;

/// Column of numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name in the file.
    pub name: String,
    /// Unit that the file states: `s`, `ms`, `us` or `ns`.
    pub unit: Option<&'static str>,
}

/// One row of the chosen columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<'a> {
    /// Number of the row or message in the file, from 1.
    pub number: u64,
    /// Values in the order of the chosen columns, as the file holds them; NaN where a value is missing.
    pub values: &'a [f64],
    /// Share of the file that is read, 0 to 1.
    pub done: f64,
}

/// Takes one row, and ends the reading if it breaks.
pub type Take<'a> = &'a mut dyn FnMut(Row<'_>) -> ControlFlow<()>;

/// File that holds columns of numbers.
pub trait Table {
    /// All columns.
    fn columns(&self) -> &[Column];

    /// Passes every row of the columns with these indices to `take`.
    ///
    /// # Errors
    /// The file is damaged, or a column does not hold numbers.
    fn read(&self, chosen: &[usize], take: Take<'_>) -> Result<(), Error>;
}

/// Reason for which a file is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error(pub String);

impl Error {
    pub(crate) fn new(reason: impl Into<String>) -> Self {
        Self(reason.into())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl std::error::Error for Error {}

impl From<std::io::Error> for Error {
    fn from(error: std::io::Error) -> Self {
        Self(format!("cannot be read ({error})"))
    }
}
