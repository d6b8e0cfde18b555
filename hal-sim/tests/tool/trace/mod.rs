//! What a board tells is what the host reports: a simulated leg tells its identification in records, and the report of those is
//! the run's own.

mod broken;
mod decoding;
mod reported;
pub mod session;
