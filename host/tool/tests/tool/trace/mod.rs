//! Records of a board compared with the report of the host: a simulated leg sends its identification as
//! records, and their report equals the run's own.

mod broken;
mod decoding;
mod reported;
pub mod session;
