//! Basics that every module uses: errors, numbers and their formatting, output files, shards.

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
