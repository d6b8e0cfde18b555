//! Rows of Table IV: many runs of one search on one function, as medians and percentiles.
//!
//! A failed run counts as infinite: a median or percentile that falls on a failed run is unknown (`null`).

use serde::Serialize;

use super::contenders::Algorithm;
use super::problems::{Case, Reading};
use super::recorder::Hit;

/// One row of the report; its fields are an interface.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the function.
    pub function: &'static str,
    /// Printed or intended reading.
    pub reading: Reading,
    /// Number of coordinates.
    pub dimension: usize,
    /// The search.
    pub algorithm: Algorithm,
    /// Distance to the least value within which a run succeeds.
    pub tolerance: f64,
    /// Runs, each with a seed of its own.
    pub runs: usize,
    /// Share of the runs that succeed, 0..1.
    pub success_rate: f64,
    /// Iterations of the median run.
    pub iterations_median: Option<u32>,
    /// Iterations that 95 % of the runs do not exceed.
    pub iterations_p95: Option<u32>,
    /// Evaluations of the median run.
    pub evaluations_median: Option<u32>,
    /// `f64` or `f32`.
    pub precision: &'static str,
}

impl Row {
    /// Row of these runs.
    pub fn new(
        case: &Case,
        algorithm: Algorithm,
        precision: &'static str,
        tolerance: f64,
        runs: &[Option<Hit>],
    ) -> Self {
        let sorted = |count: fn(&Hit) -> u32| {
            let mut counts: Vec<u32> = runs.iter().flatten().map(count).collect();
            counts.sort_unstable();
            counts
        };
        let (iterations, evaluations) = (sorted(|hit| hit.iterations), sorted(|hit| hit.evaluations));
        Self {
            function: case.id,
            reading: case.reading,
            dimension: case.dimension,
            algorithm,
            tolerance,
            runs: runs.len(),
            success_rate: iterations.len() as f64 / runs.len().max(1) as f64,
            iterations_median: quantile(&iterations, 0.5, runs.len()),
            iterations_p95: quantile(&iterations, 0.95, runs.len()),
            evaluations_median: quantile(&evaluations, 0.5, runs.len()),
            precision,
        }
    }

    /// Whether the row belongs to this case.
    pub fn is_of(&self, case: &Case) -> bool {
        (self.function, self.reading, self.dimension) == (case.id, case.reading, case.dimension)
    }
}

/// Smallest count that a share of all runs does not exceed; `sorted` holds the successful runs.
fn quantile(sorted: &[u32], share: f64, runs: usize) -> Option<u32> {
    let rank = (share * runs as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failed_runs_count_as_infinite() {
        let counts = [3, 5, 7];
        assert_eq!(quantile(&counts, 0.5, 3), Some(5));
        assert_eq!(quantile(&counts, 0.5, 4), Some(5));
        assert_eq!(quantile(&counts, 0.5, 6), Some(7));
        assert_eq!(quantile(&counts, 0.5, 7), None);
        assert_eq!(quantile(&counts, 0.95, 3), Some(7));
        assert_eq!(quantile(&counts, 0.95, 4), None);
        assert_eq!(quantile(&[], 0.5, 1), None);
    }
}
