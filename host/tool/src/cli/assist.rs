//! `assist`: a wearer moves in a leg that is transparent, carries weight or assists, and both are measured.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, EXIT_REFUSED, ToolError};
use scarab_base::shard::Shard;
use scarab_base::{files, output};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::assist::AssistFile;
use scarab_identify::leg::exercise::Exercise;
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_rig::assist::study::{AssistOptions, Mode, study};
use scarab_rig::assist::subject::Cuffs;
use scarab_rig::faults::campaign::{CampaignOptions, campaign};
use scarab_rig::faults::entry::{Entry, entries};
use scarab_rig::faults::report::CampaignReport;
use scarab_rig::faults::run::{Blind, Manner};

use crate::cli::arguments::{Choice, OutputFolder, one_of};
use crate::cli::common::write_json;
use crate::cli::leg_options::LegOptions;
use crate::view::html::Circumstances;
use crate::view::sections;
use crate::view::{assist as text, figures};

/// Walking at several strides per second.
const GAITS: &[Exercise] = &[Exercise::Gait(0.5), Exercise::Gait(0.8), Exercise::Gait(1.2)];
/// Motions of the wearer.
const MOTIONS: &[Choice<&[Exercise]>] = &[
    ("gait", GAITS, "Walking in the air at 0.5, 0.8 and 1.2 strides per second"),
    ("kicking", &[Exercise::Kicking], "Kicks with the knee"),
    ("extension", &[Exercise::Extension], "Slow extensions of the knee, seated"),
    ("reaching", &[Exercise::Reaching], "Irregular reaching"),
];

/// Limit of the runs.
const MOST_RUNS: u64 = 100_000;

/// Leg, modes, motions and shares.
#[derive(Args, Debug)]
pub(crate) struct AssistArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// Mode of the leg; may be repeated. All three unless given.
    #[arg(long, value_enum)]
    mode: Vec<Mode>,
    /// Motion of the wearer; may be repeated. Gait, kicking and reaching unless given.
    #[arg(long, value_parser = one_of(MOTIONS))]
    motion: Vec<&'static [Exercise]>,
    /// Share of the empty leg's friction that is compensated (0 to 1).
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, allow_negative_numbers = true)]
    friction: f64,
    /// Share of the empty leg's inertia that is compensated (0 to 0.8).
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, allow_negative_numbers = true)]
    inertia: f64,
    /// Share of the wearer's weight in mode weight (0 to 1).
    #[arg(long, value_name = "SHARE", default_value_t = 0.5, allow_negative_numbers = true)]
    weight: f64,
    /// Share of the wearer's torque in mode periodic (-0.5 to 0.5); a negative one resists.
    #[arg(long, value_name = "SHARE", default_value_t = 0.3, allow_negative_numbers = true)]
    periodic: f64,
    /// Stiffness of the cuffs across the segment, N/m (500 to 100000).
    #[arg(
        long,
        value_name = "N/M",
        default_value_t = 20_000.0,
        allow_negative_numbers = true,
        help_heading = "Simulated wearer"
    )]
    cuff_stiffness: f64,
    /// Damping of the cuffs across the segment, N s/m (1 to 2000).
    #[arg(
        long,
        value_name = "N S/M",
        default_value_t = 400.0,
        allow_negative_numbers = true,
        help_heading = "Simulated wearer"
    )]
    cuff_damping: f64,
    /// Seed of noise, identification and wearers.
    #[arg(long, conflicts_with = "seeds")]
    seed: Option<u64>,
    /// Run each seed from A to B, both included: A..B.
    #[arg(long, value_parser = crate::cli::identify::parse_seeds)]
    seeds: Option<(u64, u64)>,
    /// Runs that measure the energy given to random limp and resisting wearers.
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u64).range(0..=MOST_RUNS))]
    energy_runs: u64,
    /// Random exoskeletons that are observed at rest.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(0..=MOST_RUNS))]
    drawn_legs: u64,
    /// Runs of each fault of the catalogue that are injected in each mode.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=MOST_RUNS))]
    fault_runs: u64,
    /// Write the page (assist.html), the report (assist.json) and the figures into this directory.
    #[arg(long, value_name = "DIR")]
    out: Option<OutputFolder>,
}

/// Checks a value against its limits.
fn within(option: &str, unit: &str, value: f64, [low, high]: [f64; 2]) -> Result<f64, ToolError> {
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    Err(ToolError::input(format!("--{option}: {value} {unit} is outside {low} to {high}")))
}

fn share(option: &str, value: f64, limits: [f64; 2]) -> Result<f64, ToolError> {
    within(option, "(a share)", value, limits)
}

impl AssistArguments {
    fn options(&self) -> Result<AssistOptions, ToolError> {
        let mut modes = self.mode.clone();
        if modes.is_empty() {
            modes = vec![Mode::Transparent, Mode::Weight, Mode::Periodic];
        }
        modes.dedup();
        let usual = [GAITS, &[Exercise::Kicking], &[Exercise::Reaching]];
        let chosen = if self.motion.is_empty() { &usual[..] } else { &self.motion };
        let seed = self.seed.unwrap_or(DEFAULT_SEED);
        Ok(AssistOptions {
            modes,
            exercises: chosen.concat(),
            shares: AssistFile {
                friction: share("friction", self.friction, [0.0, 1.0])?,
                inertia: share("inertia", self.inertia, [0.0, 0.8])?,
                weight: share("weight", self.weight, [0.0, 1.0])?,
                periodic: share("periodic", self.periodic, [-0.5, 0.5])?,
            },
            cuffs: Cuffs {
                stiffness: within("cuff-stiffness", "N/m", self.cuff_stiffness, [500.0, 1e5])?,
                damping: within("cuff-damping", "N s/m", self.cuff_damping, [1.0, 2000.0])?,
            },
            seeds: self.seeds.unwrap_or((seed, seed)),
            energy_runs: self.energy_runs as usize,
            drawn_legs: self.drawn_legs as usize,
        })
    }
}

/// Injects the faults that fork a machine, in each mode: missed runs with broken invariants, and all runs.
fn inject(leg: &LegFile, options: &AssistOptions, runs: u64) -> Result<[usize; 2], ToolError> {
    let rows: Vec<Entry> = entries().into_iter().filter(|entry| matches!(entry, Entry::Forked(_))).collect();
    let campaigns = CampaignOptions {
        rows: rows.clone(),
        seeds: (1..=runs).collect(),
        every_tick: false,
        manner: Manner { blind: Blind::None, recorded: false, brief: false },
        sweep: Vec::new(),
        pairs: Vec::new(),
        whole: false,
        seconds: None,
        shard: Shard::WHOLE,
    };
    let mut counts = [0; 2];
    for mode in &options.modes {
        let leg = LegFile { assist: Some(mode.shares(&options.shares)), ..leg.clone() };
        let found = campaign(&leg, &campaigns)?;
        let report = CampaignReport::new(&rows, &found);
        let missed: usize = report.rows.iter().map(|row| row.missed + row.false_alarms).sum();
        counts[0] += missed + report.invariants_broken + report.base_alarms.len();
        counts[1] += report.runs;
    }
    Ok(counts)
}

/// Measures and reports; exit code 3 if a limit was exceeded.
pub(crate) fn run(arguments: &AssistArguments) -> Result<u8, ToolError> {
    let options = arguments.options()?;
    let leg = arguments.leg.load()?;
    let mut report = study(&leg, &options)?;
    if arguments.fault_runs > 0 {
        let [missed, faults] = inject(&leg, &options, arguments.fault_runs)?;
        (report.missed, report.faults) = (Some(missed), faults);
    }
    let drawn = if arguments.out.is_some() { figures::assist::all(&report)? } else { Vec::new() };
    let sections = text::sections(&report, &drawn);
    let seeds = text::seeds(&report);
    output::print(&format!("{}: {seeds}\n\n{}", report.leg, sections::text(&sections)))?;
    if let Some(directory) = &arguments.out {
        figures::write(directory, &drawn)?;
        write_json(&directory.join("assist.json"), &report)?;
        let page = text::page(&Circumstances::now(&leg), &report, &sections);
        files::write(&directory.join("assist.html"), page)?;
        output::print(&format!("\nreport: {}\n", directory.join("assist.html").display()))?;
    }
    Ok(if report.failures().is_empty() { EXIT_ACCEPTED } else { EXIT_REFUSED })
}
