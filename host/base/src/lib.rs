//! Basics of the host crates.
//!
//! | module | contents |
//! | --- | --- |
//! | [`error`], [`output`], [`shell`] | errors and exit codes, standard output, words of a command line |
//! | [`files`], [`toml_file`] | texts that are read, files that are written, TOML |
//! | [`number`], [`precision`], [`rounding`], [`words`] | numbers and words of reports and files |
//! | [`names`], [`table`] | names in reports; tables as text, HTML and Markdown |
//! | [`random`], [`shard`], [`stats`] | random numbers of a run, runs divided among processes, statistics |

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
