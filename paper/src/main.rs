//! `cargo paper`: reproduces the paper's tables and figures and compares them with its printed results.

use std::process::ExitCode;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Parser, Subcommand};
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::output;
use scarab_base::shard::Shard;
use scarab_identify::formats::shard::{Argument, CampaignHeader, Program, ShardFiles, ShardResults};
use scarab_paper::contenders::Algorithm;
use scarab_paper::runs::PaperRuns;
use scarab_paper::{PaperOptions, Part};
use scarab_tool::cli::arguments::{Choice, Input, Output, OutputFolder, Updated, one_of};
use scarab_tool::cli::common::write_json;
use scarab_tool::cli::merge::parsed;
use scarab_tool::cli::perform;
use scarab_tool::view::{document, figures};

/// Limit of the runs.
const MOST_SEEDS: u64 = 100_000;

/// Tables of the paper, and two that it does not have.
const TABLES: &[Choice<Part>] = &[
    ("III", Part::TableThree, "The test functions and their least values"),
    ("IV", Part::TableFour, "The searches on the test functions"),
    ("V", Part::TablesFiveSix, "The chain's parameters one by one; always printed with VI"),
    (
        "VI",
        Part::TablesFiveSix,
        "The combinations of the chain's parameters that torque determines; always printed with V",
    ),
    (
        "load-change",
        Part::LoadChange,
        "The chain identified before and after its load changes; no table of the paper, but its argument",
    ),
    (
        "convergence",
        Part::Convergence,
        "Iterations of the default swarm on identification problems; no table of the paper",
    ),
];

/// Figures of the paper.
const FIGURES: &[Choice<Part>] = &[
    ("5", Part::FigureFive, "Paths of the swarms on f1 to f4"),
    ("7", Part::FigureSeven, "Torque of the chain, predicted and real"),
];

/// Reproduce the paper's tables and figures, and compare them with its printed results.
#[derive(Parser, Debug)]
#[command(name = "scarab-paper", version, args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// Table to compute; may be repeated. Default: all tables and figures.
    #[arg(long, value_parser = one_of(TABLES), ignore_case = true)]
    table: Vec<Part>,
    /// Figure to draw; may be repeated.
    #[arg(long, value_parser = one_of(FIGURES))]
    figure: Vec<Part>,
    /// Runs of each row, each with its own seed.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    seeds: Option<u64>,
    /// Search of Table IV; may be repeated. Default: all.
    #[arg(long, value_parser = algorithms())]
    algorithm: Vec<Algorithm>,
    /// Only the runs of shard I of N, from 1, into --json; `merge` joins all of them.
    #[arg(long, value_name = "I/N", requires = "json", conflicts_with_all = ["out", "docs"])]
    shard: Option<Shard>,
    #[command(flatten)]
    outputs: Outputs,
}

/// Outputs of a campaign.
#[derive(Args, Debug)]
struct Outputs {
    /// Draw into this directory, as SVG files.
    #[arg(long)]
    out: Option<OutputFolder>,
    /// Write the rows as JSON here.
    #[arg(long)]
    json: Option<Output>,
    /// Write the tables into this document, each between its markers.
    #[arg(long)]
    docs: Option<Updated>,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Join shards to the tables and figures of the whole.
    #[command(after_help = "Example: cargo paper merge shard-1.json shard-2.json --json paper.json")]
    Merge(MergeArguments),
}

/// Shards, and outputs of the whole.
#[derive(Args, Debug)]
struct MergeArguments {
    /// JSON of all shards, in any order.
    #[arg(required = true, value_name = "FILES")]
    files: Vec<Input>,
    #[command(flatten)]
    outputs: Outputs,
}

/// Searches by their names in the report.
fn algorithms() -> impl TypedValueParser<Value = Algorithm> {
    PossibleValuesParser::new(Algorithm::ALL.map(Algorithm::id)).try_map(|id| {
        Algorithm::ALL.into_iter().find(|algorithm| algorithm.id() == id).ok_or("is not a search of Table IV")
    })
}

impl Arguments {
    fn options(&self) -> PaperOptions {
        PaperOptions {
            seeds: self.seeds,
            algorithms: self.algorithm.clone(),
            shard: self.shard.unwrap_or(Shard::WHOLE),
        }
    }

    fn parts(&self) -> Vec<Part> {
        if self.table.is_empty() && self.figure.is_empty() {
            return Part::ALL.to_vec();
        }
        let mut parts: Vec<Part> = Vec::new();
        for part in self.table.iter().chain(&self.figure) {
            if !parts.contains(part) {
                parts.push(*part);
            }
        }
        parts
    }
}

fn main() -> ExitCode {
    perform(std::env::args_os().collect(), |arguments: &Arguments, stated| match &arguments.command {
        Some(Command::Merge(merged)) => merge(merged),
        None => run(arguments, stated),
    })
}

/// Name of the campaign in its shards.
const CAMPAIGN: &str = "paper";

fn program() -> Program {
    Program::from_sources(env!("SCARAB_SOURCES"))
}

/// Joins shards and reports them like an undivided campaign.
fn merge(merged: &MergeArguments) -> Result<u8, ToolError> {
    let files: Vec<_> = merged.files.iter().map(|file| &**file).collect();
    let shards = ShardFiles::read(&files, &program(), &[CAMPAIGN])?;
    let outputs = [
        ("--out", merged.outputs.out.as_deref()),
        ("--json", merged.outputs.json.as_deref()),
        ("--docs", merged.outputs.docs.as_deref()),
    ];
    let arguments: Arguments = parsed(shards.campaign(), shards.campaign().command_line(), &outputs)?;
    check(&arguments)?;
    conclude(&arguments, shards.parts()?)
}

/// Computes, and reports what is not a shard; returns the exit code.
fn run(arguments: &Arguments, stated: Vec<Argument>) -> Result<u8, ToolError> {
    check(arguments)?;
    let options = arguments.options();
    let results = ShardResults::new(options.shard, scarab_paper::runs(&arguments.parts(), &options)?);
    if let (Some(_), Some(path)) = (arguments.shard, &arguments.outputs.json) {
        let campaign =
            CampaignHeader { command: CAMPAIGN.into(), arguments: stated, leg: None, program: program() };
        return results.write(path, &campaign, &format!("{} runs", results.results.count()));
    }
    conclude(arguments, vec![results])
}

/// Rejects arguments that do not fit each other, and documents without places for the tables.
fn check(arguments: &Arguments) -> Result<(), ToolError> {
    let parts = arguments.parts();
    if arguments.shard.is_some() && !parts.iter().any(|part| part.is_divided()) {
        return Err(ToolError::input(
            "--shard: table III and figure 5 take seconds and are not divided; leave --shard out",
        ));
    }
    if !arguments.algorithm.is_empty() && !parts.contains(&Part::TableFour) {
        return Err(ToolError::input("--algorithm: applies to --table IV only"));
    }
    if let Some(path) = &arguments.outputs.docs {
        parts.iter().try_for_each(|part| document::check(path, "paper", part.section_name()))?;
    }
    Ok(())
}

/// Reports the runs of all shards; returns the exit code.
fn conclude(arguments: &Arguments, shards: Vec<ShardResults<PaperRuns>>) -> Result<u8, ToolError> {
    let sections = scarab_paper::sections(&arguments.parts(), &arguments.options(), shards)?;
    // Outputs are checked first, because runs take minutes.
    for section in &sections {
        output::print(&format!("{}\n", section.markdown))?;
    }
    if let Some(path) = &arguments.outputs.json {
        write_json(path, &scarab_paper::report(&sections))?;
    }
    if let Some(directory) = &arguments.outputs.out {
        let drawn: Vec<_> = sections.iter().flat_map(|section| section.figures.iter().cloned()).collect();
        figures::write(directory, &drawn)?;
        output::print(&format!("figures: {}\n", directory.display()))?;
    }
    if let Some(path) = &arguments.outputs.docs {
        for section in &sections {
            document::replace(path, "paper", section.name, &section.markdown)?;
        }
        output::print(&format!("document: {}\n", path.display()))?;
    }
    Ok(EXIT_ACCEPTED)
}
