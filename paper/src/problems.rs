//! Test functions by their names in the report, in their readings and dimensions.
//!
//! The functions are those of `scarab::swarm::TestProblem`, so the device evaluates the same ones. Names,
//! readings, and a new shift and rotation for every run belong to the report.
//!
//! `f4-shifted-rotated` is f(x) = Ackley(R (x - c)). The shift c is uniform within half of the half-box,
//! the rotation R uniform over the orthogonal matrices (Haar). Both are drawn from the run's seed. Source
//! of R: Gram-Schmidt on rows of normal numbers (Stewart, 1980). Cost: D^2 operations per evaluation.

use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::real::{Real, dot};
use scarab::swarm::{Objective, TestFunction, TestProblem};
use serde::Serialize;

use super::seeds::ReportSeed;

/// Most coordinates of any problem.
pub const MOST_COORDINATES: usize = 30;

/// Reading of a function: as printed in the paper, or as intended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Reading {
    /// Standard function.
    Intended,
    /// Function as the paper prints it.
    Printed,
}

/// One test function in one dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// Name in the report.
    pub id: &'static str,
    /// Reading of the function.
    pub reading: Reading,
    /// Number of coordinates.
    pub dimension: usize,
    function: TestFunction,
    /// Whether the function is shifted and rotated for every run.
    is_moved: bool,
}

const fn case(id: &'static str, function: TestFunction, dimension: usize) -> Case {
    Case { id, reading: Reading::Intended, dimension, function, is_moved: false }
}

const fn printed(id: &'static str, function: TestFunction) -> Case {
    Case { id, reading: Reading::Printed, dimension: 2, function, is_moved: false }
}

const fn moved(id: &'static str, function: TestFunction, dimension: usize) -> Case {
    Case { id, reading: Reading::Intended, dimension, function, is_moved: true }
}

/// All cases of Table IV: the paper's in the plane, the paper's in thirty dimensions, and further ones.
pub const CASES: [Case; 20] = [
    case("f1", TestFunction::Sphere, 2),
    case("f2", TestFunction::SixHumpCamel, 2),
    case("f3", TestFunction::Branin, 2),
    case("f4", TestFunction::Ackley, 2),
    printed("f1", TestFunction::Sphere),
    printed("f2", TestFunction::CamelAsPrinted),
    printed("f3", TestFunction::BraninAsPrinted),
    printed("f4", TestFunction::AckleyAsPrinted),
    case("f1", TestFunction::Sphere, 30),
    case("f4", TestFunction::Ackley, 30),
    moved("f4-shifted-rotated", TestFunction::Ackley, 2),
    moved("f4-shifted-rotated", TestFunction::Ackley, 30),
    case("ellipsoid-1e4", TestFunction::ShiftedEllipsoid, 30),
    case("ellipsoid-1e6", TestFunction::ShiftedSteepEllipsoid, 30),
    case("rosenbrock", TestFunction::Rosenbrock, 10),
    case("griewank", TestFunction::ShiftedGriewank, 30),
    case("schwefel-1.2", TestFunction::ShiftedSchwefel, 30),
    case("levy", TestFunction::Levy, 10),
    case("rastrigin", TestFunction::Rastrigin, 2),
    case("rastrigin", TestFunction::Rastrigin, 10),
];

impl Case {
    /// Least value of the function.
    pub fn minimum(&self) -> f64 {
        self.plain().minimum()
    }

    /// Half the width of the box in every coordinate.
    pub fn half_width(&self) -> f64 {
        self.plain().half_width()
    }

    /// Problem of one run.
    pub fn problem<T: Real>(&self, seed: ReportSeed) -> Problem<T> {
        let motion =
            self.is_moved.then(|| Motion::random(self.dimension, self.half_width() / 2.0, seed.problem()));
        Problem { plain: self.plain(), motion }
    }

    fn plain(&self) -> TestProblem {
        TestProblem::new(self.function, self.dimension)
    }
}

/// Test function of one run.
#[derive(Clone, Debug)]
pub struct Problem<T> {
    plain: TestProblem,
    motion: Option<Motion<T>>,
}

#[derive(Clone, Debug)]
struct Motion<T> {
    centre: Vec<T>,
    /// Rows of an orthogonal matrix.
    rows: Vec<Vec<T>>,
}

impl<T: Real> Motion<T> {
    fn random(dimension: usize, reach: f64, seed: u64) -> Self {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let uniform = rand_distr::StandardUniform;
        let centre = (0..dimension)
            .map(|_| {
                let share: f64 = uniform.sample(&mut random);
                T::from_double(reach * (2.0 * share - 1.0))
            })
            .collect();
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(dimension);
        while rows.len() < dimension {
            let mut row: Vec<f64> = (0..dimension).map(|_| StandardNormal.sample(&mut random)).collect();
            // Repeated once: the second pass removes the rounding error of the first.
            for _ in 0..2 {
                for known in &rows {
                    let along = dot(known, &row);
                    row.iter_mut().zip(known).for_each(|(entry, known)| *entry -= along * known);
                }
                let length = dot(&row, &row).sqrt();
                row.iter_mut().for_each(|entry| *entry /= length);
            }
            rows.push(row);
        }
        let rows = rows.into_iter().map(|row| row.into_iter().map(T::from_double).collect()).collect();
        Self { centre, rows }
    }
}

impl<T: Real> Objective<T> for Problem<T> {
    fn dimension(&self) -> usize {
        Objective::<T>::dimension(&self.plain)
    }

    fn bounds(&self, coordinate: usize) -> (T, T) {
        self.plain.bounds(coordinate)
    }

    fn evaluate(&self, position: &[T]) -> T {
        let Some(motion) = &self.motion else { return self.plain.evaluate(position) };
        let mut moved = [T::zero(); MOST_COORDINATES];
        for (entry, row) in moved.iter_mut().zip(&motion.rows) {
            let terms = row.iter().zip(position).zip(&motion.centre);
            *entry = terms.fold(T::zero(), |sum, ((&along, &x), &centre)| sum + along * (x - centre));
        }
        self.plain.evaluate(moved.get(..position.len()).unwrap_or(&moved))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moved_case() -> Case {
        CASES.into_iter().find(|case| case.is_moved && case.dimension == 30).expect("a moved case")
    }

    #[test]
    fn a_shifted_rotated_function_keeps_minimum_and_lengths_per_run() {
        let case = moved_case();
        let plain = TestProblem::new(TestFunction::Ackley, 30);
        let mut centres = Vec::new();
        for run in 0..5 {
            let problem = case.problem::<f64>(ReportSeed::from_run(run));
            let motion = problem.motion.as_ref().expect("a motion");
            assert!(motion.centre.iter().all(|entry| entry.abs() <= 16.0));
            // cancellation of 20 + e - 20 - e: a few units in the last place of 22
            assert!(problem.evaluate(&motion.centre).abs() < 1e-13);
            for (i, row) in motion.rows.iter().enumerate() {
                for (j, other) in motion.rows.iter().enumerate() {
                    let expected = if i == j { 1.0 } else { 0.0 };
                    assert!((dot(row, other) - expected).abs() < 1e-14, "rows {i} and {j}");
                }
            }
            // one step along a row is a step along an axis of the plain function
            let mut along = motion.centre.clone();
            along.iter_mut().zip(&motion.rows[3]).for_each(|(entry, row)| *entry += 9.0 * row);
            let mut axis = [0.0; 30];
            axis[3] = 9.0;
            let expected: f64 = plain.evaluate(&axis);
            assert!((problem.evaluate(&along) - expected).abs() < 1e-12);
            centres.push(motion.centre.clone());
        }
        assert!(centres.windows(2).all(|pair| pair[0] != pair[1]), "each run has a shift of its own");
    }

    #[test]
    fn both_precisions_have_the_same_problem() {
        let (single, double) = (
            moved_case().problem::<f32>(ReportSeed::from_run(7)),
            moved_case().problem::<f64>(ReportSeed::from_run(7)),
        );
        let difference = single.evaluate(&[3.5; 30]) - double.evaluate(&[3.5; 30]) as f32;
        // some thirty single-precision roundings of values of 20
        assert!(difference.abs() < 1e-4, "{difference}");
    }
}
