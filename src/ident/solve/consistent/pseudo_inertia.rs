//! Barrier around possible bodies: log-determinant of a link's pseudo-inertia and its derivatives.
//!
//! ```text
//! P = L L',   phi = -ln det P,   dphi = -tr M,   d2phi = |M|^2,   M(dp) = L^-1 P(dp) L^-T
//! ```
//!
//! `P` is linear in the ten parameters, so the second derivative is a sum of ten squares: a barrier is ten
//! rows of a least-squares problem. Cost: 2,600 multiplications a link.

use crate::model::{INERTIAL_PARAMETERS, JointParameters};
use crate::real::{self, Real};

type Matrix<T> = [[T; 4]; 4];

/// Pseudo-inertia of a joint's inertial parameters.
fn matrix<T: Real>(parameters: &[T; INERTIAL_PARAMETERS]) -> Matrix<T> {
    let [xx, xy, xz, yy, yz, zz, hx, hy, hz, mass] = *parameters;
    let half = (xx + yy + zz) * T::from_double(0.5);
    [[half - xx, -xy, -xz, hx], [-xy, half - yy, -yz, hy], [-xz, -yz, half - zz, hz], [hx, hy, hz, mass]]
}

/// A link's pseudo-inertia, factored.
pub(super) struct Factored<T> {
    /// `L^-1`, lower triangular.
    inverse: Matrix<T>,
    /// `ln det P`.
    pub(crate) log_determinant: T,
}

impl<T: Real> Factored<T> {
    /// Factors the pseudo-inertia; `None` if no body has these parameters.
    pub fn new(parameters: &JointParameters<T>) -> Option<Self> {
        let matrix = matrix(&crate::model::inertia::inertial(parameters));
        let mut lower = [[T::zero(); 4]; 4];
        let mut log_determinant = T::zero();
        for column in 0..4 {
            let mut pivot = matrix[column][column];
            for inner in 0..column {
                pivot -= lower[column][inner] * lower[column][inner];
            }
            if !(pivot > T::zero() && real::is_finite(pivot)) {
                return None;
            }
            log_determinant += real::ln(pivot);
            let root = real::sqrt(pivot);
            lower[column][column] = root;
            for row in column + 1..4 {
                let mut element = matrix[row][column];
                for inner in 0..column {
                    element -= lower[row][inner] * lower[column][inner];
                }
                lower[row][column] = element / root;
            }
        }
        let mut inverse = [[T::zero(); 4]; 4];
        for column in 0..4 {
            inverse[column][column] = T::one() / lower[column][column];
            for row in column + 1..4 {
                let mut sum = T::zero();
                for inner in column..row {
                    sum -= lower[row][inner] * inverse[inner][column];
                }
                inverse[row][column] = sum / lower[row][row];
            }
        }
        Some(Self { inverse, log_determinant })
    }

    /// Ten distinct elements of `M` as functions of the ten parameters, each multiplied by `scale`: four on
    /// the diagonal, then six off-diagonal ones times sqrt(2).
    pub(crate) fn rows(&self, scale: &JointParameters<T>) -> [[T; INERTIAL_PARAMETERS]; 10] {
        let mut rows = [[T::zero(); INERTIAL_PARAMETERS]; 10];
        for parameter in 0..INERTIAL_PARAMETERS {
            let mut unit = [T::zero(); INERTIAL_PARAMETERS];
            unit[parameter] = scale[parameter];
            let image = self.congruence(&matrix(&unit));
            let mut beside = 4;
            for row in 0..4 {
                rows[row][parameter] = image[row][row];
                for column in 0..row {
                    rows[beside][parameter] = image[row][column] * T::from_double(core::f64::consts::SQRT_2);
                    beside += 1;
                }
            }
        }
        rows
    }

    /// `L^-1 X L^-T`.
    fn congruence(&self, matrix: &Matrix<T>) -> Matrix<T> {
        let times = |left: &Matrix<T>, right: &Matrix<T>| {
            let mut product = [[T::zero(); 4]; 4];
            for row in 0..4 {
                for column in 0..4 {
                    for inner in 0..4 {
                        product[row][column] += left[row][inner] * right[inner][column];
                    }
                }
            }
            product
        };
        let mut transposed = [[T::zero(); 4]; 4];
        for row in 0..4 {
            for column in 0..4 {
                transposed[row][column] = self.inverse[column][row];
            }
        }
        times(&times(&self.inverse, matrix), &transposed)
    }
}
