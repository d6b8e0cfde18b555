//! Goals of the default swarm for the rows of Table IV, in both precisions.

use super::contenders::Algorithm;
use super::problems::Reading;
use super::statistics::Row;

/// Limits on the iterations to 0.1, with every run successful.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// Name of the function, intended reading.
    pub function: &'static str,
    /// Number of coordinates.
    pub dimension: usize,
    /// Most iterations of the median run.
    pub median: u32,
    /// Most iterations of 95 % of the runs.
    pub p95: u32,
}

const fn goal(function: &'static str, dimension: usize, median: u32, p95: u32) -> Goal {
    Goal { function, dimension, median, p95 }
}

/// All goals.
pub const GOALS: [Goal; 7] = [
    goal("f1", 2, 5, 6),
    goal("f2", 2, 3, 7),
    goal("f3", 2, 2, 4),
    goal("f4", 2, 7, 10),
    goal("f1", 30, 17, 20),
    goal("f4", 30, 23, 26),
    goal("f4-shifted-rotated", 30, 25, 29),
];

impl Goal {
    /// Row of the default swarm in a precision.
    pub fn row<'r>(&self, rows: &'r [Row], precision: &str) -> Option<&'r Row> {
        rows.iter().find(|row| {
            (row.function, row.dimension) == (self.function, self.dimension)
                && row.algorithm == Algorithm::Bso
                && row.reading == Reading::Intended
                && row.precision == precision
                && row.tolerance == super::searches::TOLERANCES[0]
        })
    }

    /// Whether the row reaches the goal.
    pub fn is_reached_by(&self, row: &Row) -> bool {
        let within = |count: Option<u32>, most: u32| count.is_some_and(|count| count <= most);
        within(row.iterations_median, self.median)
            && within(row.iterations_p95, self.p95)
            && row.success_rate >= 1.0
    }
}
