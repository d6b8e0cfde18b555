//! Shard files: results of a part of a campaign's runs, joined by `merge` to the report of the whole.
//!
//! | key | content |
//! | --- | --- |
//! | `schema` | 1 |
//! | `shard` | `index` from 1, `count` |
//! | `campaign` | [`CampaignHeader`]: equal in all shards of one campaign |
//! | others | results of the runs, as each command defines them |
//!
//! Why the results of single runs and not sums over them: medians and percentiles are of all runs, and a sum
//! in another order is another number. The report of the whole is made by the code that makes that of an
//! undivided campaign, which is its own only shard.

use std::path::{Path, PathBuf};

use scarab_base::error::{EXIT_ACCEPTED, FileError, ToolError};
use scarab_base::shard::Shard;
use scarab_base::{files, output};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::formats::leg_file::LegFile;
use crate::report::SCHEMA;

/// An argument of a campaign's command line.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Argument {
    /// Name on the command line, `--seeds`.
    pub name: String,
    /// Values; none for a switch.
    pub values: Vec<String>,
    /// Digest of a file that is read, SHA-256; shards may name it differently.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
}

impl Argument {
    fn is_same(&self, other: &Self) -> bool {
        let content = self.sha256.as_ref().zip(other.sha256.as_ref());
        content.map_or_else(|| self.values == other.values, |(own, others)| own == others)
    }

    /// Values, and the content of a file.
    fn words(&self) -> String {
        let values = self.values.join(" ");
        match &self.sha256 {
            Some(digest) => format!("`{values}` (SHA-256 {})", digest.get(..SHOWN).unwrap_or(digest)),
            None if values.is_empty() => "given".into(),
            None => format!("`{values}`"),
        }
    }
}

/// Digits of a digest in a message.
const SHOWN: usize = 12;

fn refused(path: &Path, reason: impl std::fmt::Display) -> ToolError {
    FileError::new(path.display(), reason).into()
}

/// Program that computes a campaign.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Version of the program.
    pub(crate) version: String,
    /// Fingerprint of its sources (`host/build.rs`).
    pub(crate) sources: String,
    /// Processor and operating system; their mathematics may differ in the last digit.
    pub(crate) platform: String,
}

impl Program {
    /// This program, built from sources with this fingerprint.
    pub fn from_sources(sources: &str) -> Self {
        let platform = format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS);
        Self { version: env!("CARGO_PKG_VERSION").into(), sources: sources.into(), platform }
    }

    fn words(&self) -> String {
        format!("version {}, sources {}, {}", self.version, self.sources, self.platform)
    }
}

/// What all shards of a campaign have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CampaignHeader {
    /// `identify`, `faults` or `paper`.
    pub command: String,
    /// Arguments, in the order of the command's help; not the shard, and no file that is written.
    pub arguments: Vec<Argument>,
    /// Leg with its options.
    pub leg: Option<LegFile>,
    /// Program that computes it.
    pub program: Program,
}

impl CampaignHeader {
    /// Command line without shard and output files.
    pub fn command_line(&self) -> Vec<String> {
        let mut words = vec![self.command.clone()];
        for Argument { name, values, .. } in &self.arguments {
            if values.is_empty() {
                words.push(name.clone());
            }
            for value in values {
                if value.starts_with('-') {
                    words.push(format!("{name}={value}"));
                } else {
                    words.extend([name.clone(), value.clone()]);
                }
            }
        }
        words
    }

    /// Difference from another campaign in words, as seen from this one, and what to do about it.
    fn difference(&self, path: &Path, other: &Self, other_path: &Path) -> Option<String> {
        let (own, others) = (path.display(), other_path.display());
        if self.command != other.command {
            return Some(format!(
                "{own}: a shard of `{}`, {others} is one of `{}`: join them separately",
                self.command, other.command
            ));
        }
        if self.program != other.program {
            return Some(format!(
                "{own}: computed by {}; {others} by {}: compute all shards with one commit and kind of machine",
                self.program.words(),
                other.program.words()
            ));
        }
        let find = |campaign: &Self, name: &str| {
            campaign.arguments.iter().find(|argument| argument.name == name).cloned()
        };
        let mut names = self.arguments.iter().chain(&other.arguments).map(|argument| argument.name.as_str());
        names.find_map(|name| {
            let (ours, theirs) = (find(self, name), find(other, name));
            if ours.as_ref().zip(theirs.as_ref()).is_some_and(|(ours, theirs)| ours.is_same(theirs)) {
                return None;
            }
            let words = |argument: &Option<Argument>| {
                argument.as_ref().map_or_else(|| "not given".to_owned(), Argument::words)
            };
            Some(format!(
                "{own}: {name} is {}, in {others} {}: shards of one campaign differ in --shard only; compute one of them again",
                words(&ours),
                words(&theirs)
            ))
        })
    }
}

/// Results of a shard, and the file they come from.
#[derive(Clone, Debug)]
pub struct ShardResults<R> {
    /// File in messages; empty for results that this process computed.
    pub(crate) path: PathBuf,
    /// The shard.
    pub shard: Shard,
    /// Its results.
    pub results: R,
}

impl<R> ShardResults<R> {
    /// Results that this process computed.
    pub fn new(shard: Shard, results: R) -> Self {
        Self { path: PathBuf::new(), shard, results }
    }

    /// Error of results that are not those of the shard's runs.
    pub fn damaged(&self, what: &str) -> ToolError {
        let shard = self.shard;
        let why = format!("{what}, which are not the results of shard {shard}");
        refused(&self.path, format!("{why}: the file was changed; compute it again"))
    }

    /// Rejects results with another number of runs than the shard's of `runs`.
    ///
    /// # Errors
    /// The numbers differ.
    pub fn check_count(&self, what: &str, found: usize, runs: usize) -> Result<(), ToolError> {
        let due = self.shard.range(runs).len();
        if found == due { Ok(()) } else { Err(self.damaged(&format!("{what}: {found} runs, {due} are due"))) }
    }
}

impl<R: Serialize> ShardResults<R> {
    /// Writes the shard's file, and prints what it holds. Exit code: done; the verdict is that of all shards.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path, campaign: &CampaignHeader, what: &str) -> Result<u8, ToolError> {
        let file = Written { schema: SCHEMA, shard: self.shard, campaign, results: &self.results };
        let mut text = serde_json::to_string(&file).map_err(|error| ToolError::cannot_write(path, &error))?;
        text.push('\n');
        files::write(path, text)?;
        output::print(&format!("shard {}: {what} in {}\n", self.shard, path.display()))?;
        Ok(EXIT_ACCEPTED)
    }
}

/// Beginning of a shard file.
#[derive(Clone, Debug, Deserialize)]
struct Header {
    schema: u32,
    shard: Shard,
    campaign: CampaignHeader,
}

#[derive(Serialize)]
struct Written<'a, R> {
    schema: u32,
    shard: Shard,
    campaign: &'a CampaignHeader,
    #[serde(flatten)]
    results: &'a R,
}

/// All shards of one campaign, in their order.
#[derive(Debug)]
pub struct ShardFiles {
    campaign: CampaignHeader,
    /// Path, shard and text of each file.
    files: Vec<(PathBuf, Shard, String)>,
}

impl ShardFiles {
    /// Reads the files; `own` is the program that is to join them, and can those of `commands`.
    ///
    /// # Errors
    /// A file is no shard, two differ in more than their number, one is missing or given twice, or another
    /// program computed them.
    pub fn read(paths: &[&Path], own: &Program, commands: &[&str]) -> Result<Self, ToolError> {
        let mut found = Vec::with_capacity(paths.len());
        for &path in paths {
            let text = files::read_text(path)?;
            let header = header(path, &text)?;
            let command = header.campaign.command.as_str();
            if !commands.contains(&command) {
                let program = if command == "paper" { "cargo paper" } else { "cargo sim" };
                let words = format!("is a shard of `{command}`: join it with `{program} merge`");
                return Err(refused(path, words));
            }
            found.push((path.to_owned(), header, text));
        }
        found.sort_by_key(|(_, header, _)| header.shard.index());
        let first = found.first().map(|(path, header, _)| (path.clone(), header.clone()));
        let Some((first, Header { campaign, shard, .. })) = first else {
            return Err(ToolError::input("no shard is given: name the files of all shards"));
        };
        for (path, header, _) in &found {
            if let Some(difference) = header.campaign.difference(path, &campaign, &first) {
                return Err(ToolError::input(difference));
            }
            if header.shard.count() != shard.count() {
                return Err(ToolError::input(format!(
                    "{}: is shard {}, {} is shard {shard}: join shards of one division",
                    path.display(),
                    header.shard,
                    first.display()
                )));
            }
        }
        complete(shard.count(), &found)?;
        if campaign.program.sources != own.sources {
            return Err(ToolError::input(format!(
                "{}: computed by {}; this program has the sources {}: join the shards with the commit that computed them",
                first.display(),
                campaign.program.words(),
                own.sources
            )));
        }
        let files = found.into_iter().map(|(path, header, text)| (path, header.shard, text)).collect();
        Ok(Self { campaign, files })
    }

    /// What the shards have in common.
    pub fn campaign(&self) -> &CampaignHeader {
        &self.campaign
    }

    /// Results of every shard, in their order.
    ///
    /// # Errors
    /// A file lacks results of this kind.
    pub fn parts<R: DeserializeOwned>(&self) -> Result<Vec<ShardResults<R>>, ToolError> {
        let part = |(path, shard, text): &(PathBuf, Shard, String)| {
            let results = serde_json::from_str(text).map_err(|error| {
                let words = format!("its results cannot be read: {error}: the file was changed");
                refused(path, words + "; compute the shard again")
            })?;
            Ok(ShardResults { path: path.clone(), shard: *shard, results })
        };
        self.files.iter().map(part).collect()
    }
}

/// Reads the beginning of a file.
fn header(path: &Path, text: &str) -> Result<Header, ToolError> {
    let header: Header = serde_json::from_str(text).map_err(|error| {
        refused(path, format!("is no shard of a campaign: {error}; `--shard I/N --json FILE` writes one"))
    })?;
    if header.schema != SCHEMA {
        let words = format!("schema {}, this program reads {SCHEMA}: join the shards", header.schema);
        return Err(refused(path, words + " with the commit that computed them"));
    }
    Ok(header)
}

/// Rejects files in which a shard is missing or given twice; they are in the order of their shards.
fn complete(count: u64, found: &[(PathBuf, Header, String)]) -> Result<(), ToolError> {
    for two in found.windows(2) {
        if let [(one, header, _), (other, same, _)] = two
            && header.shard == same.shard
        {
            return Err(ToolError::input(format!(
                "{}, {}: both are shard {}: name each shard once",
                one.display(),
                other.display(),
                header.shard
            )));
        }
    }
    let is_there = |index: &u64| found.iter().any(|(_, header, _)| header.shard.index() == *index);
    let missing: Vec<String> =
        (1..=count).filter(|index| !is_there(index)).map(|index| index.to_string()).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let shown = missing.iter().take(MISSING_SHOWN).cloned().collect::<Vec<_>>().join(", ");
    let more = if missing.len() > MISSING_SHOWN { ", .." } else { "" };
    Err(ToolError::input(format!(
        "{} of {count} shards given, missing: {shown}{more}: name their files, or compute them with --shard {}/{count}",
        found.len(),
        missing.first().map_or("I", String::as_str)
    )))
}

/// Limit of the missing shards in a message.
const MISSING_SHOWN: usize = 20;

#[cfg(test)]
mod tests {
    use super::*;

    fn campaign(arguments: &[(&str, &str, Option<&str>)]) -> CampaignHeader {
        let argument = |(name, value, digest): &(&str, &str, Option<&str>)| Argument {
            name: (*name).into(),
            values: value.split_whitespace().map(str::to_owned).collect(),
            sha256: digest.map(str::to_owned),
        };
        CampaignHeader {
            command: "identify".into(),
            arguments: arguments.iter().map(argument).collect(),
            leg: None,
            program: Program::from_sources("1"),
        }
    }

    #[test]
    fn a_file_is_known_by_its_content_and_any_other_argument_by_its_words() {
        let own = campaign(&[("--leg", "a.toml", Some("12")), ("--seeds", "1..4", None)]);
        let difference = |other: &[(&str, &str, Option<&str>)]| {
            own.difference(Path::new("own"), &campaign(other), Path::new("other"))
        };
        assert_eq!(difference(&[("--leg", "elsewhere/a.toml", Some("12")), ("--seeds", "1..4", None)]), None);
        for (other, words) in [
            (
                vec![("--leg", "a.toml", Some("13")), ("--seeds", "1..4", None)],
                "--leg is `a.toml` (SHA-256 12), in other `a.toml` (SHA-256 13)",
            ),
            (
                vec![("--leg", "a.toml", Some("12")), ("--seeds", "1..5", None)],
                "--seeds is `1..4`, in other `1..5`",
            ),
            (vec![("--leg", "a.toml", Some("12"))], "--seeds is `1..4`, in other not given"),
            (
                vec![("--leg", "a.toml", Some("12")), ("--seeds", "1..4", None), ("--full", "", None)],
                "--full is not given, in other given",
            ),
        ] {
            let found = difference(&other).expect("they differ");
            assert!(found.contains(words), "{found}");
        }
    }

    #[test]
    fn a_command_line_can_be_parsed_again_whatever_its_values_begin_with() {
        let campaign =
            campaign(&[("--full", "", None), ("--fault", "C2 X1", None), ("--trunk-pitch", "-5", None)]);
        let line = campaign.command_line().join(" ");
        assert_eq!(line, "identify --full --fault C2 --fault X1 --trunk-pitch=-5");
    }
}
