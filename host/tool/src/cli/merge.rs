//! `merge`: joins the shards of a campaign to the report of the whole.
//!
//! The command line that the shards state is parsed again, with the outputs of this one. Then the code that
//! reports an undivided campaign continues with their results: tables, JSON, page and exit code are equal.

use std::ffi::OsString;
use std::path::Path;

use clap::{Args, Parser};
use scarab_base::error::ToolError;
use scarab_identify::formats::shard::{CampaignHeader, ShardFiles};

use crate::cli::arguments::{Input, Output, OutputFolder, Updated};
use crate::cli::common::program;
use crate::cli::{Cli, Command, faults, identify};

/// Shards, and outputs of the whole.
#[derive(Args, Debug)]
pub(crate) struct MergeArguments {
    /// JSON of all shards, in any order.
    #[arg(required = true, value_name = "FILES")]
    files: Vec<Input>,
    /// Write the report here, for exit codes 0 and 3.
    #[arg(long)]
    json: Option<Output>,
    /// Draw the runs of `identify` into this directory, as SVG.
    #[arg(long)]
    figures: Option<OutputFolder>,
    /// Write the campaign as one HTML page here.
    #[arg(long)]
    report: Option<Output>,
    /// Put the table of `faults` into this document, between its markers.
    #[arg(long)]
    docs: Option<Updated>,
}

impl MergeArguments {
    /// The campaign's command with the outputs of this one.
    fn command(&self, campaign: &CampaignHeader) -> Result<Command, ToolError> {
        let outputs = [
            ("--json", self.json.as_deref()),
            ("--figures", self.figures.as_deref()),
            ("--report", self.report.as_deref()),
            ("--docs", self.docs.as_deref()),
        ];
        let words = ["scarab".to_owned()].into_iter().chain(campaign.command_line());
        Ok(parsed::<Cli>(campaign, words, &outputs)?.command)
    }
}

/// Parses the words of a campaign's command line, the program's name first, with these outputs.
///
/// # Errors
/// The command has no such output.
pub fn parsed<C: Parser>(
    campaign: &CampaignHeader,
    words: impl IntoIterator<Item = String>,
    outputs: &[(&str, Option<&Path>)],
) -> Result<C, ToolError> {
    let mut words: Vec<OsString> = words.into_iter().map(OsString::from).collect();
    for (name, path) in outputs {
        if let Some(path) = path {
            let mut word = OsString::from(name);
            word.push("=");
            word.push(path);
            words.push(word);
        }
    }
    C::try_parse_from(words).map_err(|error| {
        let reason = error.to_string();
        let reason = reason.lines().next().unwrap_or_default().trim_start_matches("error: ");
        ToolError::input(format!("merge: shards of `{}`: {reason}", campaign.command))
    })
}

/// Joins and reports; returns the exit code of the whole campaign.
pub(crate) fn run(arguments: &MergeArguments) -> Result<u8, ToolError> {
    let files: Vec<&Path> = arguments.files.iter().map(|file| &**file).collect();
    let shards = ShardFiles::read(&files, &program(), &["identify", "faults"])?;
    let campaign = shards.campaign();
    match &arguments.command(campaign)? {
        Command::Identify(of) => identify::conclude(of, campaign, shards.parts()?),
        Command::Faults(of) => faults::conclude(of, campaign, shards.parts()?),
        _ => Err(ToolError::input(format!("merge: `{}` is not divided into shards", campaign.command))),
    }
}
