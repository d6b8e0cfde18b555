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
use super::problems::{CASES, Case, Problem};
use super::recorder::{Hit, Recorder};
use super::runs::{RowRuns, run_rows};
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
        let (case, algorithm, own) = (contest.case, contest.algorithm, seed.search());
        if contest.is_single {
            let search = |recorder: &Recorder<'_, f32, _>| contenders::run_own(algorithm, recorder, own);
            hits(&case.problem(seed), case, &TOLERANCES[..1], search)
        } else {
            let search = |recorder: &Recorder<'_, f64, _>| contenders::run(algorithm, recorder, own);
            hits(&case.problem(seed), case, &TOLERANCES, search)
        }
    })
}

/// All rows of these searches.
pub fn rows(algorithms: &[Algorithm], runs: &[Vec<Hits>]) -> Vec<Row> {
    let rows = |(contest, hits): (&Contest, &Vec<Hits>)| {
        let (precision, count) = if contest.is_single { ("f32", 1) } else { ("f64", TOLERANCES.len()) };
        let (case, algorithm) = (contest.case, contest.algorithm);
        let row = |(index, tolerance): (usize, &f64)| {
            let hits: Hits = hits.iter().map(|hits| hits.get(index).copied().flatten()).collect();
            Row::new(case, algorithm, precision, *tolerance, &hits)
        };
        TOLERANCES.iter().take(count).enumerate().map(row).collect::<Vec<_>>()
    };
    contests(algorithms).iter().zip(runs).flat_map(rows).collect()
}

/// Hits of one search on one problem.
fn hits<T: Real>(
    problem: &Problem<T>,
    case: &Case,
    tolerances: &[f64],
    search: impl Fn(&Recorder<'_, T, Problem<T>>) -> Result<(), ToolError>,
) -> Result<Hits, ToolError> {
    let recorder = Recorder::new(problem, case.minimum(), tolerances);
    search(&recorder)?;
    Ok(recorder.into_hits())
}
