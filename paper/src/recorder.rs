//! Objective that counts its calls and stores when each goal was first met.
//!
//! Why: searches of several crates are compared by their evaluations, not by their own counters.
//! The first evaluation within the tolerance counts, whether of a whisker, a particle or a sample.
//! The driver of the search reports the iterations; initial evaluations are iteration 0.

use std::cell::{Cell, RefCell};

use scarab::real::Real;
use scarab::swarm::Objective;
use serde::{Deserialize, Serialize};

/// Time at which a goal was met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hit {
    /// Iteration in which the goal was met.
    pub iterations: u32,
    /// Evaluations up to and including the one that met the goal.
    pub evaluations: u32,
}

/// Counting wrapper of an objective.
#[derive(Debug)]
pub struct Recorder<'o, T, O> {
    objective: &'o O,
    /// Values to be reached, largest first.
    goals: Vec<T>,
    hits: RefCell<Vec<Hit>>,
    iteration: Cell<u32>,
    evaluations: Cell<u32>,
}

impl<'o, T: Real, O: Objective<T>> Recorder<'o, T, O> {
    /// Watches for values within these tolerances of the minimum, the largest tolerance first.
    pub fn new(objective: &'o O, minimum: f64, tolerances: &[f64]) -> Self {
        Self {
            objective,
            goals: tolerances.iter().map(|tolerance| T::from_double(minimum + tolerance)).collect(),
            hits: RefCell::default(),
            iteration: Cell::new(0),
            evaluations: Cell::new(0),
        }
    }

    /// Starts an iteration; all further evaluations belong to it.
    pub fn begin(&self, iteration: u32) {
        self.iteration.set(iteration);
    }

    /// Evaluations so far.
    pub fn evaluations(&self) -> u32 {
        self.evaluations.get()
    }

    /// Whether all goals were met.
    pub fn is_done(&self) -> bool {
        self.hits.borrow().len() == self.goals.len()
    }

    /// Smallest goal.
    pub fn last_goal(&self) -> Option<T> {
        self.goals.last().copied()
    }

    /// Time at which each goal was met.
    pub fn into_hits(self) -> Vec<Option<Hit>> {
        let mut hits: Vec<_> = self.hits.into_inner().into_iter().map(Some).collect();
        hits.resize(self.goals.len(), None);
        hits
    }
}

impl<T: Real, O: Objective<T>> Objective<T> for Recorder<'_, T, O> {
    fn dimension(&self) -> usize {
        self.objective.dimension()
    }

    fn bounds(&self, coordinate: usize) -> (T, T) {
        self.objective.bounds(coordinate)
    }

    fn evaluate(&self, position: &[T]) -> T {
        let value = self.objective.evaluate(position);
        self.evaluations.set(self.evaluations.get().saturating_add(1));
        let mut hits = self.hits.borrow_mut();
        while self.goals.get(hits.len()).is_some_and(|goal| value <= *goal) {
            hits.push(Hit { iterations: self.iteration.get(), evaluations: self.evaluations.get() });
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Coordinate;

    impl Objective<f64> for Coordinate {
        fn dimension(&self) -> usize {
            1
        }
        fn bounds(&self, _coordinate: usize) -> (f64, f64) {
            (0.0, 10.0)
        }
        fn evaluate(&self, position: &[f64]) -> f64 {
            position[0]
        }
    }

    #[test]
    fn the_first_evaluation_within_each_tolerance_counts() {
        let recorder = Recorder::new(&Coordinate, 1.0, &[0.5, 0.1, 0.01]);
        for (iteration, value) in [(0, 3.0), (0, 1.5), (1, 1.4), (1, 1.6), (2, 1.05), (3, 1.05)] {
            recorder.begin(iteration);
            recorder.evaluate(&[value]);
        }
        assert!(!recorder.is_done());
        let expected =
            [Some(Hit { iterations: 0, evaluations: 2 }), Some(Hit { iterations: 2, evaluations: 5 }), None];
        assert_eq!(recorder.into_hits(), expected);
    }
}
