//! Square-root information factor: all rows of a least-squares problem in constant memory.
//!
//! ```text
//! sum over rows (y p - t)^2 = |R p - z|^2 + residual,     R upper triangular
//! ```
//!
//! Givens rotations enter each row into `R` (Golub and Van Loan, Matrix Computations, 5.1.8). The cost of any
//! parameter vector is then exact and independent of the number of rows. One factor fed for hours in single
//! precision loses accuracy (a diagonal of 1e3 swallows rows of 1). A motion is therefore recorded in small
//! factors, merged with factors of similar size (`window`), so that only numbers of similar size are added.
//!
//! Cost of one row: about `2 B^2` multiplications and `B` square roots. Memory: `B (B + 1) + 2` numbers a
//! factor.

use crate::real::{self, Real};

/// Upper-triangular factor of up to `B` columns with its right-hand side.
#[derive(Clone, Debug, PartialEq)]
pub struct Factor<T, const B: usize> {
    /// `r[row][column]`, zero below the diagonal.
    r: [[T; B]; B],
    z: [T; B],
    residual: T,
    rows: u32,
}

impl<T: Real, const B: usize> Factor<T, B> {
    /// An empty factor.
    pub fn new() -> Self {
        Self { r: [[T::zero(); B]; B], z: [T::zero(); B], residual: T::zero(), rows: 0 }
    }

    /// Takes one row of the equation `row . parameters = right`.
    pub fn insert(&mut self, row: &[T; B], right: T) {
        self.rotate(*row, right);
        self.rows = self.rows.saturating_add(1);
    }

    /// Takes one row of a factor made elsewhere, without counting it.
    pub(in crate::ident) fn absorb(&mut self, row: &[T; B], right: T) {
        self.rotate(*row, right);
    }

    /// Adds the residual sum of squares that belongs to absorbed rows.
    pub(super) fn add_residual(&mut self, residual: T) {
        self.residual += residual;
    }

    /// Sets the number of rows that the factor represents.
    pub(super) fn set_rows(&mut self, rows: u32) {
        self.rows = rows;
    }

    /// Takes all rows of another factor.
    pub fn merge(&mut self, other: &Self) {
        self.merge_scaled(other, T::one());
    }

    /// Takes all rows of another factor, each multiplied by `weight`.
    #[inline(never)]
    pub(crate) fn merge_scaled(&mut self, other: &Self, weight: T) {
        for (row, &right) in other.r.iter().zip(&other.z) {
            let mut scaled = *row;
            for element in &mut scaled {
                *element *= weight;
            }
            self.rotate(scaled, right * weight);
        }
        self.residual += other.residual * weight * weight;
        self.rows = self.rows.saturating_add(other.rows);
    }

    #[inline(never)]
    fn rotate(&mut self, mut row: [T; B], mut right: T) {
        for column in 0..B {
            let entering = row[column];
            if entering == T::zero() {
                continue;
            }
            let diagonal = self.r[column][column];
            let length = real::sqrt(diagonal * diagonal + entering * entering);
            if !(length > T::zero()) {
                continue; // squares that underflow carry no information
            }
            let (cosine, sine) = (diagonal / length, entering / length);
            let stored = &mut self.r[column];
            stored[column] = length;
            for (old, new) in stored.iter_mut().zip(row.iter_mut()).skip(column + 1) {
                (*old, *new) = (cosine * *old + sine * *new, cosine * *new - sine * *old);
            }
            let z = self.z[column];
            self.z[column] = cosine * z + sine * right;
            right = cosine * right - sine * z;
        }
        self.residual += right * right;
    }

    /// `|R p - z|^2`: the cost above the least-squares optimum. Missing `parameters` count as zero.
    pub fn excess(&self, parameters: &[T]) -> T {
        let count = parameters.len().min(B);
        let mut total = T::zero();
        for (index, (row, &right)) in self.r.iter().zip(&self.z).enumerate().take(count) {
            let mut error = -right;
            for (&element, &parameter) in row.iter().zip(parameters).skip(index) {
                error += element * parameter;
            }
            total += error * error;
        }
        total
    }

    /// Converts to another precision.
    pub fn convert<U: Real>(&self) -> Factor<U, B> {
        // Element by element: the compiler expands a large array by value at great cost.
        let mut converted = Factor::new();
        for (to, from) in converted.r.iter_mut().flatten().zip(self.r.iter().flatten()) {
            *to = U::from_double(from.to_double());
        }
        for (to, from) in converted.z.iter_mut().zip(&self.z) {
            *to = U::from_double(from.to_double());
        }
        converted.residual = U::from_double(self.residual.to_double());
        converted.rows = self.rows;
        converted
    }

    /// Residual sum of squares at the least-squares optimum.
    pub fn residual(&self) -> T {
        self.residual
    }

    /// The triangular matrix, `[row][column]`.
    pub fn triangle(&self) -> &[[T; B]; B] {
        &self.r
    }

    /// The rotated right-hand side.
    pub fn right(&self) -> &[T; B] {
        &self.z
    }

    /// Euclidean length of one column of all rows taken.
    pub fn column_length(&self, column: usize) -> T {
        real::sqrt(
            self.r
                .iter()
                .filter_map(|row| row.get(column))
                .fold(T::zero(), |sum, &element| sum + element * element),
        )
    }

    /// Restricts the problem: only `columns` are free, the others are held at `fixed`. Column `i` of the
    /// result is `columns[i]`.
    #[inline(never)]
    pub(crate) fn restricted(&self, columns: &[usize], fixed: &[T; B], weight: T) -> Self {
        let mut result = Self::new();
        for (row, &right) in self.r.iter().zip(&self.z) {
            let mut compact = [T::zero(); B];
            let mut rest = right;
            for (&element, &value) in row.iter().zip(fixed) {
                rest -= element * value;
            }
            for (slot, &column) in compact.iter_mut().zip(columns) {
                let (element, value) = (row.get(column), fixed.get(column));
                *slot = element.copied().unwrap_or(T::zero()) * weight;
                // A free column is not held: give back what the loop above subtracted.
                rest += element.copied().unwrap_or(T::zero()) * value.copied().unwrap_or(T::zero());
            }
            result.rotate(compact, rest * weight);
        }
        result.residual += self.residual * weight * weight;
        result.rows = self.rows;
        result
    }

    /// Holds these columns at zero; the other columns keep their index.
    #[inline(never)]
    pub(crate) fn without(&self, columns: &[bool; B]) -> Self {
        let mut result = Self::new();
        for (row, &right) in self.r.iter().zip(&self.z) {
            let mut rest = *row;
            for (element, &left_out) in rest.iter_mut().zip(columns) {
                if left_out {
                    *element = T::zero();
                }
            }
            result.rotate(rest, right);
        }
        result.residual += self.residual;
        result.rows = self.rows;
        result
    }

    /// Rows of this factor with zero on the right.
    pub(crate) fn without_right(&self) -> Self {
        Self { z: [T::zero(); B], residual: T::zero(), ..self.clone() }
    }

    /// Rows of this factor with each right-hand side times `scale`, less the row times `shift`.
    pub(crate) fn with_right(&self, scale: T, shift: &[T; B]) -> Self {
        let mut result = self.clone();
        for (right, row) in result.z.iter_mut().zip(&self.r) {
            *right *= scale;
            for (&element, &value) in row.iter().zip(shift) {
                *right -= element * value;
            }
        }
        result.residual = self.residual * scale * scale;
        result
    }

    /// Back substitution: the least-squares parameters of the first `count` columns; a column without
    /// information gives zero.
    #[inline(never)]
    pub fn solve(&self, count: usize) -> [T; B] {
        let mut parameters = [T::zero(); B];
        for index in (0..count.min(B)).rev() {
            let mut rest = self.z[index];
            for column in index + 1..count.min(B) {
                rest -= self.r[index][column] * parameters[column];
            }
            let diagonal = self.r[index][index];
            if diagonal != T::zero() {
                parameters[index] = rest / diagonal;
            }
        }
        parameters
    }

    /// `R^-1` of the first `count` columns (upper triangular), zero where a diagonal is zero.
    #[inline(never)]
    pub(crate) fn inverse(&self, count: usize) -> [[T; B]; B] {
        let count = count.min(B);
        let mut inverse = [[T::zero(); B]; B];
        for column in 0..count {
            for row in (0..=column).rev() {
                let mut rest = if row == column { T::one() } else { T::zero() };
                for inner in row + 1..=column {
                    rest -= self.r[row][inner] * inverse[inner][column];
                }
                let diagonal = self.r[row][row];
                inverse[row][column] = if diagonal == T::zero() { T::zero() } else { rest / diagonal };
            }
        }
        inverse
    }
}
