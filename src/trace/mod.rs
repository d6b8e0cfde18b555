//! Trace of a leg: records of one line each, for programs to read.
//!
//! Why a separate grammar: the same lines come from the board over a debug probe, from the model of its
//! microcontroller, and from a log file a year later. A program cannot read sentences back, and a person
//! cannot read a binary table.
//!
//! ```text
//! line   = kind *(" " key "=" value)               parameter n=41 joint=2 symbol=ZZ value=0.3127 ...
//! kind   = key = word of a-z, 0-9 and _
//! value  = list / any characters but space and [   an unknown number is NaN; an unknown name is -
//! list   = "[" value *(", " value) "]"
//! ```
//!
//! - Every record has a kind; the kinds and their keys are those of [`Record::FORMATS`], and only ever grow.
//! - The first key is always `n`: the record's number since the start, from 0. A gap means lost records; the
//!   board never waits for a listener.
//! - Joints, motions and links are counted from 1; 0 means all, or none in particular. Motion 0 is the one
//!   identified from.
//! - Units are in the key (`rms_nm`) or beside the value (`unit=`, with `_` for a space).
//!   Words are those of the JSON.
//! - Numbers are written so that reading them gives the same bits again.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`Record`] | all kinds of records, each with one format string for text and for the wire |
//! | [`Line`] | a line read back |
//! | [`Report`] | an identification's result as a sequence of records, one at a time |
//! | [`words`] | the words of states, activities, faults and refusals |
//!
//! On the device a record is not formatted. The feature `defmt` sends the format's index and the raw values
//! (`Record::emit`); the host, which has the image, writes the line. The servo tick never emits.

mod definition;
mod fill;
mod line;
mod record;
mod report;
pub mod words;

pub use line::{Line, LineError};
pub use record::Record;
pub use report::Report;
pub(crate) use report::judged;

/// Version of records and keys; increases when an older reader would misread a record. A new value gets a new
/// kind of record, because a reader refuses a record without one of its keys.
pub const GRAMMAR: u8 = 1;
