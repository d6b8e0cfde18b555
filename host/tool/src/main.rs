//! The host tool: `cargo sim`.

fn main() -> std::process::ExitCode {
    scarab_tool::cli::main()
}
