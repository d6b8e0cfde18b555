//! The command line: one file for each command.

mod adapter;
pub mod arguments;
pub(crate) mod assist;
mod battery;
mod commission;
pub mod common;
mod compare;
mod eds;
mod excite;
mod export;
mod faults;
mod identify;
mod image;
mod import;
mod kept;
mod leg;
mod leg_options;
mod live;
pub mod merge;
mod model;
mod monitor;
mod motor;
mod node_ids;
mod noise;
mod predict;
mod regressor;
mod replay;
mod serve;
mod states;
mod trace;
mod update;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use scarab_base::error::{EXIT_REFUSED, ToolError};
use scarab_base::names::BY_CARGO;
use scarab_base::output;
use scarab_base::shell::program;
use scarab_identify::formats::shard::Argument;

/// Identifies legs, simulated or recorded. Exit codes: 0 accepted, 3 refused, 2 bad input.
#[derive(Parser, Debug)]
#[command(name = "scarab", version, max_term_width = HELP_WIDTH, after_help = "\
Options without a command belong to `identify`. `scarab COMMAND --help` has an example of each.
Your data: leg, replay, predict, compare, export, regressor. Simulation: identify, live, excite, monitor, assist, motor, serve.
Board: fw, flash-leg, commission, update, node-ids, trace, eds, kept. The project's own checks: faults. Shards of a campaign: merge.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Identify a simulated leg: drive it, log it, solve, validate, track.
    #[command(after_help = "Example: cargo sim identify --leg my-leg.toml --seed 3 --report run.html")]
    Identify(identify::IdentifyArguments),
    /// Show a leg in a browser while it moves: simulated, recorded, by its trace or on its bus.
    #[command(after_help = "Example: cargo sim live --speed 4")]
    Live(live::LiveArguments),
    /// Write a leg file, from a robot description (URDF) or from answers, or list what one lacks.
    #[command(
        after_help = "Example: cargo sim leg --urdf robot.urdf --joints hip_joint,knee_joint --out leg.toml"
    )]
    Leg(leg::LegArguments),
    /// Design an exciting motion and predict its result before anything moves.
    #[command(after_help = "Example: cargo sim excite --leg my-leg.toml --out motion.toml")]
    Excite(excite::ExciteArguments),
    /// Identify a leg from recordings.
    #[command(
        after_help = "Example: cargo sim replay run.csv --leg my-leg.toml --split 0.7 --report run.html"
    )]
    Replay(replay::ReplayArguments),
    /// Decode and report the trace of a board.
    #[command(after_help = "Example: cargo sim trace trace.txt --json run.json")]
    Trace(trace::TraceArguments),
    /// Predict the torque of given states from a stored model: CSV.
    #[command(after_help = "Example: cargo sim predict --model leg-model.toml --states states.csv")]
    Predict(predict::PredictArguments),
    /// Compare two stored models: is it the same leg, and which mass was added?
    #[command(after_help = "Example: cargo sim compare before.toml after.toml")]
    Compare(compare::CompareArguments),
    /// Write a stored model as a robot description.
    #[command(after_help = "Example: cargo sim export --model leg-model.toml --urdf leg.urdf")]
    Export(export::ExportArguments),
    /// Write the electronic data sheets of the bus' nodes, one per joint.
    #[command(after_help = "Example: cargo sim eds --out sheets")]
    Eds(eds::EdsArguments),
    /// Serve legs on a CANopen bus, reached by host software over TCP (slcan).
    #[command(after_help = "Example: cargo sim serve --slcan 127.0.0.1:0")]
    Serve(serve::ServeArguments),
    /// Commission a board over its bus, step by step: calibrate, reference, identify, store.
    #[command(after_help = "Example: cargo sim commission --slcan /dev/ttyACM0 --out commissioned")]
    Commission(commission::CommissionArguments),
    /// Bring a new image onto a board over its bus.
    #[command(after_help = "Example: cargo sim update --slcan /dev/ttyACM0 scarab-image.bin")]
    Update(update::UpdateArguments),
    /// List the boards of a bus, and give boards with equal node-IDs others.
    #[command(after_help = "Example: cargo sim node-ids --slcan /dev/ttyACM0 --set 0000004D=3,4")]
    NodeIds(node_ids::NodeIdsArguments),
    /// Export and import the stored data of a board: its flash as TOML, and TOML into a flash.
    #[command(after_help = "Example: cargo sim kept export flash.bin --out kept.toml")]
    Kept(kept::KeptArguments),
    /// Change load or friction while a leg walks: detection time, identified cause, false alarms.
    #[command(after_help = "Example: cargo sim monitor --seeds 1..20")]
    Monitor(monitor::MonitorArguments),
    /// Let a wearer move in a leg that is transparent, carries weight or assists: interaction torque, effort.
    #[command(after_help = "Example: cargo sim assist --mode transparent --motion gait --out target/assist")]
    Assist(assist::AssistArguments),
    /// Measure the current loop on a motor's test stand: steps, torque ripple, voltage limit, regeneration.
    #[command(after_help = "Example: cargo sim motor --figures target/motor")]
    Motor(motor::MotorArguments),
    /// Inject the fault catalogue into the whole firmware during an identification: detection,
    /// time, and reaction.
    #[command(after_help = "Example: cargo sim faults --fault X1 --seeds 2")]
    Faults(faults::FaultsArguments),
    /// Join the shards of `identify --seeds` or `faults` to the report of the whole campaign.
    #[command(after_help = "Example: cargo sim merge shard-1.json shard-2.json --json runs.json")]
    Merge(merge::MergeArguments),
    /// Print torques and regressor of given states: rigid bodies only, CSV.
    #[command(after_help = "Example: cargo sim regressor --leg my-leg.toml --states states.csv")]
    Regressor(regressor::RegressorArguments),
    /// Judge the verdict of `replay` on a table of cases.
    #[command(hide = true, after_help = "Example: cargo sim battery --kind random --count 20")]
    Battery(battery::BatteryArguments),
    /// Build the flash image of a leg and print its size (`cargo fw`).
    #[command(after_help = "Example: cargo fw --leg my-leg.toml")]
    Fw(image::FirmwareArguments),
    /// Build the flash image, write it onto a board and print its records (`cargo flash-leg`).
    #[command(after_help = "Example: cargo flash-leg --leg my-leg.toml -- --probe 0483:3748")]
    FlashLeg(image::FlashArguments),
}

/// Columns of a help text.
const HELP_WIDTH: usize = 100;
/// Arguments of `cargo sim` without any.
const MAIN_JOB: [&str; 5] = ["identify", "--figures", "target/sim", "--report", "target/sim/report.html"];
/// Commands to try after the main job.
const NEXT: &str = "
next:
  cargo sim live                             the same run in a browser, while the leg moves
  cargo sim identify --perturb length=1.1    a leg file with a wrong length is refused
  cargo sim replay --help                    a leg of your own, from a recording
";

/// Runs the tool on the process's arguments.
pub fn main() -> ExitCode {
    let mut words: Vec<_> = std::env::args_os().collect();
    let is_by_cargo = words.get(1).is_some_and(|word| word == BY_CARGO);
    if is_by_cargo {
        words.remove(1);
    }
    match words.get(1).and_then(|word| word.to_str()) {
        None if is_by_cargo => {
            words.extend(MAIN_JOB.map(Into::into));
            return perform(words, |cli: &Cli, stated| {
                let code = run(&cli.command, stated)?;
                output::print(NEXT)?;
                Ok(code)
            });
        }
        None => words.push("--help".into()),
        Some(option) if option.starts_with("--") && !["--help", "--version"].contains(&option) => {
            words.insert(1, "identify".into());
        }
        Some(_) => {}
    }
    perform(words, |cli: &Cli, stated| run(&cli.command, stated))
}

/// Parses these words, checks their files, and runs the command. Prints an error; returns the exit code. The
/// command receives the stated arguments of a campaign (`arguments::stated()`).
pub fn perform<C: CommandFactory + FromArgMatches>(
    words: Vec<OsString>,
    run: impl FnOnce(&C, Vec<Argument>) -> Result<u8, ToolError>,
) -> ExitCode {
    let description = called(C::command(), &program());
    let matches = description.clone().get_matches_from(words);
    let command = C::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let checked = arguments::check(&description, &matches);
    match checked.and_then(|()| run(&command, arguments::stated(&description, &matches))) {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            let kind = if error.exit_code() == EXIT_REFUSED { "refused" } else { "error" };
            eprintln!("{kind}: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Command whose examples call `program` instead of the alias.
fn called(command: clap::Command, program: &str) -> clap::Command {
    let names: Vec<String> = command.get_subcommands().map(|command| command.get_name().to_owned()).collect();
    names.iter().fold(command, |command, name| {
        command.mut_subcommand(name, |command| match command.get_after_help().map(ToString::to_string) {
            Some(text) => command.after_help(text.replace("cargo sim ", &format!("{program} "))),
            None => command,
        })
    })
}

/// Runs one command and returns its exit code.
fn run(command: &Command, stated: Vec<Argument>) -> Result<u8, ToolError> {
    match command {
        Command::Live(arguments) => live::run(arguments),
        Command::Leg(arguments) => leg::run(arguments),
        Command::Excite(arguments) => excite::run(arguments),
        Command::Faults(arguments) => faults::run(arguments, stated),
        Command::Merge(arguments) => merge::run(arguments),
        Command::Replay(arguments) => replay::run(arguments),
        Command::Trace(arguments) => trace::run(arguments),
        Command::Predict(arguments) => predict::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Export(arguments) => export::run(arguments),
        Command::Eds(arguments) => eds::run(arguments),
        Command::Serve(arguments) => serve::run(arguments),
        Command::Commission(arguments) => commission::run(arguments),
        Command::Update(arguments) => update::run(arguments),
        Command::NodeIds(arguments) => node_ids::run(arguments),
        Command::Kept(arguments) => kept::run(arguments),
        Command::Monitor(arguments) => monitor::run(arguments),
        Command::Assist(arguments) => assist::run(arguments),
        Command::Motor(arguments) => motor::run(arguments),
        Command::Regressor(arguments) => regressor::run(arguments),
        Command::Battery(arguments) => battery::run_battery(arguments),
        Command::Fw(arguments) => image::firmware(arguments),
        Command::FlashLeg(arguments) => image::flash_leg(arguments),
        Command::Identify(arguments) => identify::run(arguments, stated),
    }
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::{BY_CARGO, Cli, arguments, called};

    fn help(mut command: clap::Command) -> String {
        command.render_long_help().to_string()
    }

    #[test]
    fn every_help_has_a_valid_example_and_lines_within_100_columns() {
        let cli = Cli::command();
        for command in cli.get_subcommands() {
            let text = help(command.clone().max_term_width(super::HELP_WIDTH));
            let wide = text.lines().find(|line| line.chars().count() > super::HELP_WIDTH);
            assert_eq!(wide, None, "{}", command.get_name());
            let (_, example) = text.split_once("Example: cargo ").expect("an example");
            let words = example.split_whitespace();
            // `cargo sim` is `scarab`; the other aliases name their command.
            let words = words.skip_while(|&word| word == "sim");
            let parsed = Cli::try_parse_from(std::iter::once("scarab").chain(words));
            assert!(
                parsed.is_ok(),
                "{}: {}",
                command.get_name(),
                parsed.err().map_or(String::new(), |error| error.to_string())
            );
        }
        let wide = help(cli).lines().find(|line| line.chars().count() > super::HELP_WIDTH).map(str::to_owned);
        assert_eq!(wide, None);
    }

    #[test]
    fn examples_call_the_program_by_its_name() {
        let cli = called(Cli::command(), "scarab");
        let replay = cli.find_subcommand("replay").expect("a command").clone();
        assert!(help(replay).contains("Example: scarab replay run.csv"));
        let flash = cli.find_subcommand("flash-leg").expect("a command").clone();
        assert!(help(flash).contains("Example: cargo flash-leg --leg"));
    }

    #[test]
    fn the_alias_cargo_sim_starts_the_main_job() {
        let config: toml::Table =
            include_str!("../../../.cargo/config.toml").parse().expect("a configuration");
        let alias = config["alias"]["sim"].as_str().expect("an alias");
        assert!(alias.ends_with(&format!("-- {BY_CARGO}")), "{alias}");
    }

    /// Every path argument needs a type that states its use; otherwise the check would miss it.
    #[test]
    fn every_path_on_the_command_line_has_a_role() {
        let mut paths = 0;
        let mut commands = vec![Cli::command()];
        while let Some(command) = commands.pop() {
            for argument in command.get_arguments() {
                let kind = argument.get_value_parser().type_id();
                let has_role = arguments::check::has_role(argument);
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
