//! What a board tells is what the host reports: a simulated leg tells its identification in records, and the report of those is
//! the run's own.

#[path = "../command/mod.rs"]
mod command;

mod broken;
mod decoding;
mod reported;
mod session;
