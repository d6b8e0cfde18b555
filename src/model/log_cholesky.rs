//! Physical consistency: a test for possible bodies, and coordinates in which every body is possible.
//!
//! Ten parameters belong to a body (positive density somewhere, negative nowhere) exactly if
//! their pseudo-inertia is positive definite. A search in log-Cholesky coordinates cannot leave
//! that set, whatever the data.
//!
//! ```text
//! J = | S   h |      S = tr(I)/2 E - I                    (integral of x x' dm)
//!     | h'  m |
//!
//! J = U U'     U = e^alpha | e^d1  s12   s13   t1 |
//!                          |       e^d2  s23   t2 |
//!                          |             e^d3  t3 |
//!                          |                   1  |
//! ```
//!
//! | symbol | meaning | unit | range |
//! | --- | --- | --- | --- |
//! | alpha | half the logarithm of the mass | ln(kg)/2 | +-10 |
//! | d1 d2 d3 | logarithms of the body's extent about its centre of mass | ln(m) | +-10 |
//! | s12 s23 s13 | shear of that extent | m | +-1000 |
//! | t1 t2 t3 | centre of mass | m | +-1000 |
//!
//! Source: C. Rucker and P. M. Wensing, Smooth Parameterization of Rigid-Body Inertia, 2022, Eqs
//! (9)-(11); the criterion P. M. Wensing, S. Kim and J.-J. E. Slotine, 2018. Cost: four exponentials
//! and about 40 flops one way, 390 instructions in `f32` on a Cortex-M4F; three square roots
//! and four logarithms the other.
//! Limits: the ranges keep every product below 1e18, so that `f32` never overflows. In `f32` the conversion
//! from parameters loses the digits that the shift to the centre of mass cancels. A body of radius r at
//! distance c has a relative error of about 1e-7 (c/r)^2.

use super::inertia::{INERTIAL_PARAMETERS, InertialParameters};
use crate::real::{Real, clamp, exp, is_finite, ln, max, sqrt};

/// Logarithms (alpha, d1, d2, d3) are limited to plus and minus this.
pub(crate) const LOGARITHM_LIMIT: f64 = 10.0;

/// Lengths (s12, s23, s13, t1, t2, t3) are limited to plus and minus this, m.
pub(crate) const LENGTH_LIMIT_M: f64 = 1000.0;

/// Log-Cholesky coordinates of a body: alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LogCholesky<T>(pub [T; INERTIAL_PARAMETERS]);

impl<T: Real> LogCholesky<T> {
    /// Converts parameters to coordinates; `None` unless they are physically consistent.
    pub(crate) fn from_parameters(parameters: &InertialParameters<T>) -> Option<Self> {
        let [xx, xy, xz, yy, yz, zz, hx, hy, hz, mass] = *parameters;
        if !(mass > T::zero() && parameters.iter().all(|value| is_finite(*value))) {
            return None;
        }
        let half = T::from_double(0.5) / mass;
        let (second_x, second_y, second_z) =
            ((yy + zz - xx) * half, (xx + zz - yy) * half, (xx + yy - zz) * half);
        let (t1, t2, t3) = (hx / mass, hy / mass, hz / mass);
        let extent_z = extent(second_z - t3 * t3, second_z)?;
        let s13 = (-xz / mass - t1 * t3) / extent_z;
        let s23 = (-yz / mass - t2 * t3) / extent_z;
        let extent_y = extent(second_y - t2 * t2 - s23 * s23, second_y)?;
        let s12 = (-xy / mass - t1 * t2 - s13 * s23) / extent_y;
        let extent_x = extent(second_x - t1 * t1 - s12 * s12 - s13 * s13, second_x)?;
        let alpha = ln(mass) * T::from_double(0.5);
        Some(Self([alpha, ln(extent_x), ln(extent_y), ln(extent_z), s12, s23, s13, t1, t2, t3]))
    }

    /// Converts coordinates to parameters: always finite and physically consistent.
    ///
    /// Each coordinate is limited to its range first; NaN counts as the lower limit.
    pub(crate) fn parameters(&self) -> InertialParameters<T> {
        let [alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3] = self.0;
        let logarithm = T::from_double(LOGARITHM_LIMIT);
        let length = T::from_double(LENGTH_LIMIT_M);
        let e = |value: T| exp(clamp(value, -logarithm, logarithm));
        let [s12, s23, s13, t1, t2, t3] =
            [s12, s23, s13, t1, t2, t3].map(|value| clamp(value, -length, length));
        let (e1, e2, e3) = (e(d1), e(d2), e(d3));
        let root = e(alpha);
        let mass = root * root;

        let second_x = e1 * e1 + s12 * s12 + s13 * s13 + t1 * t1;
        let second_y = e2 * e2 + s23 * s23 + t2 * t2;
        let second_z = e3 * e3 + t3 * t3;
        [
            mass * (second_y + second_z),
            -mass * (s12 * e2 + s13 * s23 + t1 * t2),
            -mass * (s13 * e3 + t1 * t3),
            mass * (second_x + second_z),
            -mass * (s23 * e3 + t2 * t3),
            mass * (second_x + second_y),
            mass * t1,
            mass * t2,
            mass * t3,
            mass,
        ]
    }
}

/// Square root of a pivot (m2); `None` unless it exceeds the rounding of the number it was subtracted from.
fn extent<T: Real>(pivot: T, whole: T) -> Option<T> {
    (pivot > max(whole, T::zero()) * T::EPSILON * T::from_double(4.0)).then(|| sqrt(pivot))
}

/// True if a body with these parameters can exist: mass, and extent in three directions, beyond rounding.
pub fn is_physically_consistent<T: Real>(parameters: &InertialParameters<T>) -> bool {
    LogCholesky::from_parameters(parameters).is_some()
}

#[cfg(test)]
mod tests {
    use super::super::testing::TestRandom;
    use super::*;
    use nalgebra::{Matrix4, Vector4};

    /// Pseudo-inertia of these parameters: second moments (kg m2), first moments (kg m), mass (kg).
    fn pseudo_inertia(parameters: &InertialParameters<f64>) -> Matrix4<f64> {
        let [xx, xy, xz, yy, yz, zz, hx, hy, hz, mass] = *parameters;
        let half_trace = (xx + yy + zz) * 0.5;
        Matrix4::from_columns(&[
            Vector4::new(half_trace - xx, -xy, -xz, hx),
            Vector4::new(-xy, half_trace - yy, -yz, hy),
            Vector4::new(-xz, -yz, half_trace - zz, hz),
            Vector4::new(hx, hy, hz, mass),
        ])
    }

    /// Largest coordinate error after a conversion to parameters and back, over random bodies.
    fn round_trip_error<T: Real>(seed: u64) -> f64 {
        let mut random = TestRandom::new(seed);
        let mut worst = 0.0_f64;
        for _ in 0..200 {
            let body = LogCholesky(random.body().0.map(T::from_double));
            let back = LogCholesky::from_parameters(&body.parameters()).unwrap();
            for (one, other) in body.0.iter().zip(&back.0) {
                worst = worst.max((*one - *other).to_double().abs());
            }
        }
        worst
    }

    #[test]
    fn log_cholesky_there_and_back_is_the_identity() {
        // Bodies down to 5 cm wide at up to 0.5 m: the shift to the centre of mass costs two to three digits.
        let (double, single) = (round_trip_error::<f64>(51), round_trip_error::<f32>(52));
        assert!(double < 1e-12, "{double:e}");
        assert!(single < 1e-3, "{single:e}");
    }

    #[test]
    fn parameters_of_any_coordinates_are_those_of_the_factor_product() {
        let mut random = TestRandom::new(53);
        for _ in 0..50 {
            let body = random.body();
            let [alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3] = body.0;
            // By columns.
            let factor = Matrix4::from([
                [exp(d1), 0.0, 0.0, 0.0],
                [s12, exp(d2), 0.0, 0.0],
                [s13, s23, exp(d3), 0.0],
                [t1, t2, t3, 1.0],
            ]) * exp(alpha);
            let difference = factor * factor.transpose() - pseudo_inertia(&body.parameters());
            // A few roundings of numbers up to 20.
            assert!(difference.abs().max() < 1e-14);
        }
    }

    #[test]
    fn consistent_means_positive_definite_pseudo_inertia() {
        let mut random = TestRandom::new(54);
        let (mut consistent, mut inconsistent) = (0, 0);
        for _ in 0..500 {
            let mut parameters = random.body().parameters();
            for value in &mut parameters {
                *value *= 1.0 + random.within(0.5);
            }
            let smallest = pseudo_inertia(&parameters).symmetric_eigenvalues().min();
            // Eigenvalues this close to zero are rounding; none of the 500 comes near.
            assert!(smallest.abs() > 1e-9);
            assert_eq!(is_physically_consistent(&parameters), smallest > 0.0);
            if smallest > 0.0 { consistent += 1 } else { inconsistent += 1 }
        }
        assert!(consistent > 50 && inconsistent > 50, "{consistent} and {inconsistent}");
    }

    #[test]
    fn extreme_coordinates_stay_finite_in_single_precision() {
        for extreme in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 10.0, -10.0] {
            let parameters = LogCholesky([extreme; 10]).parameters();
            assert!(parameters.iter().all(|value| value.is_finite()), "{extreme}: {parameters:?}");
            assert!(parameters[9] > 0.0 && parameters[0] > 0.0);
        }
    }

    #[test]
    fn impossible_bodies_are_refused() {
        let good = TestRandom::new(55).body().parameters();
        assert!(is_physically_consistent(&good));
        let changed = |index: usize, value: f64| {
            let mut parameters = good;
            parameters[index] = value;
            is_physically_consistent(&parameters)
        };
        assert!(!changed(9, -1.0) && !changed(9, 0.0), "mass");
        assert!(!changed(5, good[0] + good[3] + 0.1), "triangle inequality of inertias");
        assert!(!changed(6, 100.0), "centre of mass outside what the inertia allows");
        assert!(!changed(1, f64::NAN) && !changed(4, f64::INFINITY));
    }
}
