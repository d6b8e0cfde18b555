//! A board's trace reported like a simulated run, and its log as a recording.

pub mod curves;
pub mod log;
pub mod report;
pub mod run;

pub use report::run_report;
