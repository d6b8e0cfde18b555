//! The mass matrix: joint torque per joint acceleration.
//!
//! Wanted where a controller scales its gains with what it moves, and as a check: a physically consistent leg has a
//! positive definite one at every angle.
//!
//! ```text
//! M_ik = sum over links j of  u_i . (I u_k + h x v_k) + v_i . (m v_k + u_k x h)      M_ii += IA_i
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | u_i, v_i | axis of joint i seen from link j, as in [`super::regressor`] | -, m |
//! | I, h, m | inertia, first moment, mass of link j about its frame's origin | kg m2, kg m, kg |
//!
//! Source: R. Featherstone, Rigid Body Dynamics Algorithms, 2008, Eq. (6.5), with the Jacobian written out.
//! Cost: about 60 flops per link and pair of joints before it.

use nalgebra::SMatrix;

use super::chain::Chain;
use super::inertia::{first_moment, tensor};
use super::kinematics::JointAxis;
use super::parameter::{LegParameters, Parameter};
use crate::real::Real;

/// Mass matrix at the angles `q` (rad), kg m2, rotors included; symmetric to the last bit.
#[must_use]
pub fn mass_matrix<T: Real, const N: usize>(
    chain: &Chain<T, N>,
    parameters: &LegParameters<T, N>,
    q: &[T; N],
) -> SMatrix<T, N, N> {
    let frames = chain.frames(q);
    let mut axes = [JointAxis::own(); N];
    let mut matrix = SMatrix::<T, N, N>::zeros();
    for link in 0..N {
        for axis in axes.iter_mut().take(link) {
            *axis = axis.next(frames[link]);
        }
        let (inertia, h) = (tensor(&parameters[link]), first_moment(&parameters[link]));
        let mass = parameters[link][Parameter::M.index()];
        for (column, axis) in axes.iter().enumerate().take(link + 1) {
            let momentum = axis.linear * mass + axis.angular.cross(&h);
            let spin = inertia * axis.angular + h.cross(&axis.linear);
            for (row, other) in axes.iter().enumerate().take(column + 1) {
                let share = other.angular.dot(&spin) + other.linear.dot(&momentum);
                matrix[(row, column)] += share;
                if row != column {
                    matrix[(column, row)] += share;
                }
            }
        }
        matrix[(link, link)] += parameters[link][Parameter::IA.index()];
    }
    matrix
}
