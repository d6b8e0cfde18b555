//! The paper's experiments: claims that hold for any few runs, and the command's interface.

mod chain;
#[path = "../../../host/tool/tests/tool/command.rs"]
#[allow(dead_code, reason = "shared with the tests of the host tool, which use all of it")]
mod command;
mod shards;
mod tables;

/// Program under test.
const PROGRAM: &str = env!("CARGO_BIN_EXE_scarab-paper");
