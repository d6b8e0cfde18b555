//! Reference from an accepted identification to monitor later motion: values, covariance, noise of a row.
//!
//! Why not the model alone: a residual is too large only relative to the noise at the time of acceptance, and
//! to the model's own uncertainty.
//!
//! ```text
//! r = tau_f - y_f beta                                     residual of one filtered row
//! e^2 = r^2 / (sigma_i^2 + y_f Cov y_f')                   its expectation is 1 while nothing has changed
//! sigma_i^2 = largest mean square residual of joint i among the motion identified from and those predicted
//! ```
//!
//! The largest, because an accepted model has some misfit beyond noise (friction that depends on more than
//! speed), and that misfit is not a change. The motion identified from contributes its unbiased variance, see
//! [`crate::ident::solve::estimate`].
//! Cost of a row: `B^2 + 2 B` multiplications. Memory: `B^2 + B + N + 1` numbers and `B` flags.

use crate::ident::record::motion_record::Record;
use crate::ident::record::rows::FilteredRows;
use crate::ident::solve::estimate::{Estimate, noise};
use crate::real::{self, Real};

/// An accepted model as the reference for later motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Baseline<T, const N: usize, const B: usize> {
    /// Base values and their covariance.
    pub(crate) estimate: Estimate<T, B>,
    /// Variance of one filtered row of each joint, (N m)^2.
    pub row_variance: [T; N],
    /// Information of one row in units of independent ones.
    pub(crate) row_information: T,
}

impl<T: Real, const N: usize, const B: usize> Baseline<T, N, B> {
    /// Builds the reference from the estimate, its record and the records that it was tested on.
    pub fn new<'a>(
        estimate: Estimate<T, B>,
        training: &Record<T, N, B>,
        others: impl Iterator<Item = &'a Record<T, N, B>>,
    ) -> Self {
        let row_information = training.row_information;
        let mut row_variance = noise(training).map(|sigma| sigma * sigma * row_information);
        for record in others {
            for (joint, variance) in row_variance.iter_mut().enumerate() {
                let error = record.torque_error(joint, &estimate.values).unwrap_or(T::zero());
                *variance = real::max(*variance, error * error);
            }
        }
        Self { estimate, row_variance, row_information }
    }

    /// Standard deviation of one independent row of a joint, N m: the weight that
    /// [`crate::ident::solve::estimate::Problem`] uses.
    pub fn noise(&self, joint: usize) -> T {
        let variance = self.row_variance.get(joint).copied().unwrap_or(T::one());
        real::sqrt(variance / real::max(self.row_information, T::from_double(1e-3)))
    }

    /// Normalised square `e^2` of one joint's residual.
    pub(crate) fn normalised_square(&self, rows: &FilteredRows<T, N, B>, joint: usize) -> T {
        let (Some(row), Some(&torque), Some(&variance)) =
            (rows.regressor.get(joint), rows.torque.get(joint), self.row_variance.get(joint))
        else {
            return T::zero();
        };
        let residual = torque - real::dot(row, &self.estimate.values);
        let unknown = self.estimate.sigma_of(row);
        residual * residual / (variance + unknown * unknown)
    }
}
