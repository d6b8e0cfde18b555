//! Acceptance limits of a result.

use crate::ident::solve::search::LARGEST_EXCESS;
use crate::real::Real;

/// Limits of all tests, each with the reason for its default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds<T> {
    /// Fewest rows for each base parameter. Rows overlap; five each still leave a degree of freedom or more
    /// of the residual for each parameter.
    pub rows_per_parameter: u32,
    /// Least root mean square speed of every joint, rad/s. Below, the encoder's noise determines the sign of
    /// the speed, and Coulomb friction looks like an offset.
    pub smallest_speed: T,
    /// Largest pulse of a joint's speed at one count of its encoder, as a share of its root mean square
    /// speed. On simulated legs and arms with 10 to 14 bits sigma holds up to 0.19, the torque of arms is 3 %
    /// off at 0.23, and inertias are 14 % too small at 0.38.
    pub largest_pulse_share: T,
    /// Largest condition number of the scaled problem. Above, an error of 0.1 % in the rows
    /// moves the result by its size.
    pub largest_condition: T,
    /// Largest cost of the search's end above least squares, chi-square units. A quarter moves no parameter
    /// by more than half of its standard deviation; a converged search ends below 0.01.
    pub search_excess: T,
    /// Negative excess that a nonnegative quantity may have, in standard deviations.
    pub largest_negative_sigmas: T,
    /// Spreads of chi-square by which a consistent leg may be worse than least squares: five are not noise.
    pub largest_excess_spreads: T,
    /// Quantile of the standard normal distribution for all noise tests. Noise exceeds 5.2
    /// once in ten million. A run has some fifty such tests, so noise alone refuses less than
    /// one run in a hundred thousand.
    pub noise_quantile: T,
    /// Systematic error accepted on a held-out motion, as a share of the motion's root mean square torque.
    /// The servo's feedback makes up for 5 %; who uses the model otherwise states another share.
    pub accepted_error_share: T,
    /// Error added to the accepted one on the faster motion identified from, and to
    /// [`Self::largest_error_ratio`].
    pub error_margin_share: T,
    /// Largest error on a held-out motion over that on the training motion; two allows for friction that
    /// depends on speed and load. Infinite by default: limits follow from the noise. A replay sets it where
    /// noise does not explain the training error.
    pub largest_error_ratio: T,
    /// Whether held-out blocks with outliers are left out of the slow residual. Where noise does not explain
    /// the training error, the bound of an outlier is unknown.
    pub forgives_disturbances: bool,
    /// Largest error over all rows, excluded ones too, without a held-out motion: such a model explains
    /// about half of the power of the torque.
    pub largest_whole_error_share: T,
    /// Standard deviations of the parameters' uncertainty that a prediction may be off by: one recording is
    /// one draw of the parameters.
    pub uncertainty_sigmas: T,
    /// Largest uncertainty (one standard deviation) of a held-out torque due to the parameters, as a share of
    /// its root mean square. Beyond a third, three of them are as large as the torque itself.
    pub largest_uncertainty_share: T,
    /// Least share of inertia and friction in a joint's torque. A drive's own friction is more; a torque
    /// computed from the angle has none.
    pub smallest_dynamic_share: T,
    /// Tolerated relative error of a link's length, whatever its significance.
    pub largest_length_error: T,
    /// Tolerated error of an encoder's zero, rad, whatever its significance: 2 degrees, as a pose that is
    /// aligned by hand.
    pub largest_zero_error: T,
    /// Longest error in all joints at once, s: a push lasts half a second, a step on the floor longer.
    pub longest_disturbance_s: T,
    /// Largest share of samples that are outliers: a sensor with more needs repair.
    pub largest_replaced_share: T,
    /// Largest share of excluded rows: without a third of them the rest is a biased choice.
    pub largest_disturbed_share: T,
}

impl<T: Real> Default for Thresholds<T> {
    fn default() -> Self {
        Self {
            rows_per_parameter: 5,
            smallest_speed: T::from_double(0.05),
            largest_pulse_share: T::from_double(0.2),
            largest_condition: T::from_double(1000.0),
            search_excess: T::from_double(LARGEST_EXCESS),
            largest_negative_sigmas: T::from_double(3.0),
            largest_excess_spreads: T::from_double(5.0),
            noise_quantile: T::from_double(5.2),
            accepted_error_share: T::from_double(0.05),
            error_margin_share: T::from_double(0.05),
            largest_error_ratio: T::from_double(f64::INFINITY),
            forgives_disturbances: true,
            largest_whole_error_share: T::from_double(0.7),
            uncertainty_sigmas: T::from_double(3.0),
            largest_uncertainty_share: T::from_double(0.3),
            smallest_dynamic_share: T::from_double(0.02),
            largest_length_error: T::from_double(0.03),
            largest_zero_error: T::from_double(0.035),
            longest_disturbance_s: T::from_double(1.0),
            largest_replaced_share: T::from_double(0.1),
            largest_disturbed_share: T::from_double(1.0 / 3.0),
        }
    }
}

impl<T: Real> Thresholds<T> {
    /// Limit of chi-square with `freedom` degrees of freedom by chance: a number
    /// of its spreads above its mean.
    pub(crate) fn chance(&self, freedom: T) -> T {
        freedom + self.largest_excess_spreads * crate::real::sqrt(freedom + freedom)
    }

    /// Quantile of chi-square over its `freedom` degrees of freedom, at [`Self::noise_quantile`]: the limit
    /// by chance of a measured over an expected variance (Wilson and Hilferty 1931).
    pub(crate) fn variance_ratio(&self, freedom: T) -> T {
        let part = T::from_double(2.0 / 9.0) / crate::real::max(freedom, T::one());
        let root = T::one() - part + self.noise_quantile * crate::real::sqrt(part);
        root * root * root
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_ratio_is_the_tabulated_quantile_of_chi_square() {
        // Standard normal quantile 3.0902: probability 0.999. Tables: chi-square
        // 29.588 of 10, 149.449 of 100.
        let thresholds = Thresholds { noise_quantile: 3.090_2, ..Thresholds::<f64>::default() };
        for (freedom, tabulated) in [(10.0, 29.588), (100.0, 149.449)] {
            // Wilson and Hilferty's approximation is good to 0.6 % here.
            assert!((thresholds.variance_ratio(freedom) * freedom / tabulated - 1.0).abs() < 7e-3);
        }
    }
}
