//! Checks held-out motions while they stream by: residual in order of time, and geometry errors.
//!
//! Fed beside the recorder with the progress of each sample; see [`Residual`] and
//! [`Alignment`] for the results.

use super::alignment::Alignment;
use super::residual::Residual;
use crate::ident::record::recorder::Progress;
use crate::ident::record::row_model::RowModel;
use crate::real::Real;

/// A known model tested on motions that the identification did not use.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldOut<T, const N: usize, const B: usize, const PENDING: usize> {
    values: [T; B],
    outlier_bound: [T; N],
    reach: usize,
    residual: Residual<T, N>,
    alignment: Alignment<T, N, B, PENDING>,
}

impl<T: Real, const N: usize, const B: usize, const PENDING: usize> HeldOut<T, N, B, PENDING> {
    /// Starts without data; `reach` is that of the recorder's low-pass.
    pub fn new(reach: usize) -> Self {
        Self {
            values: [T::zero(); B],
            outlier_bound: [T::LARGEST; N],
            reach,
            residual: Residual::new(),
            alignment: Alignment::new(),
        }
    }

    /// Discards all motions.
    pub fn clear(&mut self) {
        self.residual = Residual::new();
        self.alignment.clear();
    }

    /// Starts the next motion, tested against base `values`. A residual above `outlier_bound` (N m) is
    /// unexpected; `noise` is the standard deviation of an independent row of each joint, N m. Columns that
    /// were `dropped` are not estimated.
    pub fn begin(&mut self, values: &[T; B], outlier_bound: &[T; N], noise: &[T; N], dropped: &[bool; B]) {
        (self.values, self.outlier_bound) = (*values, *outlier_bound);
        self.residual = Residual::new();
        self.alignment.begin(outlier_bound, noise, dropped);
    }

    /// Ends a continuous stretch of samples.
    pub fn break_off(&mut self) {
        self.residual.break_off();
        self.alignment.break_off();
    }

    /// Takes the progress of one sample.
    pub fn take(&mut self, model: &RowModel<T, N, B>, progress: &Progress<T, N, B>) {
        let rows = progress.rows.as_ref();
        self.alignment.take(model, &self.values, self.reach, &progress.instant, rows);
        if let Some(rows) = rows {
            self.residual.take(rows, &self.values, &self.outlier_bound);
        }
    }

    /// Residual of the latest motion.
    pub fn residual(&self) -> &Residual<T, N> {
        &self.residual
    }

    /// Geometry errors over all motions.
    pub fn alignment(&self) -> &Alignment<T, N, B, PENDING> {
        &self.alignment
    }
}
