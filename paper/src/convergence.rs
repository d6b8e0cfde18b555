//! Iterations of the beetle swarm on identification problems.
//!
//! Every run has its own record: one of several exciting motions, its own noise, and the whole
//! firmware up to the start of the search. Then the default swarm searches sets of unknowns from a
//! cold start, in single precision as on the device. The sets are single parameters, base
//! parameters and log-Cholesky coordinates, the latter complete and reduced. Single parameters are
//! also searched by the paper's rules and by a particle swarm, with as many evaluations.
//!
//! ```text
//! reached where   J / J_opt - 1 <= 1e-3,  J = J_LS + (J(p) - J_LS), chi-square units of the data alone
//! over the rows     J_LS = sum of squares of the filtered rows, about m S each: identification minimises it
//! over the samples  J_LS = number of logged samples: the paper minimises it; the same J(p) - J_LS
//! ```
//!
//! Both are reported because the share alone means nothing: filtering removes noise and leaves the
//! parameters' effect.
//!
//! | row | unknowns | box | J_opt, in double precision |
//! | --- | --- | --- | --- |
//! | raw | every parameter with an effect on torque | prior's range | active set over single parameters |
//! | base | base parameters | sums of those ranges | active set |
//! | log-Cholesky | 10 per link, logs of IA, FC, FV, and OFF | as in `full_search.rs` | barriers of 1e-8 |
//! | seen | without the nine of a link along gravity, see [`super::seen_links`] | as above | as above |
//!
//! `chain` and `leg` have links and friction, as the paper's Equation (6); `whole` adds a rotor and
//! an offset per joint, as a real drive has. `leg-28` is the whole leg in log-Cholesky coordinates.
//!
//! J and J_opt are computed in double precision, whatever the swarm's precision. Single parameters
//! have flat directions. A penalty of a millionth of a chi-square unit per range of the box makes
//! their optimum unique; the result excludes it.
//!
//! Limits: 1e-3 of J_LS is a few tenths of a chi-square unit at these durations, and another number
//! at others.

use rayon::prelude::*;
use scarab::ident::Record;
use scarab::motion::Periodic;
use scarab::units::Second;
use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_base::shard::Shard;
use scarab_base::table::Table;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile, Switch};
use scarab_identify::leg::motions::{EXCITATION_CYCLES, most_informative};
use scarab_rig::options::SimulationOptions;
use scarab_rig::pair::{Context, Pair};
use serde::Serialize;

use super::chain::{LEG, median};
use super::runs::{RowRuns, run_rows};
use super::seeds::ReportSeed;
use super::swarm_bench::{Bench, SHARE, Trial};
use super::{Part, Section};
use crate::digits::percent;

/// Runs per row by default.
pub const RUNS: u64 = 100;
/// Exciting motions, each the best of some random ones.
const MOTIONS: u64 = 5;
const CANDIDATES: u64 = 40;
const MOTION_SEED: u64 = 3_000_000;
const PERIOD: Second = Second(10.0);
/// Duration of the longest exciting motion including its approach, s.
const LONGEST_RUN_S: f64 = 120.0;

/// Iterations and evaluations over all runs.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spent {
    /// Share of runs that reached the goal, 0..1.
    pub success_rate: f64,
    /// Median over all runs, failures counted as infinite; null if infinite.
    pub iterations_median: Number,
    /// 95th percentile; failures and null as above.
    pub iterations_p95: Number,
    /// Median of the evaluations; failures and null as above.
    pub evaluations_median: Number,
}

impl Spent {
    fn from_trials(trials: impl Iterator<Item = Option<(u32, u32)>>) -> Self {
        let trials: Vec<_> = trials.collect();
        let infinite = |of: fn((u32, u32)) -> u32| -> Vec<f64> {
            trials.iter().map(|reached| reached.map_or(f64::INFINITY, |spent| f64::from(of(spent)))).collect()
        };
        let reached = trials.iter().flatten().count() as f64;
        Self {
            success_rate: reached / trials.len().max(1) as f64,
            iterations_median: median(infinite(|(iterations, _)| iterations)).into(),
            iterations_p95: ninety_five(infinite(|(iterations, _)| iterations)).into(),
            evaluations_median: median(infinite(|(_, evaluations)| evaluations)).into(),
        }
    }
}

/// One set of unknowns of one leg, over all runs.
#[derive(Clone, Debug, Serialize)]
pub struct ConvergenceRow {
    /// `chain-raw`, `leg-whole-base`, ...
    pub problem: String,
    /// Number of unknowns.
    pub dimension: usize,
    /// Runs.
    pub runs: u64,
    /// Results for the cost over the filtered rows.
    #[serde(flatten)]
    pub rows: Spent,
    /// Results for the cost over the logged samples.
    pub over_samples: Spent,
    /// Least J - J_opt of any run, chi-square units; a negative value would disprove the optimum.
    pub lowest_chi2: Number,
    /// J - J_opt of the best of a run, chi-square units, median; a search that reached both goals has
    /// stopped there.
    pub median_chi2: Number,
    /// Goal for the iterations of 95 % of the runs; null for other searches.
    pub goal_iterations_p95: Option<u32>,
}

/// All rows.
#[derive(Clone, Debug, Serialize)]
pub struct ConvergenceReport {
    /// Number of exciting motions.
    pub motions: u64,
    /// Tolerance on J / J_opt - 1.
    pub tolerance: f64,
    /// Precision of the swarm.
    pub precision: &'static str,
    /// Rows, leg by leg.
    pub rows: Vec<ConvergenceRow>,
}

/// Formats the section of these runs.
pub fn section(runs: &[Vec<[Option<Trial>; SETS]>]) -> Result<Section, ToolError> {
    let report = report(runs);
    Section::new(Part::Convergence, "convergence", &report, words(&report), Vec::new())
}

/// Number of sets of unknowns and searches.
pub const SETS: usize = 6;

/// Sets of unknowns with name and goal for 95 % of the runs; `log-cholesky-seen` only for legs with a
/// link along gravity. Other searches have no goal.
type Unknowns = [(&'static str, Option<u32>); SETS];

/// Each leg's searches share their records.
const LEGS: [(&str, Unknowns); 4] = [
    ("chain", PLAIN),
    ("leg", PLAIN),
    (
        "leg",
        [
            ("whole-raw", Some(75)),
            ("whole-raw, the paper's rules", None),
            ("whole-raw, particle swarm", None),
            ("whole-base", Some(75)),
            ("28", Some(125)),
            ("28-seen", Some(125)),
        ],
    ),
    (
        "chain",
        [
            ("whole-raw", Some(75)),
            ("whole-raw, the paper's rules", None),
            ("whole-raw, particle swarm", None),
            ("whole-base", Some(75)),
            ("whole-log-cholesky", Some(75)),
            ("whole-log-cholesky-seen", Some(75)),
        ],
    ),
];
const PLAIN: Unknowns = [
    ("raw", Some(75)),
    ("raw, the paper's rules", None),
    ("raw, particle swarm", None),
    ("base", Some(75)),
    ("log-cholesky", Some(75)),
    ("log-cholesky-seen", Some(75)),
];

/// Runs all searches, leg by leg.
pub fn runs(runs: u64, shard: Shard) -> Result<RowRuns<[Option<Trial>; SETS]>, ToolError> {
    let (chain, leg) = (LegFile::load(LEG)?, LegFile::load(DEFAULT_LEG)?);
    Ok(vec![
        leg_runs::<3, 28>(&links_and_friction(&chain), LEGS[0].0, runs, shard)?,
        leg_runs::<2, 13>(&links_and_friction(&leg), LEGS[1].0, runs, shard)?,
        leg_runs::<2, 13>(&leg, LEGS[2].0, runs, shard)?,
        leg_runs::<3, 28>(&chain, LEGS[3].0, runs, shard)?,
    ])
}

/// Reports these runs.
pub fn report(runs: &[Vec<[Option<Trial>; SETS]>]) -> ConvergenceReport {
    let rows = LEGS.iter().zip(runs).flat_map(|((name, unknowns), trials)| leg_rows(name, unknowns, trials));
    ConvergenceReport { motions: MOTIONS, tolerance: SHARE, precision: "f32", rows: rows.collect() }
}

/// The leg without rotors and offsets, in the plant and in the estimate, as in the paper.
fn links_and_friction(leg: &LegFile) -> LegFile {
    let mut leg = leg.clone();
    for joint in &mut leg.joints {
        (joint.rotor, joint.offset) = (Switch::Off, Switch::Off);
        for link in [&mut joint.truth, &mut joint.prior].into_iter().flatten() {
            (link.rotor_inertia, link.offset) = (0.0, 0.0);
        }
    }
    leg
}

/// Runs the searches of one leg.
fn leg_runs<const N: usize, const B: usize>(
    leg: &LegFile,
    name: &str,
    runs: u64,
    shard: Shard,
) -> Result<Vec<[Option<Trial>; SETS]>, ToolError> {
    let motions = motions::<N, B>(leg)?;
    let rows = run_rows(&format!("convergence, {name}"), &[()], runs, shard, |(), seed| {
        let seed = seed.search();
        let motion = motions[(seed % MOTIONS) as usize];
        let (context, record) = recorded::<N, B>(leg, seed, motion)?;
        let bench = Bench::new(&context, record, seed)?;
        let (whole, seen) = bench.whole_legs();
        let [raw, paper, particles] = bench.raw().map(Some);
        Ok([raw, paper, particles, Some(bench.base()), Some(whole), seen])
    })?;
    Ok(rows.into_iter().flatten().collect())
}

/// Rows of one leg.
fn leg_rows(name: &str, unknowns: &Unknowns, trials: &[[Option<Trial>; SETS]]) -> Vec<ConvergenceRow> {
    let row = |index: usize| {
        let all = || trials.iter().filter_map(|trials| trials[index]);
        let (unknowns, goal_iterations_p95) = unknowns[index];
        all().next()?;
        Some(ConvergenceRow {
            problem: format!("{name}-{unknowns}"),
            dimension: all().map(|trial| trial.dimension).max().unwrap_or(0),
            runs: trials.len() as u64,
            rows: Spent::from_trials(all().map(|trial| trial.reached[0])),
            over_samples: Spent::from_trials(all().map(|trial| trial.reached[1])),
            lowest_chi2: all().map(|trial| trial.lowest).fold(f64::INFINITY, f64::min).into(),
            median_chi2: median(all().map(|trial| trial.lowest)).into(),
            goal_iterations_p95,
        })
    };
    (0..SETS).filter_map(row).collect()
}

/// Value that 95 % do not exceed.
fn ninety_five(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(((0.95 * values.len() as f64).ceil() as usize).saturating_sub(1)).copied()
}

fn motions<const N: usize, const B: usize>(leg: &LegFile) -> Result<Vec<Periodic<N>>, ToolError> {
    let context = Context::<N, B>::new(leg, &SimulationOptions::with_seed(ReportSeed::from_run(0).search()))?;
    let limits = context.configuration.envelope();
    let best = |index: u64| {
        let seed = MOTION_SEED + 1000 * index;
        most_informative(&context.background.model, &limits, PERIOD, EXCITATION_CYCLES, seed, CANDIDATES)
            .ok_or_else(|| leg.error("no exciting motion fits the limits").into())
    };
    (0..MOTIONS).into_par_iter().map(best).collect()
}

/// Drives the leg along a motion and returns the record from which the search begins.
fn recorded<const N: usize, const B: usize>(
    leg: &LegFile,
    seed: u64,
    motion: Periodic<N>,
) -> Result<(Context<N, B>, Record<f32, N, B>), ToolError> {
    let mut context = Context::<N, B>::new(leg, &SimulationOptions::with_seed(seed))?;
    (context.motions.excitation, context.configuration.excitation) = (motion, motion);
    let mut pair = Pair::new(leg, &context, seed)?;
    pair.evaluations = 0;
    pair.enable(context.gravity);
    let record = pair
        .recorded(context.gravity, LONGEST_RUN_S)
        .ok_or_else(|| leg.error(format!("seed {seed}: the exciting motion was not completed")))?;
    Ok((context, record))
}

fn words(report: &ConvergenceReport) -> String {
    let mut table = Table::default().label("problem").numbers([
        "unknowns",
        "over rows: reached, %",
        "iterations, median",
        "95 %",
        "evaluations, median",
        "over samples: reached, %",
        "iterations, median",
        "95 %",
        "evaluations, median",
        "J - J_opt, median",
        "goal, 95 %",
    ]);
    let excess = |value| if value < 100.0 { format!("{value:.1}") } else { format!("{value:.1e}") };
    let count = |value: Number| value.known().map_or("-".to_owned(), |value| format!("{value:.0}"));
    for row in &report.rows {
        let spent = |spent: &Spent| {
            [
                percent(Some(100.0 * spent.success_rate)),
                count(spent.iterations_median),
                count(spent.iterations_p95),
                count(spent.evaluations_median),
            ]
        };
        let mut cells = vec![row.problem.clone(), row.dimension.to_string()];
        cells.extend(spent(&row.rows));
        cells.extend(spent(&row.over_samples));
        cells.push(row.median_chi2.known().map_or("-".to_owned(), excess));
        cells.push(row.goal_iterations_p95.map_or_else(String::new, |goal| goal.to_string()));
        table.row(cells);
    }
    let runs = report.rows.first().map_or(0, |row| row.runs);
    format!(
        "Default beetle swarm unless another is named, cold start, single precision, {runs} runs of each row over {} exciting motions, each with noise of \
         its own, at most 24,000 evaluations; iterations to J / J_opt - 1 <= {:.0e}, failures counted as endless.\n\n{}",
        report.motions,
        report.tolerance,
        table.to_markdown()
    )
}
