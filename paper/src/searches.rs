//! All runs of Table IV, in parallel.
//!
//! A row is a function, a search, a precision and a tolerance; one run serves all tolerances of its
//! precision. Single precision is run for the default swarm and to 0.1 only: it cannot resolve a
//! millionth at values of 20. Run number r of every row has the same seed, so all searches meet the
//! same shifts and rotations.

use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use scarab::real::Real;
use scarab_host::base::error::ToolError;

use super::contenders::{self, Algorithm};
use super::problems::{CASES, Case};
use super::recorder::{Hit, Recorder};
use super::seeds::ReportSeed;
use super::statistics::Row;

/// The paper's tolerance, and one that requires precision; largest first.
pub const TOLERANCES: [f64; 2] = [0.1, 1e-6];

/// Hits of one run, by tolerance.
type Hits = Vec<Option<Hit>>;

/// All rows of these searches, each from `runs` runs.
pub fn rows(algorithms: &[Algorithm], runs: u64) -> Result<Vec<Row>, ToolError> {
    let contests = CASES.iter().flat_map(|case| algorithms.iter().map(move |algorithm| (case, *algorithm)));
    let precisions = |algorithm: &Algorithm| if *algorithm == Algorithm::Bso { 2 } else { 1 };
    let in_all: usize = algorithms.iter().map(precisions).sum();
    let progress = ProgressBar::new(runs * (CASES.len() * in_all) as u64);
    if let Ok(style) =
        ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {elapsed} elapsed, {eta} left")
    {
        progress.set_style(style);
    }
    let mut rows = Vec::new();
    for (case, algorithm) in contests {
        let double = hits(runs, &progress, |seed| run_double(case, algorithm, seed))?;
        rows.extend(tabulated(case, algorithm, "f64", &TOLERANCES, &double));
        if algorithm == Algorithm::Bso {
            let single =
                hits(runs, &progress, |seed| run_own::<f32>(case, algorithm, seed, &TOLERANCES[..1]))?;
            rows.extend(tabulated(case, algorithm, "f32", &TOLERANCES[..1], &single));
        }
    }
    progress.finish_and_clear();
    Ok(rows)
}

fn hits(
    runs: u64,
    progress: &ProgressBar,
    run: impl Fn(ReportSeed) -> Result<Hits, ToolError> + Sync,
) -> Result<Vec<Hits>, ToolError> {
    let one = |number: u64| {
        let hits = run(ReportSeed::of_run(number));
        progress.inc(1);
        hits
    };
    (0..runs).into_par_iter().map(one).collect()
}

fn run_double(case: &Case, algorithm: Algorithm, seed: ReportSeed) -> Result<Hits, ToolError> {
    let problem = case.problem::<f64>(seed);
    let recorder = Recorder::new(&problem, case.minimum(), &TOLERANCES);
    contenders::run(algorithm, &recorder, seed.search())?;
    Ok(recorder.into_hits())
}

fn run_own<T: Real>(
    case: &Case,
    algorithm: Algorithm,
    seed: ReportSeed,
    tolerances: &[f64],
) -> Result<Hits, ToolError> {
    let problem = case.problem::<T>(seed);
    let recorder = Recorder::new(&problem, case.minimum(), tolerances);
    contenders::run_own(algorithm, &recorder, seed.search())?;
    Ok(recorder.into_hits())
}

fn tabulated(
    case: &Case,
    algorithm: Algorithm,
    precision: &'static str,
    tolerances: &[f64],
    runs: &[Hits],
) -> Vec<Row> {
    let row = |(index, tolerance): (usize, &f64)| {
        let hits: Hits = runs.iter().map(|hits| hits.get(index).copied().flatten()).collect();
        Row::of(case, algorithm, precision, *tolerance, &hits)
    };
    tolerances.iter().enumerate().map(row).collect()
}
