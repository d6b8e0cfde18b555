//! Basics of the host crates: errors, numbers and their formatting, tables, output files, shards.

#![expect(
    clippy::disallowed_methods,
    reason = "the tool runs on the host only and may use std's mathematics"
)]

pub mod error;
pub mod files;
pub mod names;
pub mod number;
pub mod output;
pub mod precision;
pub mod random;
pub mod rounding;
pub mod shard;
pub mod shell;
pub mod stats;
pub mod table;
pub mod toml_file;
pub mod words;
