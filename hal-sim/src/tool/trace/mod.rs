//! `trace`: what a board told, read back and reported as a run is.
//!
//! Why: the board identifies on its own and tells it in records (`scarab::trace`). Whoever listened, with a debug probe, in the
//! emulator or from a file a year later, wants the tables, the JSON, the page and the exit code that a simulated run has.
//!
//! ```text
//! defmt stream + image --decode--> lines --read--> Trace --report--> RunReport: tables, JSON, page
//! text of a probe's log ----------/              \--log--> recording for `replay`
//! ```
//!
//! | module | what lives there |
//! | --- | --- |
//! | [`decode`] | frames of a `defmt` stream to lines |
//! | [`text`] | the record in a line of text, whatever a logger put around it |
//! | [`read`] | [`Trace`]: lines to what was told, in order, with what was lost |
//! | [`fields`] | records to values |
//! | [`told`] | one identification's result as it was told |
//! | [`events`] | the timeline in words |
//! | [`loops`] | statistics of loops, stack and supply |
//! | [`report`] | the last complete result as a run's report |
//! | [`log`], [`curves`] | the 500 Hz log as a recording, and drawn |
//! | [`run`] | all of it for the command line |

pub mod curves;
pub mod decode;
pub mod events;
pub mod fields;
pub mod log;
pub mod loops;
pub mod read;
pub mod report;
pub mod run;
pub mod text;
pub mod told;

pub use decode::Decoder;
pub use read::Trace;
pub use report::{TraceReport, run_report};
