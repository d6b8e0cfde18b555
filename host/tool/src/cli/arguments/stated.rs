//! Arguments of a campaign as its user stated them: shards of one campaign have the same ones.
//!
//! All arguments of the command are taken, but those that name what is written and the shard itself. So a new
//! option cannot be forgotten. A file is known by its content: another machine may name it differently.

use std::any::TypeId;
use std::path::Path;

use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use scarab_identify::formats::shard::Argument;
use sha2::{Digest, Sha256};

use crate::cli::arguments::role::{Input, LegName, Output, OutputFolder, Updated};

/// Argument that selects the shard; only campaigns have it.
const SHARD: &str = "shard";

/// Stated arguments of a campaign, in the order of its help; none of a command that cannot be divided.
pub(crate) fn stated(command: &Command, matches: &ArgMatches) -> Vec<Argument> {
    let (mut command, mut matches) = (command, matches);
    while let Some((name, inner)) = matches.subcommand() {
        let Some(next) = command.find_subcommand(name) else { break };
        (command, matches) = (next, inner);
    }
    if !command.get_arguments().any(|argument| argument.get_id() == SHARD) {
        return Vec::new();
    }
    let arguments = command.get_arguments().filter(|argument| is_of_campaign(argument));
    arguments.filter_map(|argument| one(argument, matches)).collect()
}

fn is_of_campaign(argument: &Arg) -> bool {
    let kind = argument.get_value_parser().type_id();
    let written = [TypeId::of::<Output>(), TypeId::of::<OutputFolder>(), TypeId::of::<Updated>()];
    let is_written = written.iter().any(|role| kind == *role);
    !is_written && argument.get_id() != SHARD
}

fn one(argument: &Arg, matches: &ArgMatches) -> Option<Argument> {
    let id = argument.get_id().as_str();
    if matches.value_source(id) != Some(ValueSource::CommandLine) {
        return None;
    }
    let name = argument.get_long().map_or_else(|| id.to_owned(), |long| format!("--{long}"));
    let values: Vec<String> = match argument.get_action() {
        ArgAction::SetTrue => Vec::new(),
        _ => matches
            .get_raw(id)
            .into_iter()
            .flatten()
            .map(|word| word.to_string_lossy().into_owned())
            .collect(),
    };
    let input = matches.try_get_one::<Input>(id).ok().flatten().map(|file| &**file);
    let leg = matches.try_get_one::<LegName>(id).ok().flatten().and_then(LegName::file);
    Some(Argument { name, values, sha256: input.or(leg).and_then(digest) })
}

/// SHA-256 of a file; none of a missing one, which the command itself will report.
fn digest(path: &Path) -> Option<String> {
    let content = std::fs::read(path).ok()?;
    Some(Sha256::digest(content).iter().map(|byte| format!("{byte:02x}")).collect())
}
