//! What a search sees of the world: a cost over a box.
//!
//! Why a trait: the swarm must not know a leg, and the identification must not know a beetle.

use crate::real::{Real, is_finite};

/// A cost to be minimised over a box. It knows no leg, and a search knows nothing else of it.
pub trait Objective<T: Real> {
    /// Number of coordinates, 1 to the capacity of the search.
    fn dimension(&self) -> usize;

    /// Lowest and highest value of a coordinate, in its own unit: finite, the lowest below the highest.
    fn bounds(&self, coordinate: usize) -> (T, T);

    /// Cost at a position of [`dimension`](Self::dimension) coordinates, always inside the box.
    ///
    /// A value that is not finite (or is the largest finite number) says "not possible": the candidate is
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

/// Why a search cannot begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SwarmError {
    /// The objective has no coordinate.
    NoDimension,
    /// The objective has more coordinates than the search has room for.
    DimensionAboveCapacity {
        /// Coordinates of the objective.
        dimension: usize,
        /// Coordinates the search has room for.
        capacity: usize,
    },
    /// Bounds that are not finite, too far apart for the precision, or whose lowest is not below the highest.
    Bounds {
        /// The coordinate, counted from 0.
        coordinate: usize,
    },
    /// A setting that is negative or not finite, or a divisor that is zero.
    Setting(&'static str),
}

/// A setting that must be finite and at least zero.
pub(super) fn not_negative<T: Real>(name: &'static str, value: T) -> Result<(), SwarmError> {
    if value >= T::zero() && is_finite(value) { Ok(()) } else { Err(SwarmError::Setting(name)) }
}

/// A setting that must be finite and above zero.
pub(super) fn positive<T: Real>(name: &'static str, value: T) -> Result<(), SwarmError> {
    if value > T::zero() && is_finite(value) { Ok(()) } else { Err(SwarmError::Setting(name)) }
}
