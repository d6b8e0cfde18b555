//! Looks at held-out motions while they stream by: residual in order of time, and what it asks for.
//!
//! Fed beside the recorder with what each sample brought; see [`Residual`] and [`Alignment`] for what comes out.

use super::alignment::Alignment;
use super::record::{Progress, RowModel};
use super::residual::Residual;
use crate::real::Real;

/// A known model held against motions that it was not identified from.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOut<T, const N: usize, const B: usize, const PENDING: usize> {
    values: [T; B],
    wild: [T; N],
    reach: usize,
    residual: Residual<T, N>,
    alignment: Alignment<T, N, B, PENDING>,
}

impl<T: Real, const N: usize, const B: usize, const PENDING: usize> HeldOut<T, N, B, PENDING> {
    /// Nothing seen; `reach` is that of the recorder's low-pass.
    #[must_use]
    pub fn new(reach: usize) -> Self {
        Self {
            values: [T::zero(); B],
            wild: [T::LARGEST; N],
            reach,
            residual: Residual::new(),
            alignment: Alignment::new(),
        }
    }

    /// Forgets all motions.
    pub fn clear(&mut self) {
        self.residual = Residual::new();
        self.alignment.clear();
    }

    /// The next motion begins: held against base `values`; a row that misses by more than `wild` N m is unexpected. `noise` is
    /// the standard deviation of an independent row of each joint, N m; columns that were `dropped` are not estimated.
    pub fn begin(&mut self, values: &[T; B], wild: &[T; N], noise: &[T; N], dropped: &[bool; B]) {
        (self.values, self.wild) = (*values, *wild);
        self.residual = Residual::new();
        self.alignment.begin(wild, noise, dropped);
    }

    /// The samples that follow do not continue those before.
    pub fn break_off(&mut self) {
        self.residual.break_off();
        self.alignment.break_off();
    }

    /// Takes what one sample brought.
    pub fn take(&mut self, model: &RowModel<T, N, B>, progress: &Progress<T, N, B>) {
        let rows = progress.rows.as_ref();
        self.alignment.take(model, &self.values, self.reach, &progress.instant, rows);
        if let Some(rows) = rows {
            self.residual.take(rows, &self.values, &self.wild);
        }
    }

    /// Of the motion that began last.
    #[must_use]
    pub fn residual(&self) -> &Residual<T, N> {
        &self.residual
    }

    /// Of all motions.
    #[must_use]
    pub fn alignment(&self) -> &Alignment<T, N, B, PENDING> {
        &self.alignment
    }
}
