//! All runs of Table IV.
//!
//! A row is a function, a search, a precision and a tolerance; one run serves all tolerances of its
//! precision. Single precision is run for the default swarm and to 0.1 only: it cannot resolve a
//! millionth at values of 20. Run number r of every row has the same seed, so all searches meet the
//! same shifts and rotations.

use scarab::real::Real;
use scarab_base::error::ToolError;
use scarab_base::shard::Shard;

use super::contenders::{self, Algorithm};
use super::problems::{CASES, Case};
use super::recorder::{Hit, Recorder};
use super::runs::{RowRuns, run_rows};
use super::seeds::ReportSeed;
use super::statistics::Row;

/// The paper's tolerance, and one that requires precision; largest first.
pub const TOLERANCES: [f64; 2] = [0.1, 1e-6];

/// Hits of one run, by tolerance.
pub type Hits = Vec<Option<Hit>>;

/// A search on a function in one precision.
struct Contest {
    case: &'static Case,
    algorithm: Algorithm,
    is_single: bool,
}

/// Contests of these searches, in the order of the report.
fn contests(algorithms: &[Algorithm]) -> Vec<Contest> {
    let of_case = |case: &'static Case| {
        algorithms.iter().flat_map(move |&algorithm| {
            let precisions: &[bool] = if algorithm == Algorithm::Bso { &[false, true] } else { &[false] };
            precisions.iter().map(move |&is_single| Contest { case, algorithm, is_single })
        })
    };
    CASES.iter().flat_map(of_case).collect()
}

/// Runs of every contest of these searches.
pub fn runs(algorithms: &[Algorithm], runs: u64, shard: Shard) -> Result<RowRuns<Hits>, ToolError> {
    run_rows("Table IV", &contests(algorithms), runs, shard, |contest, seed| {
        let Contest { case, algorithm, is_single } = contest;
        if *is_single {
            run_own::<f32>(case, *algorithm, seed, &TOLERANCES[..1])
        } else {
            run_double(case, *algorithm, seed)
        }
    })
}

/// All rows of these searches.
#[must_use]
pub fn rows(algorithms: &[Algorithm], runs: &[Vec<Hits>]) -> Vec<Row> {
    let rows = |(contest, hits): (&Contest, &Vec<Hits>)| {
        let (precision, tolerances) =
            if contest.is_single { ("f32", &TOLERANCES[..1]) } else { ("f64", &TOLERANCES[..]) };
        tabulated(contest.case, contest.algorithm, precision, tolerances, hits)
    };
    contests(algorithms).iter().zip(runs).flat_map(rows).collect()
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
        Row::new(case, algorithm, precision, *tolerance, &hits)
    };
    tolerances.iter().enumerate().map(row).collect()
}
