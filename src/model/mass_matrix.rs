//! The mass matrix: joint torque per joint acceleration.
//!
//! Use: a controller scales its gains with the moved inertia. Also a check: a physically consistent leg has a
//! positive definite mass matrix at every angle.
//!
//! ```text
//! M_ik = sum over links j of  u_i . (I u_k + h x v_k) + v_i . (m v_k + u_k x h)      M_ii += IA_i
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | u_i, v_i | axis of joint i seen from link j, as in [`mod@super::regressor`] | -, m |
//! | I, h, m | inertia, first moment, mass of link j about its frame's origin | kg m2, kg m, kg |
//!
//! Source: R. Featherstone, Rigid Body Dynamics Algorithms, 2008, Eq. (6.5), with the Jacobian written out.
//! Cost: about 60 flops per link and pair of joints before it; 210 instructions for
//! two joints (Cortex-M4F, `f32`).

use nalgebra::SMatrix;

use super::chain::Chain;
use super::inertia::{angular_momentum, first_moment};
use super::kinematics::{JointAxis, cross};
use super::parameter::{LegParameters, Parameter};
use crate::real::Real;

/// Mass matrix at the angles `q` (rad), kg m2, rotors included; symmetric to the last bit.
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
        let h = first_moment(&parameters[link]);
        let mass = parameters[link][Parameter::M.index()];
        for (column, axis) in axes.iter().enumerate().take(link + 1) {
            let momentum = axis.linear * mass + cross(&axis.angular, &h);
            let spin = angular_momentum(&parameters[link], &axis.angular) + cross(&h, &axis.linear);
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

#[cfg(test)]
mod tests {
    use nalgebra::{SVector, Vector3};

    use super::super::newton_euler::{JointState, joint_torques};
    use super::super::parameter::rounded;
    use super::super::testing::{TestRandom, rounded_state};
    use super::*;

    /// Largest difference between M qdd and the torque that acceleration adds, over the largest such torque.
    fn inconsistency<T: Real>(seed: u64) -> f64 {
        let mut random = TestRandom::new(seed);
        let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
        for _ in 0..50 {
            let (chain, leg) = (random.chain::<3>().convert::<T>(), rounded(&random.leg()));
            let state: JointState<T, 3> = rounded_state(&JointState { qd: [0.0; 3], ..random.state() });
            let resting = JointState::at_rest(state.q);
            let weightless = Vector3::zeros();
            let moving = joint_torques(&chain, &leg, &state, &weightless);
            let still = joint_torques(&chain, &leg, &resting, &weightless);
            let added = mass_matrix(&chain, &leg, &state.q) * SVector::from(state.qdd);
            for joint in 0..3 {
                worst = worst.max((added[joint] + still[joint] - moving[joint]).to_double().abs());
                largest = largest.max(moving[joint].to_double().abs());
            }
        }
        worst / largest
    }

    #[test]
    fn mass_matrix_times_acceleration_is_the_torque_of_acceleration() {
        // Three frames and three products of rounding.
        let (double, single) = (inconsistency::<f64>(61), inconsistency::<f32>(62));
        assert!(double < 1e-14 && single < 3e-6, "{double:e} {single:e}");
    }

    #[test]
    fn mass_matrix_of_bodies_is_symmetric_and_positive_definite() {
        let mut random = TestRandom::new(63);
        for _ in 0..100 {
            let (chain, leg) = (random.chain::<3>(), random.leg());
            let matrix = mass_matrix(&chain, &leg, &random.state().q);
            assert_eq!(matrix, matrix.transpose());
            let smallest_rotor =
                leg.iter().map(|joint| joint[Parameter::IA.index()]).fold(f64::MAX, f64::min);
            // Links add a positive semidefinite matrix to the rotors' diagonal; rounding of entries up to 50.
            assert!(matrix.symmetric_eigenvalues().min() > smallest_rotor - 1e-13);
        }
    }
}
