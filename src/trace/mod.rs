//! What a leg tells to whoever listens: records, one line each, that programs read.
//!
//! Why a grammar of its own: the same lines come from the board over a debug probe, from the emulator, and from a log file
//! a year later; a sentence for people cannot be read back, a table for programs cannot be read aloud.
//!
//! ```text
//! line   = kind *(" " key "=" value)               parameter n=41 joint=2 symbol=ZZ value=0.3127 unit=kg_m2 sigma=0.0021 ...
//! kind   = key = word of a-z, 0-9 and _
//! value  = list / any characters but space and [   a number that is not known is NaN; a name without one is -
//! list   = "[" value *(", " value) "]"
//! ```
//!
//! - Every record has a kind; the kinds and their keys are those of [`Record::FORMATS`], and only ever grow.
//! - The first key is always `n`: the record's number since the start, from 0. A gap is what was lost on the way; nothing on
//!   the board waits for a listener.
//! - Joints, motions and links are counted from 1; 0 means all, or none in particular. Motion 0 is the one identified from.
//! - Units are in the key (`rms_nm`) or beside the value (`unit=`, with `_` for a space). Words are those of the JSON.
//! - Numbers are written so that reading them gives the same bits again.
//!
//! | part | what it is |
//! | --- | --- |
//! | [`Record`] | everything that can be told, with the one format string that writes it here and on the wire |
//! | [`Line`] | a line read back |
//! | [`Report`] | an identification's result as a succession of records, one at a time |
//! | [`words`] | the words of states, activities, faults and refusals |
//!
//! On the device a record is not formatted: the feature `defmt` sends the format's index and the bare values
//! (`Record::emit`), and the host, which holds the image, writes the line. The tick never emits.

mod definition;
mod fill;
mod line;
mod record;
mod report;
pub mod words;

pub use fill::Value;
pub use line::{Line, LineError};
pub use record::Record;
pub use report::{Report, judged};

/// Of the records and keys; grows when one is added.
pub const GRAMMAR: u8 = 1;
