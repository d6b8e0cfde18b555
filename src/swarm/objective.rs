//! Interface of a search to its problem: a cost over a box.
//!
//! Why a trait: the swarm does not depend on the leg, nor the identification on the swarm.

use crate::real::{Real, is_finite};

/// A cost to minimise over a box, the only input of a search.
pub trait Objective<T: Real> {
    /// Number of coordinates, 1 to the capacity of the search.
    fn dimension(&self) -> usize;

    /// Lowest and highest value of a coordinate, in its own unit: finite, the lowest below the highest.
    fn bounds(&self, coordinate: usize) -> (T, T);

    /// Cost at a position of [`dimension`](Self::dimension) coordinates, always inside the box.
    ///
    /// A value that is not finite (or is the largest finite number) means "not possible": the candidate is
    /// dropped and the search goes on.
    fn evaluate(&self, position: &[T]) -> T;
}

impl<T: Real, O: Objective<T> + ?Sized> Objective<T> for &O {
    fn dimension(&self) -> usize {
        (**self).dimension()
    }
    fn bounds(&self, coordinate: usize) -> (T, T) {
        (**self).bounds(coordinate)
    }
    fn evaluate(&self, position: &[T]) -> T {
        (**self).evaluate(position)
    }
}

/// Reason why a search cannot begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SwarmError {
    /// The objective has no coordinate.
    NoDimension,
    /// The objective has more coordinates than the search's capacity.
    DimensionAboveCapacity {
        /// Coordinates of the objective.
        dimension: usize,
        /// Capacity of the search in coordinates.
        capacity: usize,
    },
    /// The bounds are not finite, too far apart for the precision, or not ascending.
    Bounds {
        /// Coordinate, counted from 0.
        coordinate: usize,
    },
    /// A setting is negative or not finite, or a divisor is zero.
    Setting(&'static str),
}

/// Checks a setting that must be finite and at least zero.
pub(super) fn not_negative<T: Real>(name: &'static str, value: T) -> Result<(), SwarmError> {
    if value >= T::zero() && is_finite(value) { Ok(()) } else { Err(SwarmError::Setting(name)) }
}

/// Checks a setting that must be finite and above zero.
pub(super) fn positive<T: Real>(name: &'static str, value: T) -> Result<(), SwarmError> {
    if value > T::zero() && is_finite(value) { Ok(()) } else { Err(SwarmError::Setting(name)) }
}
