//! Row arithmetic of the searches: the used part of a row, row plus a multiple of another.
//!
//! Why not matrices of the linear algebra library: the dimension is known at run time only and is usually
//! below the capacity. Loops over the used part have the cost of the problem, not of the capacity.

use crate::real::{Real, clamp};

/// First `dimension` entries of a row (all of it if the dimension exceeds it).
pub(super) fn live<T, const D: usize>(row: &[T; D], dimension: usize) -> &[T] {
    &row[..dimension.min(D)]
}

/// First `dimension` entries of a row, mutable.
pub(super) fn live_mut<T, const D: usize>(row: &mut [T; D], dimension: usize) -> &mut [T] {
    &mut row[..dimension.min(D)]
}

/// `target += factor * row`.
pub(super) fn add_scaled<T: Real>(target: &mut [T], factor: T, row: &[T]) {
    for (entry, &value) in target.iter_mut().zip(row) {
        *entry += factor * value;
    }
}

/// `row *= factor`.
pub(super) fn scale<T: Real>(row: &mut [T], factor: T) {
    for entry in row {
        *entry *= factor;
    }
}

/// `value` limited to 0..=1.
pub(super) fn clip_to_box<T: Real>(value: T) -> T {
    clamp(value, T::zero(), T::one())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::dot;

    #[test]
    fn only_the_live_part_of_a_row_is_touched() {
        let mut row = [1.0, 2.0, 3.0];
        scale(live_mut(&mut row, 2), 2.0);
        add_scaled(live_mut(&mut row, 2), 1.0, &[1.0, 1.0, 1.0]);
        assert_eq!(row, [3.0, 5.0, 3.0]);
        assert_eq!(dot(live(&row, 2), live(&row, 9)), 34.0);
    }
}
