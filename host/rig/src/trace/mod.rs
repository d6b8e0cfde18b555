//! Records of a board, read back. [`crate::traced`] reports them like a simulated run.
//!
//! Why: the board identifies on its own and logs the result as records (`scarab::trace`). A listener may be a
//! debug probe, the model of the microcontroller, or a file read a year later. Each gets the tables, JSON,
//! page and exit code of a simulated run.
//!
//! ```text
//! defmt stream + image --decode--> lines --read--> Trace --report--> RunReport: tables, JSON, page
//! text of a probe's log ----------/              \--log--> recording for `replay`
//! ```
//!
//! | module | contents |
//! | --- | --- |
//! | [`decode`] | frames of a `defmt` stream to lines |
//! | [`text`] | finds the record in a line of text, whatever a logger put around it |
//! | [`read`] | [`Trace`]: lines to records in order, with what was lost |
//! | [`records`] | records to values, by the firmware's list |
//! | `result_records` | records of one identification's result |
//! | [`events`] | the timeline in words |
//! | [`loops`] | statistics of loops, stack and supply |

pub mod decode;
pub mod events;
pub mod loops;
pub mod read;
pub mod records;
pub(crate) mod result_records;
pub mod text;

pub use decode::Decoder;
pub use read::Trace;
