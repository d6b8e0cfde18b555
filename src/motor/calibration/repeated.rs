//! Mean of repeated measurements, and its uncertainty by their scatter.
//!
//! ```text
//! sigma = sqrt(sum of (x - mean)^2 / (n (n - 1)))        standard deviation of the mean
//! ```
//!
//! Few repetitions make sigma itself uncertain: by Student's distribution 70, 82 and 86 % of the errors lie
//! within 2 sigma for n = 2, 3 and 4, if they are normal. Errors common to all repetitions are not included.

use crate::real::sqrt;

/// Mean and its standard deviation, in the unit of the measurements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Repeated {
    pub(crate) mean: f32,
    pub(crate) sigma: f32,
}

impl Repeated {
    /// Evaluates at least two measurements; one alone has a sigma of NaN.
    #[inline(never)]
    pub(super) fn new(measurements: &[f32]) -> Self {
        let count = measurements.len() as f32;
        let mean = measurements.iter().sum::<f32>() / count;
        let squares = measurements.iter().map(|each| (each - mean) * (each - mean)).sum::<f32>();
        Self { mean, sigma: sqrt(squares / (count * (count - 1.0))) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sigma_is_that_of_the_mean() {
        // Deviations -2, -1, 0, 3: squares 14, over 4 * 3.
        let found = Repeated::new(&[3.0, 4.0, 5.0, 8.0]);
        assert_eq!(found.mean, 5.0);
        assert!((found.sigma * found.sigma - 14.0 / 12.0).abs() < 1e-6, "{found:?}");
        // Half of the difference of two.
        assert_eq!(Repeated::new(&[1.0, 4.0]), Repeated { mean: 2.5, sigma: 1.5 });
    }
}
