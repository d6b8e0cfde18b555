//! Physical consistency: which ten numbers belong to a body that can exist, and coordinates in which all do.
//!
//! Ten parameters are those of a body (positive density somewhere, negative nowhere) exactly if their pseudo-inertia
//! is positive definite. A search that moves in log-Cholesky coordinates cannot leave that set, whatever the data.
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
//! Source: C. Rucker and P. M. Wensing, Smooth Parameterization of Rigid-Body Inertia, 2022, Eqs (9)-(11); the
//! criterion P. M. Wensing, S. Kim and J.-J. E. Slotine, 2018. Cost: four exponentials and about 40 flops one way;
//! three square roots and four logarithms the other.
//! Limits: the ranges keep every product below 1e18, so that `f32` never overflows. In `f32` the way back from
//! parameters loses the digits that the shift to the centre of mass cancels: a body of radius r at distance c comes
//! back with a relative error of about 1e-7 (c/r)^2.

use nalgebra::{Matrix4, Vector4};

use super::inertia::{INERTIAL_PARAMETERS, InertialParameters};
use crate::real::{Real, clamp, exp, is_finite, ln, max, sqrt};

/// Logarithms (alpha, d1, d2, d3) are limited to plus and minus this.
pub const LOGARITHM_LIMIT: f64 = 10.0;

/// Lengths (s12, s23, s13, t1, t2, t3) are limited to plus and minus this, m.
pub const LENGTH_LIMIT_M: f64 = 1000.0;

/// Log-Cholesky coordinates of a body: alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogCholesky<T>(pub [T; INERTIAL_PARAMETERS]);

impl<T: Real> LogCholesky<T> {
    /// The coordinates of these parameters; `None` unless they are physically consistent.
    #[must_use]
    pub fn from_parameters(parameters: &InertialParameters<T>) -> Option<Self> {
        let [xx, xy, xz, yy, yz, zz, hx, hy, hz, mass] = *parameters;
        if !(mass > T::zero() && parameters.iter().all(|value| is_finite(*value))) {
            return None;
        }
        let half = T::of(0.5) / mass;
        let (second_x, second_y, second_z) =
            ((yy + zz - xx) * half, (xx + zz - yy) * half, (xx + yy - zz) * half);
        let (t1, t2, t3) = (hx / mass, hy / mass, hz / mass);
        let extent_z = extent(second_z - t3 * t3, second_z)?;
        let s13 = (-xz / mass - t1 * t3) / extent_z;
        let s23 = (-yz / mass - t2 * t3) / extent_z;
        let extent_y = extent(second_y - t2 * t2 - s23 * s23, second_y)?;
        let s12 = (-xy / mass - t1 * t2 - s13 * s23) / extent_y;
        let extent_x = extent(second_x - t1 * t1 - s12 * s12 - s13 * s13, second_x)?;
        let alpha = ln(mass) * T::of(0.5);
        Some(Self([alpha, ln(extent_x), ln(extent_y), ln(extent_z), s12, s23, s13, t1, t2, t3]))
    }

    /// The parameters of these coordinates: always finite and always those of a body.
    ///
    /// Each coordinate is limited to its range first; one that is not a number counts as its lower limit.
    #[must_use]
    pub fn to_parameters(&self) -> InertialParameters<T> {
        let [alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3] = self.0;
        let logarithm = T::of(LOGARITHM_LIMIT);
        let length = T::of(LENGTH_LIMIT_M);
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

/// Square root of a pivot (m2) that must be more than the rounding of what it was subtracted from.
fn extent<T: Real>(pivot: T, whole: T) -> Option<T> {
    (pivot > max(whole, T::zero()) * T::EPSILON * T::of(4.0)).then(|| sqrt(pivot))
}

/// A body with these ten parameters can exist: mass, and extent in three directions, beyond rounding.
#[must_use]
pub fn is_physically_consistent<T: Real>(parameters: &InertialParameters<T>) -> bool {
    LogCholesky::from_parameters(parameters).is_some()
}

/// Pseudo-inertia of these parameters: second moments (kg m2), first moments (kg m), mass (kg).
#[must_use]
pub fn pseudo_inertia<T: Real>(parameters: &InertialParameters<T>) -> Matrix4<T> {
    let [xx, xy, xz, yy, yz, zz, hx, hy, hz, mass] = *parameters;
    let half_trace = (xx + yy + zz) * T::of(0.5);
    let columns = [
        Vector4::new(half_trace - xx, -xy, -xz, hx),
        Vector4::new(-xy, half_trace - yy, -yz, hy),
        Vector4::new(-xz, -yz, half_trace - zz, hz),
        Vector4::new(hx, hy, hz, mass),
    ];
    Matrix4::from_columns(&columns)
}
