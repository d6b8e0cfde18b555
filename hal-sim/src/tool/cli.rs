//! The command line: one file for each command.

mod common;
mod eds;
mod emulate;
mod excite;
mod export;
mod faults;
mod identify;
mod image;
mod kept;
mod leg_options;
mod model;
mod monitor;
mod motor;
mod noise;
mod paper;
mod predict;
mod regressor;
mod replay;
mod serve;
mod states;
mod trace;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use super::error::{EXIT_REFUSED, ToolError};
use super::files;

/// Identifies legs, simulated or recorded. Exit codes: 0 accepted, 3 refused, 2 bad input.
#[derive(Parser, Debug)]
#[command(name = "scarab-sim", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Identify a simulated leg: drive it, log it, solve, validate, track.
    Identify(identify::IdentifyArguments),
    /// Design an exciting motion and predict its result before anything moves.
    Excite(excite::ExciteArguments),
    /// Identify a leg from recordings.
    Replay(replay::ReplayArguments),
    /// Decode and report the trace of a board.
    Trace(trace::TraceArguments),
    /// Predict the torque of given states from a stored model: CSV.
    Predict(predict::PredictArguments),
    /// Write a stored model as a robot description.
    Export(export::ExportArguments),
    /// Write the electronic data sheets of the bus' nodes, one per joint.
    Eds(eds::EdsArguments),
    /// Serve legs on a CANopen bus, reached by host software over TCP (slcan).
    Serve(serve::ServeArguments),
    /// Export and import the stored data of a board: its flash as TOML, and TOML into a flash.
    Kept(kept::KeptArguments),
    /// Change load or friction while a leg walks: detection time, identified cause, false alarms.
    Monitor(monitor::MonitorArguments),
    /// Measure the current loop on a motor's test stand: steps, torque ripple, voltage limit, regeneration.
    Motor(motor::MotorArguments),
    /// Inject the fault catalogue into the whole firmware during an identification: detection,
    /// time, and reaction.
    Faults(faults::FaultsArguments),
    /// Reproduce the paper's tables and figures and compare them with its printed results.
    Paper(paper::PaperArguments),
    /// Print torques and regressor of given states: rigid bodies only, CSV.
    Regressor(regressor::RegressorArguments),
    /// Run the whole firmware on an emulated microcontroller (`cargo emulate`).
    Emulate(emulate::EmulateArguments),
    /// Build the flash image of a leg and print its size (`cargo fw`).
    Fw(image::FirmwareArguments),
    /// Build the flash image, write it onto a board and print its records (`cargo flash-leg`).
    FlashLeg(image::FlashArguments),
}

/// Arguments of a run without any.
const MAIN_JOB: [&str; 5] = ["identify", "--figures", "target/sim", "--report", "target/sim/report.html"];

/// Runs the tool on the process's arguments.
#[must_use]
pub fn main() -> ExitCode {
    let mut words: Vec<_> = std::env::args_os().collect();
    match words.get(1).and_then(|word| word.to_str()) {
        // Without a subcommand, run the main job.
        None => words.extend(MAIN_JOB.map(Into::into)),
        Some(option) if option.starts_with("--") && !["--help", "--version"].contains(&option) => {
            words.insert(1, "identify".into());
        }
        Some(_) => {}
    }
    let description = Cli::command();
    let matches = description.clone().get_matches_from(words);
    let command = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit()).command;
    let outcome = files::check(&description, &matches).and_then(|()| run(&command));
    match outcome {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            let kind = if error.exit_code() == EXIT_REFUSED { "refused" } else { "error" };
            eprintln!("{kind}: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Runs one command and returns its exit code.
fn run(command: &Command) -> Result<u8, ToolError> {
    match command {
        Command::Excite(arguments) => excite::run(arguments),
        Command::Faults(arguments) => faults::run(arguments),
        Command::Replay(arguments) => replay::run(arguments),
        Command::Trace(arguments) => trace::run(arguments),
        Command::Predict(arguments) => predict::run(arguments),
        Command::Export(arguments) => export::run(arguments),
        Command::Eds(arguments) => eds::run(arguments),
        Command::Serve(arguments) => serve::run(arguments),
        Command::Kept(arguments) => kept::run(arguments),
        Command::Monitor(arguments) => monitor::run(arguments),
        Command::Motor(arguments) => motor::run(arguments),
        Command::Paper(arguments) => paper::run(arguments),
        Command::Regressor(arguments) => regressor::run(arguments),
        Command::Emulate(arguments) => emulate::emulate(arguments),
        Command::Fw(arguments) => image::firmware(arguments),
        Command::FlashLeg(arguments) => image::flash_leg(arguments),
        Command::Identify(arguments) => identify::run(arguments),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::{Cli, files};

    /// Every path argument needs a type that states its use; otherwise the check would miss it.
    #[test]
    fn every_path_on_the_command_line_has_a_role() {
        let mut paths = 0;
        let mut commands = vec![Cli::command()];
        while let Some(command) = commands.pop() {
            for argument in command.get_arguments() {
                let kind = argument.get_value_parser().type_id();
                let has_role = files::check::has_role(argument);
                assert!(
                    kind != std::any::TypeId::of::<std::path::PathBuf>(),
                    "{} {}: a path without a role",
                    command.get_name(),
                    argument.get_id()
                );
                paths += usize::from(has_role);
            }
            commands.extend(command.get_subcommands().cloned());
        }
        assert!(paths > 40, "{paths} arguments with a role");
    }
}
