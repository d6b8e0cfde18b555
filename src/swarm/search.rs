//! Common interface of the searches, and their progress: box, best value and counts.
//!
//! Why: three rules hold for every search, so they are written once. No evaluation leaves the box, a cost
//! that is not finite is dropped, and the best so far is available whenever a run is cancelled.
//!
//! Terms: searches work in box coordinates u, 0..1 per coordinate; the objective gets
//! x = low + (high - low) clip(u, 0, 1), limited to low..high once more against rounding.
//! Cost: 5 D operations per evaluation beside the objective's own; memory 3 D + 1 scalars.

use crate::real::{Real, clamp, is_finite};

use super::objective::{Objective, SwarmError};
use super::rows::{live, live_mut};

/// Best position evaluated so far, and its cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Best<'a, T> {
    /// Position in the objective's own units, one entry per coordinate.
    pub position: &'a [T],
    /// Cost at this position; finite.
    pub value: T,
}

/// A search that can be advanced in slices of any size.
///
/// Slicing never changes the result: `advance(60)` and sixty times `advance(1)` leave equal searches.
pub trait Search<T: Real> {
    /// Spends `evaluations` of the objective and returns how many were spent. That is all of them, or none if
    /// the objective's dimension has changed.
    fn advance(&mut self, objective: &impl Objective<T>, evaluations: u32) -> u32;

    /// Best so far; `None` until a finite cost was found.
    fn best(&self) -> Option<Best<'_, T>>;

    /// Completed iterations; the first evaluations of the scattered swarm are iteration 0.
    fn iterations(&self) -> u32;

    /// Number of evaluations so far.
    fn evaluations(&self) -> u32;

    /// Advances by whole iterations until the best is at most `goal` or `iterations` are
    /// complete; true if the goal was reached. The last iteration is completed, so that searches
    /// can be compared by their counts.
    fn reach(&mut self, objective: &impl Objective<T>, goal: T, iterations: u32) -> bool {
        while self.iterations() < iterations {
            let before = self.iterations();
            while self.iterations() == before {
                if self.advance(objective, 1) == 0 {
                    return false;
                }
            }
            if self.best().is_some_and(|best| best.value <= goal) {
                return true;
            }
        }
        false
    }
}

/// Box, best value and counts of one search.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SearchProgress<T, const D: usize> {
    dimension: usize,
    low: [T; D],
    high: [T; D],
    best_position: [T; D],
    /// The largest finite number until a smaller value was found.
    best_value: T,
    evaluations: u32,
    iterations: u32,
}

impl<T: Real, const D: usize> SearchProgress<T, D> {
    /// Reads and checks the objective's box.
    pub(crate) fn open(objective: &impl Objective<T>) -> Result<Self, SwarmError> {
        let dimension = objective.dimension();
        if dimension == 0 {
            return Err(SwarmError::NoDimension);
        }
        if dimension > D {
            return Err(SwarmError::DimensionAboveCapacity { dimension, capacity: D });
        }
        let mut progress = Self {
            dimension,
            low: [T::zero(); D],
            high: [T::zero(); D],
            best_position: [T::zero(); D],
            best_value: T::LARGEST,
            evaluations: 0,
            iterations: 0,
        };
        for (coordinate, (low, high)) in
            progress.low.iter_mut().zip(&mut progress.high).take(dimension).enumerate()
        {
            (*low, *high) = objective.bounds(coordinate);
            let finite = is_finite(*low) && is_finite(*high) && is_finite(*high - *low);
            if !finite || *low >= *high {
                return Err(SwarmError::Bounds { coordinate });
            }
        }
        Ok(progress)
    }

    /// Number of coordinates, 1..=D.
    pub(crate) fn dimension(&self) -> usize {
        self.dimension
    }

    /// True if an objective has the dimension that the search began with.
    pub(crate) fn accepts(&self, objective: &impl Objective<T>) -> bool {
        objective.dimension() == self.dimension
    }

    /// Converts box coordinates 0..1 to the objective's units; never outside the bounds.
    pub(crate) fn to_position(&self, point: &[T; D]) -> [T; D] {
        let mut position = *point;
        for ((entry, &low), &high) in position.iter_mut().zip(&self.low).zip(&self.high) {
            *entry = clamp(low + (high - low) * *entry, low, high);
        }
        position
    }

    /// Evaluates a point given in box coordinates.
    pub(crate) fn evaluate(&mut self, objective: &impl Objective<T>, point: &[T; D]) -> T {
        let position = self.to_position(point);
        self.evaluate_position(objective, position)
    }

    /// Point of the box nearest to a position, both in the objective's units.
    pub(crate) fn nearest(&self, mut position: [T; D]) -> [T; D] {
        for ((entry, &low), &high) in position.iter_mut().zip(&self.low).zip(&self.high) {
            *entry = clamp(*entry, low, high);
        }
        position
    }

    /// Evaluates a position in the box, from [`Self::to_position`] or [`Self::nearest`].
    ///
    /// Returns the largest finite number for a cost that is not finite: it sorts last and is never a best.
    pub(crate) fn evaluate_position(&mut self, objective: &impl Objective<T>, position: [T; D]) -> T {
        let value = objective.evaluate(live(&position, self.dimension));
        self.evaluations = self.evaluations.saturating_add(1);
        let value = if is_finite(value) { value } else { T::LARGEST };
        if value < self.best_value {
            self.best_value = value;
            live_mut(&mut self.best_position, self.dimension)
                .copy_from_slice(live(&position, self.dimension));
        }
        value
    }

    pub(crate) fn close_iteration(&mut self) {
        self.iterations = self.iterations.saturating_add(1);
    }

    pub(crate) fn best(&self) -> Option<Best<'_, T>> {
        (self.best_value < T::LARGEST)
            .then(|| Best { position: live(&self.best_position, self.dimension), value: self.best_value })
    }

    pub(crate) fn iterations(&self) -> u32 {
        self.iterations
    }

    pub(crate) fn evaluations(&self) -> u32 {
        self.evaluations
    }
}

/// True if a value returned by the progress was finite.
pub(super) fn is_usable<T: Real>(value: T) -> bool {
    value < T::LARGEST
}
