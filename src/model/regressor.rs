//! The regressor: the matrix that turns parameters into torques for one state of motion.
//!
//! Identification relies on torque being linear in the parameters. Row i holds, for every link j, the
//! derivative of torque i by the 14 parameters of joint j. It is zero for j < i, since a link does not load
//! the joints beyond it.
//!
//! A 6 x 10 wrench matrix of each link carried down the chain would be costly. Instead the axis of joint i is
//! carried up to the link (u, v: the link's angular and origin velocity per unit speed of joint i). Torque i
//! is the power of link j's wrench along (u, v):
//!
//! ```text
//! row_ij . parameters_j = u . (I wd + w x I w + h x a) + v . (M a + wd x h + w x (w x h))
//!   by I:  u' I wd + k' I w                                   k = u x w
//!   by h:  a x u + v x wd + w x (w x v)
//!   by M:  v . a
//!   j = i: IA qdd + FC sign(qd) + FV qd + OFF
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | w, wd, a | motion of link j in its frame, see `kinematics` | rad/s, rad/s2, m/s2 |
//! | u, v | axis of joint i seen from link j | -, m |
//! | I, h, M | inertia tensor, first moment, mass of link j | kg m2, kg m, kg |
//!
//! Source: C. G. Atkeson, C. H. An and J. M. Hollerbach 1986 (linear form); the
//! axes are the Jacobian's columns.
//! Cost: about 90 flops per pair (i, j) and 90 per link; 1,550 instructions for two joints in `f32` on a
//! Cortex-M4F, 95 for a row times the parameters. Memory: 56 N^2 bytes in `f32`. Numbers that are
//! not finite pass through.

use nalgebra::Vector3;

use super::chain::Chain;
use super::friction::drive_columns;
use super::inertia::InertialParameters;
use super::kinematics::{JointAxis, LinkMotion, cross, sum};
use super::newton_euler::JointState;
use super::parameter::{LegParameters, PARAMETERS_PER_JOINT, RegressorRow};
use crate::real::Real;

/// Regressor of one state: row i times the parameters is torque i (N m). `gravity` in m/s2 in the base frame.
pub fn regressor<T: Real, const N: usize>(
    chain: &Chain<T, N>,
    state: &JointState<T, N>,
    gravity: &Vector3<T>,
) -> [RegressorRow<T, N>; N] {
    let frames = chain.frames(&state.q);
    let mut rows = [[[T::zero(); PARAMETERS_PER_JOINT]; N]; N];
    let mut axes = [JointAxis::own(); N];
    let mut motion = LinkMotion::base(gravity);
    for link in 0..N {
        let frame = frames[link];
        motion = motion.next(frame, state.qd[link], state.qdd[link]);
        for (joint, (axis, row)) in axes.iter_mut().zip(&mut rows).enumerate().take(link + 1) {
            if joint < link {
                *axis = axis.next(frame);
            }
            let (inertial, drive) = row[link].split_at_mut(10);
            inertial.copy_from_slice(&inertial_columns(axis, &motion));
            if joint == link {
                drive.copy_from_slice(&drive_columns(state.qd[link], state.qdd[link]));
            }
        }
    }
    rows
}

/// Derivative of a joint's torque by the ten inertial parameters of a link.
#[inline]
fn inertial_columns<T: Real>(axis: &JointAxis<T>, motion: &LinkMotion<T>) -> InertialParameters<T> {
    let (w, wd, a) = (motion.angular_velocity, motion.angular_acceleration, motion.acceleration);
    let (u, v) = (axis.angular, axis.linear);
    let k = cross(&u, &w);
    let h = sum(&sum(&cross(&a, &u), &cross(&v, &wd)), &cross(&w, &cross(&w, &v)));
    [
        u.x * wd.x + k.x * w.x,
        u.x * wd.y + u.y * wd.x + k.x * w.y + k.y * w.x,
        u.x * wd.z + u.z * wd.x + k.x * w.z + k.z * w.x,
        u.y * wd.y + k.y * w.y,
        u.y * wd.z + u.z * wd.y + k.y * w.z + k.z * w.y,
        u.z * wd.z + k.z * w.z,
        h.x,
        h.y,
        h.z,
        v.dot(&a),
    ]
}

/// Product of a regressor row and the parameters: the torque of its joint, N m.
#[inline]
pub(crate) fn row_torque<T: Real, const N: usize>(
    row: &RegressorRow<T, N>,
    parameters: &LegParameters<T, N>,
) -> T {
    let mut torque = T::zero();
    for (columns, joint) in row.iter().zip(parameters) {
        for (column, parameter) in columns.iter().zip(joint) {
            torque += *column * *parameter;
        }
    }
    torque
}

#[cfg(test)]
mod tests {
    use super::super::newton_euler::joint_torques;
    use super::super::parameter::rounded;
    use super::super::testing::{TestRandom, rounded_state};
    use super::*;

    /// Largest difference of regressor times parameters and Newton-Euler over random
    /// legs, over the largest torque.
    fn identity_error<T: Real, const N: usize>(seed: u64) -> f64 {
        let mut random = TestRandom::new(seed);
        let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
        for _ in 0..200 {
            let (chain, leg) = (random.chain::<N>().convert::<T>(), rounded(&random.leg::<N>()));
            let (state, gravity) = (rounded_state(&random.state()), random.gravity().map(T::from_double));
            let torques = joint_torques(&chain, &leg, &state, &gravity);
            for (row, torque) in regressor(&chain, &state, &gravity).iter().zip(&torques) {
                worst = worst.max((row_torque(row, &leg) - *torque).to_double().abs());
                largest = largest.max(torque.to_double().abs());
            }
        }
        worst / largest
    }

    #[test]
    fn regressor_times_parameters_equals_newton_euler() {
        // 42 products and three frames of rounding: a few tens of units in the
        // last place of the largest torque.
        for error in [identity_error::<f64, 1>(1), identity_error::<f64, 2>(2), identity_error::<f64, 3>(3)] {
            assert!(error < 1e-14, "{error:e}");
        }
        for error in [identity_error::<f32, 1>(4), identity_error::<f32, 2>(5), identity_error::<f32, 3>(6)] {
            assert!(error < 3e-6, "{error:e}");
        }
    }

    #[test]
    fn single_precision_regressor_is_close_to_double() {
        let mut random = TestRandom::new(7);
        let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
        for _ in 0..200 {
            let (chain, state, gravity) = (random.chain::<3>(), random.state(), random.gravity());
            let reference = regressor(&chain, &state, &gravity);
            let single =
                regressor(&chain.convert::<f32>(), &rounded_state(&state), &gravity.map(|g| g as f32));
            for (one, other) in
                single.as_flattened().as_flattened().iter().zip(reference.as_flattened().as_flattened())
            {
                worst = worst.max((f64::from(*one) - other).abs());
                largest = largest.max(other.abs());
            }
        }
        // Angles up to pi are off by 1.2e-7; centripetal terms square and add the
        // errors that three frames carry.
        assert!(worst < 2e-6 * largest, "{:e}", worst / largest);
    }

    #[test]
    fn a_link_loads_no_joint_beyond_it() {
        let mut random = TestRandom::new(8);
        let rows = regressor(&random.chain::<3>(), &random.state(), &random.gravity());
        assert_eq!(rows[1][0], [0.0; 14]);
        assert_eq!(rows[2][0], [0.0; 14]);
        assert_eq!(rows[2][1], [0.0; 14]);
        assert_eq!(rows[0][1][10..], [0.0; 4], "friction of joint 2 loads joint 1");
    }

    #[test]
    fn states_that_are_not_numbers_give_no_number_and_no_panic() {
        let mut random = TestRandom::new(9);
        let (chain, leg, gravity) = (random.chain::<2>(), random.leg(), random.gravity());
        let good = random.state();
        for bad in [f64::NAN, f64::INFINITY] {
            for state in [
                JointState { q: [bad, 0.1], ..good },
                JointState { qd: [bad, 0.1], ..good },
                JointState { qdd: [bad, 0.1], ..good },
            ] {
                let rows = regressor(&chain, &state, &gravity);
                assert!(!row_torque(&rows[0], &leg).is_finite());
                assert!(!joint_torques(&chain, &leg, &state, &gravity)[0].is_finite());
            }
        }
    }
}
