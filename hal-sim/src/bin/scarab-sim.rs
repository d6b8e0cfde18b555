//! The host tool: `cargo sim`.

fn main() -> std::process::ExitCode {
    hal_sim::tool::cli::main()
}
