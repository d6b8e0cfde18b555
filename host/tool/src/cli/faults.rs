//! `faults`: injects the fault catalogue into the whole firmware and reports its reactions.

use std::time::Instant;

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, EXIT_REFUSED, ToolError};
use scarab_base::shard::Shard;
use scarab_base::{files, output};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::assist::AssistFile;
use scarab_identify::formats::shard::{Argument, CampaignHeader, ShardResults};
use scarab_rig::assist::study::Mode;
use scarab_rig::faults::campaign::{CampaignOptions, campaign};
use scarab_rig::faults::catalogue::ON_THE_CHIP;
use scarab_rig::faults::entry::{Entry, entries};
use scarab_rig::faults::hours::hours;
use scarab_rig::faults::report::{CampaignReport, line};
use scarab_rig::faults::results::Campaign;
use scarab_rig::faults::run::{Blind, Manner, Outcome};
use scarab_rig::faults::trial::KINDS;

use crate::cli::arguments::{Output, Updated};

use crate::cli::common::{program, write_json};
use crate::cli::leg_options::LegOptions;
use crate::view::html::Circumstances;
use crate::view::sections::{self, Head, Section};
use crate::view::{document, figures};

/// Kind and name of the table's markers in a document.
const DOCUMENT: [&str; 2] = ["faults", "table"];
/// Limit of the runs of one fault.
const MOST_SEEDS: u64 = 1_000_000;

/// Faults and the number of their runs.
#[derive(Args, Debug)]
pub(crate) struct FaultsArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// Row of the catalogue by its id, or `sweep` or `pairs`, which then run as often as a row; may
    /// be repeated. All rows unless given.
    #[arg(long, value_name = "ID")]
    fault: Vec<String>,
    /// Runs of each fault.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    seeds: Option<u64>,
    /// The emergency stop also at every servo tick of a whole identification, and at every current
    /// tick of one second of it.
    #[arg(long)]
    every_tick: bool,
    /// Runs of the sweep: each channel of a sensor faulted in each way; no invariant may be violated.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(0..=MOST_SEEDS))]
    sweep: Option<u64>,
    /// Runs of two random faults within 50 ms; no invariant may be violated.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(0..=MOST_SEEDS))]
    pairs: Option<u64>,
    /// Simulated hours of normal motion with noise, a pushing wearer, or a host that shakes the leg; no
    /// fault may be raised.
    #[arg(long, value_name = "H", default_value_t = 0.0)]
    hours: f64,
    /// The full campaign: 1,000 runs of each fault, every tick, a sweep of 8,000, 10,000 pairs, 10 hours;
    /// options given as well override these.
    #[arg(long, conflicts_with_all = ["blind", "replay"])]
    full: bool,
    /// Switch the detectors of each fault off. The campaign must then fail for each fault; exit
    /// code 0 if it does.
    #[arg(long, conflicts_with = "every_tick")]
    blind: bool,
    /// Repeat only the run with this seed of each fault and report it in full; with `--fault sweep` or
    /// `--fault pairs`, a run of those. The run repeats bit for bit for equal --seconds, leg and program.
    #[arg(long, value_name = "SEED", conflicts_with_all = ["seeds", "every_tick", "sweep", "pairs"], value_parser = clap::value_parser!(u64).range(1..=MOST_SEEDS))]
    replay: Option<u64>,
    /// Inject while the leg assists a walking wearer, instead of while it identifies itself. Only rows that
    /// fork a machine, the sweep and the pairs are run.
    #[arg(long, value_enum, value_name = "MODE")]
    assist: Option<Mode>,
    /// Inject only in the first S seconds of each identification or session.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Only the runs of shard I of N, from 1, into --json; `merge` joins all of them.
    #[arg(long, value_name = "I/N", requires = "json", conflicts_with_all = ["report", "docs", "replay"])]
    shard: Option<Shard>,
    /// Write the table here, for exit codes 0 and 3.
    #[arg(long)]
    json: Option<Output>,
    /// Write table, failures and the runs of --replay with their curves as one HTML page here.
    #[arg(long, value_name = "FILE.html")]
    report: Option<Output>,
    /// Put the table into this document, between its markers.
    #[arg(long, conflicts_with_all = ["blind", "replay"])]
    docs: Option<Updated>,
}

fn rows(names: &[String]) -> Result<Vec<Entry>, ToolError> {
    let all = entries();
    for name in names {
        if ON_THE_CHIP.iter().any(|fault| fault.id == name) {
            return Err(ToolError::input(format!(
                "--fault {name}: needs the processor; run `cargo chip faults --rows {name}`"
            )));
        }
        if !all.iter().any(|entry| entry.fault().id == name) && !KINDS.contains(&name.as_str()) {
            let mut known: Vec<_> = all.iter().map(|entry| entry.fault().id).collect();
            known.dedup();
            known.extend(KINDS);
            return Err(ToolError::input(format!("--fault {name}: is none of {}", known.join(", "))));
        }
    }
    let is_asked = |entry: &Entry| names.is_empty() || names.iter().any(|name| name == entry.fault().id);
    Ok(all.into_iter().filter(is_asked).collect())
}

fn page(whole: &CampaignHeader, report: &CampaignReport, found: &Campaign) -> Result<String, ToolError> {
    let leg = whole.leg.as_ref().ok_or_else(|| ToolError::input("a campaign without a leg"))?;
    let all = || found.outcomes.iter().chain(&found.trials);
    let recorded = || all().filter_map(|outcome: &Outcome| Some((outcome, outcome.recording.as_ref()?)));
    let lines: Vec<String> = recorded().map(|(outcome, _)| line(outcome)).collect();
    let figures = recorded()
        .map(|(outcome, recording)| {
            let what = format!("{}, seed {}", outcome.fault, outcome.seed);
            figures::faults::drawn(format!("{}-{}.svg", outcome.fault, outcome.seed), &what, recording)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let circumstances = Circumstances::from_command(leg, whole.command_line());
    let verdict = if report.is_good() { "nothing missed" } else { "failures" };
    let head = Head {
        kind: "fault campaign",
        title: &format!("{}: {verdict}", leg.name),
        time_utc: &circumstances.time_utc,
        command: Some(&circumstances.command),
        lines: &[],
    };
    let mut sections = vec![
        Section::new("Rows of the catalogue").table(report.table()),
        Section::new("Notes").lines(report.notes().lines().map(str::to_owned)),
    ];
    if !lines.is_empty() {
        sections.push(Section::new("Runs").lines(lines).figures(&figures));
    }
    Ok(sections::page(head, &sections))
}

/// Defaults of the full campaign.
const FULL_SEEDS: u64 = 1000;
const FULL_SWEEP: u64 = 8000;
const FULL_PAIRS: u64 = 10_000;
const FULL_HOURS: f64 = 10.0;
/// Fewest runs of a blind campaign: with fewer, some rows have no detectable run.
const FEWEST_BLIND: usize = 16;
/// Default number of runs.
const SEEDS: u64 = 20;

impl FaultsArguments {
    fn names(&self, kind: &str) -> bool {
        self.fault.iter().any(|name| name == kind)
    }

    /// The leg, with the shares of its assistance.
    fn leg(&self) -> Result<LegFile, ToolError> {
        let leg = self.leg.load()?;
        Ok(match self.assist {
            Some(mode) => LegFile { assist: Some(mode.shares(&AssistFile::USUAL)), ..leg },
            None => leg,
        })
    }

    fn options(&self) -> Result<CampaignOptions, ToolError> {
        let mut rows = rows(&self.fault)?;
        if self.assist.is_some() {
            rows.retain(|entry| matches!(entry, Entry::Forked(_)));
        }
        if self.blind {
            rows.retain(Entry::can_be_blind);
            let named = |name: &String| rows.iter().any(|entry| entry.fault().id == name);
            if rows.is_empty() || !self.fault.iter().all(named) {
                return Err(ToolError::input(format!(
                    "--blind: some rows of --fault {} have no detectors that can be switched off",
                    self.fault.join(" --fault ")
                )));
            }
        }
        if self.every_tick && !rows.iter().any(|entry| entry.fault().id == "X1") {
            return Err(ToolError::input(
                "--every-tick: tests the emergency stop (row X1), which --fault excludes",
            ));
        }
        if let Some(seconds) = self.seconds
            && !(0.01..=300.0).contains(&seconds)
        {
            return Err(ToolError::input(format!("--seconds: {seconds} is not from 0.01 to 300")));
        }
        if !(0.0..=1000.0).contains(&self.hours) {
            return Err(ToolError::input(format!("--hours: {} is not from 0 to 1000", self.hours)));
        }
        let seeds = self.seeds.unwrap_or(if self.full { FULL_SEEDS } else { SEEDS });
        let seeds: Vec<u64> = self.replay.map_or_else(|| (1..=seeds).collect(), |seed| vec![seed]);
        // `sweep` and `pairs` run as often as a row if named. Without names, the full campaign runs
        // all of them.
        let trials = |kind: &str, given: Option<u64>, full: u64| match given {
            Some(most) => (1..=most).collect(),
            None if self.full && (self.fault.is_empty() || self.names(kind)) => (1..=full).collect(),
            None if self.names(kind) => seeds.clone(),
            None => Vec::new(),
        };
        Ok(CampaignOptions {
            sweep: trials(KINDS[0], self.sweep, FULL_SWEEP),
            pairs: trials(KINDS[1], self.pairs, FULL_PAIRS),
            rows,
            seeds,
            whole: self.full && self.seeds.is_none(),
            every_tick: self.every_tick || self.full && self.fault.is_empty(),
            manner: Manner {
                blind: if self.blind { Blind::Row } else { Blind::None },
                recorded: self.replay.is_some(),
                brief: false,
            },
            seconds: self.seconds,
            shard: self.shard.unwrap_or(Shard::WHOLE),
        })
    }
}

/// Injects and reports; exit code 3 if anything was missed.
pub(crate) fn run(arguments: &FaultsArguments, stated: Vec<Argument>) -> Result<u8, ToolError> {
    let options = arguments.options()?;
    let leg = arguments.leg()?;
    // Checked first: hours of runs must not end without a document for their table.
    if let Some(path) = &arguments.docs {
        document::check(path, DOCUMENT[0], DOCUMENT[1])?;
    }
    let started = Instant::now();
    let mut found = campaign(&leg, &options)?;
    let injected_s = started.elapsed().as_secs_f64();
    let simulated = if arguments.full && arguments.hours == 0.0 { FULL_HOURS } else { arguments.hours };
    if simulated > 0.0 {
        found.hours = Some(hours(&leg, simulated, options.shard)?);
    }
    let whole_s = started.elapsed().as_secs_f64();
    let whole =
        CampaignHeader { command: "faults".into(), arguments: stated, leg: Some(leg), program: program() };
    let part = ShardResults::new(options.shard, found);
    let code = match (arguments.shard, &arguments.json) {
        (Some(_), Some(path)) => part.write(path, &whole, &format!("{} runs", part.results.runs()))?,
        _ => conclude(arguments, &whole, vec![part])?,
    };
    output::print(&format!(
        "time needed: {whole_s:.0} s, of which faults {injected_s:.0} s, normal motion {:.0} s\n",
        whole_s - injected_s
    ))?;
    Ok(code)
}

/// Reports the runs of all shards; returns the exit code.
pub(super) fn conclude(
    arguments: &FaultsArguments,
    whole: &CampaignHeader,
    parts: Vec<ShardResults<Campaign>>,
) -> Result<u8, ToolError> {
    let options = arguments.options()?;
    let found = Campaign::joined(parts, &options.rows);
    let report = CampaignReport::new(&options.rows, &found);
    output::print(&report.table().to_text())?;
    output::print(&report.notes())?;
    if arguments.fault.is_empty() {
        let rows = ON_THE_CHIP.map(|fault| format!("{} ({})", fault.id, fault.fault)).join(", ");
        output::print(&format!(
            "not run here, since they need the processor: {rows}; `cargo chip faults` runs them\n"
        ))?;
    }
    if arguments.replay.is_some() {
        for outcome in found.outcomes.iter().chain(&found.trials) {
            output::print(&format!("{}\n", line(outcome)))?;
        }
    }
    if let Some(path) = &arguments.json {
        write_json(path, &report)?;
    }
    if let Some(path) = &arguments.docs {
        document::replace(path, DOCUMENT[0], DOCUMENT[1], &report.table().to_markdown())?;
    }
    if let Some(path) = &arguments.report {
        let page = page(whole, &report, &found)?;
        files::write(path, page)?;
        output::print(&format!("report: {}\n", path.display()))?;
    }
    if arguments.blind {
        let unnoticed: Vec<_> =
            report.rows.iter().filter(|row| !row.is_noticed()).map(|row| row.fault).collect();
        if options.seeds.len() < FEWEST_BLIND {
            output::print(&format!(
                "fewer than {FEWEST_BLIND} seeds may be too few for rows whose faults are rarely detectable\n"
            ))?;
        }
        for detector in &report.detectors {
            output::print(&detector.line())?;
        }
        let unnoticed: Vec<_> = unnoticed
            .into_iter()
            .chain(
                report
                    .detectors
                    .iter()
                    .filter(|detector| !detector.is_noticed())
                    .map(|detector| detector.code),
            )
            .collect();
        let words = if unnoticed.is_empty() { "none" } else { &unnoticed.join(", ") };
        output::print(&format!("detectors without which every run still passes: {words}\n"))?;
        let all = unnoticed.is_empty() && report.base_alarms.is_empty();
        return Ok(if all { EXIT_ACCEPTED } else { EXIT_REFUSED });
    }
    Ok(if report.is_good() { EXIT_ACCEPTED } else { EXIT_REFUSED })
}
