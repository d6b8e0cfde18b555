//! The chip model's program: `cargo chip`.

fn main() -> std::process::ExitCode {
    scarab_chip::cli::main()
}
