//! The host tool.
pub mod analysis;
pub mod report;
pub mod tables;
