//! The host tool.
pub mod analysis;
pub mod leg_file;
pub mod recording;
pub mod report;
pub mod resample;
pub mod tables;
pub mod x2;
