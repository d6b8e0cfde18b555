//! What a result must keep to be accepted.

use crate::real::Real;

/// Limits of all tests; each with the reason for its default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds<T> {
    /// Rows for each base parameter, at least: with five rows each, overlapping as they do, the residual still has
    /// a degree of freedom or more for each parameter.
    pub rows_per_parameter: u32,
    /// Root mean square speed of every joint, rad/s: below, the sign of the speed is the encoder's noise and
    /// Coulomb friction cannot be told from an offset.
    pub smallest_speed: T,
    /// Condition number of the scaled problem: above, an error of 0.1 % in the rows moves the result by its size.
    pub largest_condition: T,
    /// Standard deviations by which a quantity that cannot be negative may be so.
    pub largest_negative_sigmas: T,
    /// Spreads of chi-square by which a leg that can exist may be worse than least squares: five are not noise.
    pub largest_excess_spreads: T,
    /// Quantile of the standard normal distribution at which noise is no longer believed: 5.2 is passed once in ten
    /// million, and some fifty such tests are made of a run, so that noise refuses less than one run in a hundred
    /// thousand.
    pub noise_quantile: T,
    /// Where the noise is not known (samples put on another grid), error on an unused motion over that on the training
    /// motion: noise alone gives one; twice leaves room for friction that depends on speed and load.
    pub largest_error_ratio: T,
    /// Systematic error on an unused motion that is never held against a model, as a share of the motion's root mean
    /// square torque: what a servo's feedback makes up for.
    pub harmless_error_share: T,
    /// The same on the motion identified from, which is faster; only where the noise is known.
    pub largest_misfit_share: T,
    /// Error that is never accepted, as a share of the motion's root mean square torque: such a model explains less
    /// than half of the power of the torque.
    pub largest_error_share: T,
    /// Uncertainty (one standard deviation) of a held-out torque that the parameters leave, as a share of its root mean
    /// square: beyond a third three of them are as large as the torque itself.
    pub largest_uncertainty_share: T,
    /// Share of a joint's torque that inertia and friction make, at least: a drive's own friction is more; a torque
    /// computed from the angle has none.
    pub smallest_dynamic_share: T,
    /// Share by which a link may seem longer or shorter than believed, whatever the significance.
    pub largest_length_error: T,
    /// Angle by which an encoder's zero may seem off, rad, whatever the significance.
    pub largest_zero_error: T,
    /// Time for which all joints may miss together, s: a push lasts half a second, a step on the floor longer.
    pub longest_disturbance_s: T,
    /// Share of samples that may be wild: a sensor that is wrong more often is to be mended.
    pub largest_replaced_share: T,
    /// Share of rows that may be set aside: with a third of them gone nobody knows what the rest was chosen for.
    pub largest_disturbed_share: T,
}

impl<T: Real> Default for Thresholds<T> {
    fn default() -> Self {
        Self {
            rows_per_parameter: 5,
            smallest_speed: T::of(0.05),
            largest_condition: T::of(1000.0),
            largest_negative_sigmas: T::of(3.0),
            largest_excess_spreads: T::of(5.0),
            noise_quantile: T::of(5.2),
            largest_error_ratio: T::of(2.0),
            harmless_error_share: T::of(0.05),
            largest_misfit_share: T::of(0.10),
            largest_error_share: T::of(0.7),
            largest_uncertainty_share: T::of(0.3),
            smallest_dynamic_share: T::of(0.02),
            largest_length_error: T::of(0.03),
            largest_zero_error: T::of(0.026),
            longest_disturbance_s: T::of(1.0),
            largest_replaced_share: T::of(0.1),
            largest_disturbed_share: T::of(1.0 / 3.0),
        }
    }
}

impl<T: Real> Thresholds<T> {
    /// What chi-square of `freedom` degrees of freedom does not exceed by chance: so many of its spreads above its mean.
    #[must_use]
    pub fn chance(&self, freedom: T) -> T {
        freedom + self.largest_excess_spreads * crate::real::sqrt(freedom + freedom)
    }

    /// Quantile of chi-square over its `freedom` degrees of freedom, at [`Self::noise_quantile`]: what the ratio of a
    /// measured to an expected variance does not exceed by chance (Wilson and Hilferty 1931).
    #[must_use]
    pub fn variance_ratio(&self, freedom: T) -> T {
        let part = T::of(2.0 / 9.0) / crate::real::max(freedom, T::one());
        let root = T::one() - part + self.noise_quantile * crate::real::sqrt(part);
        root * root * root
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_ratio_is_the_tabulated_quantile_of_chi_square() {
        // Standard normal quantile 3.0902: probability 0.999. Tables: chi-square 29.588 of 10, 149.449 of 100.
        let thresholds = Thresholds { noise_quantile: 3.090_2, ..Thresholds::<f64>::default() };
        for (freedom, tabulated) in [(10.0, 29.588), (100.0, 149.449)] {
            // Wilson and Hilferty's approximation is good to 0.6 % here.
            assert!((thresholds.variance_ratio(freedom) * freedom / tabulated - 1.0).abs() < 7e-3);
        }
    }
}
