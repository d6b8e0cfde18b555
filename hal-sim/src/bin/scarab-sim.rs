//! The host tool: `cargo sim`.
fn main() {}
