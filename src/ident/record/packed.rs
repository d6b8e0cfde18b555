//! Triangular factors of a few columns, packed into a slice of numbers.
//!
//! ```text
//! row c:  r[c][c] .. r[c][n-1]  z[c]        c = 0 .. n-1, one after the other; then the residual
//! sum over rows (y p - t)^2 = |R p - z|^2 + residual
//! ```
//!
//! A variant of [`super::factor`] without the zeros below the diagonal, with only the columns
//! present. A window of many small factors needs less than half of the memory. A row is `n`
//! columns and the right-hand side.
//!
//! Memory: `n (n + 3) / 2 + 1` numbers. Cost of one row: about `2 n^2` multiplications and `n` square roots.

use crate::real::{self, Real};

/// Most columns of a packed factor.
pub const LARGEST_COLUMNS: usize = 32;
/// A row with its right-hand side.
pub type Row<T> = [T; LARGEST_COLUMNS + 1];

/// Length of a factor of `columns`, in numbers.
pub const fn size(columns: usize) -> usize {
    columns * (columns + 3) / 2 + 1
}

/// Length of the largest factor, in numbers.
pub const LARGEST_SIZE: usize = size(LARGEST_COLUMNS);

/// Takes one row; overwrites `row`.
pub fn rotate<T: Real>(factor: &mut [T], columns: usize, row: &mut Row<T>) {
    let mut rest = factor;
    for column in 0..columns.min(LARGEST_COLUMNS) {
        let Some((stored, below)) = rest.split_at_mut_checked(columns - column + 1) else { return };
        rest = below;
        let Some(entering) = row.get_mut(column..=columns) else { return };
        let (Some((diagonal, stored)), Some((first, entering))) =
            (stored.split_first_mut(), entering.split_first_mut())
        else {
            return;
        };
        let first = *first;
        if first == T::zero() {
            continue;
        }
        let length = real::sqrt(*diagonal * *diagonal + first * first);
        if !(length > T::zero()) {
            continue; // squares that underflow carry no information
        }
        let (cosine, sine) = (*diagonal / length, first / length);
        for (old, new) in stored.iter_mut().zip(entering) {
            (*old, *new) = (cosine * *old + sine * *new, cosine * *new - sine * *old);
        }
        *diagonal = length;
    }
    if let (Some(residual), Some(&right)) = (rest.first_mut(), row.get(columns)) {
        *residual += right * right;
    }
}

/// Rows of a factor, each as its first column and its entries from there on, the right-hand side last.
pub fn rows<T: Real>(factor: &[T], columns: usize) -> impl Iterator<Item = (usize, &[T])> {
    let mut rest = factor;
    (0..columns).map_while(move |column| {
        let (row, below) = rest.split_at_checked(columns - column + 1)?;
        rest = below;
        Some((column, row))
    })
}

/// Residual sum of squares at the least-squares optimum.
pub(crate) fn residual<T: Real>(factor: &[T], columns: usize) -> T {
    factor.get(size(columns) - 1).copied().unwrap_or(T::zero())
}

/// Takes all rows of another factor with the same columns, each multiplied by `weight`.
pub fn merge<T: Real>(factor: &mut [T], other: &[T], columns: usize, weight: T) {
    for (column, stored) in rows(other, columns) {
        let mut row = [T::zero(); LARGEST_COLUMNS + 1];
        for (slot, &element) in row.iter_mut().skip(column).zip(stored) {
            *slot = element * weight;
        }
        rotate(factor, columns, &mut row);
    }
    if let Some(sum) = factor.get_mut(size(columns) - 1) {
        *sum += residual(other, columns) * weight * weight;
    }
}

/// `|R p - z|^2 + residual`: sum of squares with these parameters.
pub(crate) fn cost<T: Real>(factor: &[T], columns: usize, parameters: &[T]) -> T {
    let mut total = residual(factor, columns);
    for (column, row) in rows(factor, columns) {
        let Some((right, elements)) = row.split_last() else { continue };
        let mut error = -*right;
        for (&element, &parameter) in elements.iter().zip(parameters.iter().skip(column)) {
            error += element * parameter;
        }
        total += error * error;
    }
    total
}

/// Least squares by back substitution; a column without information gives zero. A column counts as one
/// without information if its independent part is at most `share` of its length.
pub fn solve<T: Real>(factor: &[T], columns: usize, share: T) -> [T; LARGEST_COLUMNS] {
    let mut parameters = [T::zero(); LARGEST_COLUMNS];
    let mut lengths = [T::zero(); LARGEST_COLUMNS];
    for (column, row) in rows(factor, columns) {
        for (length, &element) in lengths.iter_mut().skip(column).zip(row.iter().take(columns - column)) {
            *length += element * element;
        }
    }
    for column in (0..columns.min(LARGEST_COLUMNS)).rev() {
        let start = column * (columns + 1) - column * column.saturating_sub(1) / 2;
        let Some(row) = factor.get(start..start + columns - column + 1) else { continue };
        let Some((&right, elements)) = row.split_last() else { continue };
        let mut rest = right;
        for (&element, &parameter) in elements.iter().zip(parameters.iter().skip(column)).skip(1) {
            rest -= element * parameter;
        }
        if let Some(&diagonal) = elements.first()
            && real::abs(diagonal) > share * real::sqrt(lengths[column])
        {
            parameters[column] = rest / diagonal;
        }
    }
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ident::record::factor::Factor;

    #[test]
    fn a_packed_factor_is_the_factor_without_its_zeros() {
        let mut full = Factor::<f64, 5>::new();
        let (mut packed, mut half) = ([0.0_f64; size(5)], [0.0_f64; size(5)]);
        for index in 0..40_u32 {
            let wave = |rate: f64| real::sin_cos(rate * f64::from(index)).0;
            let row = [wave(0.3), wave(1.1), wave(0.7), 1.0, wave(2.3)];
            full.insert(&row, wave(0.9));
            let mut long = [0.0; LARGEST_COLUMNS + 1];
            long[..5].copy_from_slice(&row);
            long[5] = wave(0.9);
            rotate(if index < 20 { &mut packed } else { &mut half }, 5, &mut long);
        }
        merge(&mut packed, &half, 5, 1.0);
        let (one, other) = (full.solve(5), solve(&packed, 5, 1e-9));
        let parameters = [0.3, -0.1, 0.2, 0.5, 0.7];
        // Forty rows of size one in double precision.
        for (left, right) in one.iter().zip(&other) {
            assert!((left - right).abs() < 1e-12, "{left} {right}");
        }
        let expected = full.excess(&parameters) + full.residual();
        assert!((cost(&packed, 5, &parameters) - expected).abs() < 1e-11);
        assert!((residual(&packed, 5) - full.residual()).abs() < 1e-12);
        assert_eq!(rows(&packed, 5).map(|(_, row)| row.len()).sum::<usize>() + 1, size(5));
    }
}
