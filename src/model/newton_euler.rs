//! Joint torques of a chain by recursive Newton-Euler, directly from the parameters.
//!
//! The independent check of the [`mod@super::regressor`], and cheaper where only torque is needed. Forces are
//! balanced link by link from the tip. With the parameters about the joint frame's origin no centre of mass
//! is needed, and the torque is linear in all of them.
//!
//! ```text
//! f_i = M a + wd x h + w x (w x h) + R f_(i+1)                    h = (HX, HY, HZ)
//! n_i = I wd + w x (I w) + h x a + R n_(i+1) + p x (R f_(i+1))
//! torque_i = z . n_i + IA qdd + FC sign(qd) + FV qd + OFF
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | w, wd, a | motion of link i in its frame, see `kinematics` | rad/s, rad/s2, m/s2 |
//! | f, n | force and moment (about the frame's origin) that link i-1 puts on link i | N, N m |
//! | R, p | frame i+1 seen from frame i | -, m |
//!
//! Source: Luh, Walker and Paul 1980; this form W. Khalil and E. Dombre, Modeling, Identification and Control
//! of Robots, 2002, Eqs (9.86)-(9.94). Cost: about 200 flops per joint; a leg's tick takes 754 instructions
//! more with the model than without (docs/results/bus.md; two joints, friction and fading included).
//! Numbers that are not finite pass through.

use nalgebra::Vector3;

use super::chain::Chain;
use super::friction::drive_torque;
use super::inertia::{angular_momentum, first_moment};
use super::kinematics::{JointFrame, LinkMotion, cross, scaled, sum};
use super::parameter::{JointParameters, LegParameters, Parameter};
use crate::real::Real;

/// Angles, speeds and accelerations of all joints, proximal first, in the chain's sense.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState<T, const N: usize> {
    /// Angles, rad.
    pub q: [T; N],
    /// Speeds, rad/s.
    pub qd: [T; N],
    /// Accelerations, rad/s2.
    pub qdd: [T; N],
}

impl<T: Real, const N: usize> JointState<T, N> {
    /// State at rest at these angles (rad).
    pub fn at_rest(q: [T; N]) -> Self {
        Self { q, qd: [T::zero(); N], qdd: [T::zero(); N] }
    }
}

/// Torque of every joint, N m: links, rotors and friction. `gravity` in m/s2 in the base frame.
pub fn joint_torques<T: Real, const N: usize>(
    chain: &Chain<T, N>,
    parameters: &LegParameters<T, N>,
    state: &JointState<T, N>,
    gravity: &Vector3<T>,
) -> [T; N] {
    let rigid = rigid_body_torques(chain, parameters, state, gravity);
    core::array::from_fn(|joint| {
        rigid[joint] + drive_torque(&parameters[joint], state.qd[joint], state.qdd[joint])
    })
}

/// Torque of every joint for the links alone, N m: no rotor inertia, friction or offset.
pub fn rigid_body_torques<T: Real, const N: usize>(
    chain: &Chain<T, N>,
    parameters: &LegParameters<T, N>,
    state: &JointState<T, N>,
    gravity: &Vector3<T>,
) -> [T; N] {
    let frames = chain.frames(&state.q);
    let mut motion = LinkMotion::base(gravity);
    let zero = Vector3::new(T::zero(), T::zero(), T::zero());
    let mut wrenches = [Wrench { force: zero, moment: zero }; N];
    // Not `from_fn`: a size-optimised build would call it for each link and pass the wrench through memory.
    for (link, wrench) in wrenches.iter_mut().enumerate() {
        motion = motion.next(frames[link], state.qd[link], state.qdd[link]);
        *wrench = Wrench::from_link(&parameters[link], &motion);
    }

    let mut torques = [T::zero(); N];
    let mut beyond: Option<Wrench<T>> = None;
    for ((torque, own), frame) in torques.iter_mut().zip(&wrenches).zip(&frames).rev() {
        let carried = beyond.map_or(*own, |wrench| own.plus(&wrench));
        *torque = carried.moment.z;
        beyond = Some(carried.seen_from_parent(*frame));
    }
    torques
}

/// Force (N) and moment about a frame's origin (N m), in that frame.
#[derive(Clone, Copy)]
struct Wrench<T> {
    force: Vector3<T>,
    moment: Vector3<T>,
}

impl<T: Real> Wrench<T> {
    /// Wrench that the link's own mass needs.
    #[inline(always)]
    fn from_link(parameters: &JointParameters<T>, motion: &LinkMotion<T>) -> Self {
        let (w, wd, a) = (motion.angular_velocity, motion.angular_acceleration, motion.acceleration);
        let (h, mass) = (first_moment(parameters), parameters[Parameter::M.index()]);
        Self {
            force: sum(&sum(&scaled(&a, mass), &cross(&wd, &h)), &cross(&w, &cross(&w, &h))),
            moment: sum(
                &sum(&angular_momentum(parameters, &wd), &cross(&w, &angular_momentum(parameters, &w))),
                &cross(&h, &a),
            ),
        }
    }

    #[inline(always)]
    fn plus(&self, other: &Self) -> Self {
        Self { force: sum(&self.force, &other.force), moment: sum(&self.moment, &other.moment) }
    }

    #[inline(always)]
    fn seen_from_parent(&self, frame: JointFrame<T>) -> Self {
        let force = frame.to_parent(&self.force);
        Self { force, moment: sum(&frame.to_parent(&self.moment), &cross(&frame.origin, &force)) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::inertia::{RigidBody, inertial};
    use super::super::testing::TestRandom;
    use super::*;
    use nalgebra::Matrix3;

    /// Origin and orientation of each link from the angles alone, without the velocities of this module.
    fn poses<const N: usize>(chain: &Chain<f64, N>, q: &[f64; N]) -> [(Matrix3<f64>, Vector3<f64>); N] {
        let frames = chain.frames(q);
        let (mut turn, mut position) = (Matrix3::identity(), Vector3::zeros());
        core::array::from_fn(|link| {
            position += turn * frames[link].origin;
            let axis = |x: f64, y: f64, z: f64| frames[link].to_parent(&Vector3::new(x, y, z));
            turn *= Matrix3::from_columns(&[axis(1.0, 0.0, 0.0), axis(0.0, 1.0, 0.0), axis(0.0, 0.0, 1.0)]);
            (turn, position)
        })
    }

    /// Kinetic plus potential energy at a time on a parabola through the state. Masses at rest and in motion
    /// as seen from the base, velocities by differences of poses.
    fn energy<const N: usize>(
        chain: &Chain<f64, N>,
        leg: &LegParameters<f64, N>,
        state: &JointState<f64, N>,
        gravity: &Vector3<f64>,
        time: f64,
    ) -> f64 {
        const STEP: f64 = 1e-4;
        let at = |time: f64| {
            let JointState { q, qd, qdd } = state;
            poses(chain, &core::array::from_fn(|i| q[i] + qd[i] * time + 0.5 * qdd[i] * time * time))
        };
        let (before, now, after) = (at(time - STEP), at(time), at(time + STEP));
        let mut energy = 0.0;
        for link in 0..N {
            let body = RigidBody::from_parameters(&inertial(&leg[link])).unwrap();
            let centre = |pose: &(Matrix3<f64>, Vector3<f64>)| pose.1 + pose.0 * body.centre_of_mass;
            let velocity = (centre(&after[link]) - centre(&before[link])) / (2.0 * STEP);
            let turning = (after[link].0 - before[link].0) / (2.0 * STEP) * now[link].0.transpose();
            let spin = now[link].0.transpose() * Vector3::new(turning.m32, turning.m13, turning.m21);
            energy += 0.5 * body.mass * velocity.dot(&velocity) + 0.5 * spin.dot(&(body.inertia * spin))
                - body.mass * gravity.dot(&centre(&now[link]));
        }
        energy
    }

    #[test]
    fn power_of_the_joints_is_the_rate_of_energy() {
        const STEP: f64 = 1e-3;
        let mut random = TestRandom::new(11);
        for _ in 0..20 {
            let (chain, leg, state, gravity) =
                (random.chain::<3>(), random.leg(), random.state(), random.gravity());
            let torques = rigid_body_torques(&chain, &leg, &state, &gravity);
            let power: f64 = torques.iter().zip(&state.qd).map(|(torque, speed)| torque * speed).sum();
            let size: f64 = torques.iter().zip(&state.qd).map(|(torque, speed)| (torque * speed).abs()).sum();
            let energy = |time| energy(&chain, &leg, &state, &gravity, time);
            let rate = (energy(STEP) - energy(-STEP)) / (2.0 * STEP);
            // Differences over 1 ms of motions with rates up to 10 /s: about (0.01)^2 / 6 and a margin.
            assert!((power - rate).abs() < 1e-3 * size, "{power} against {rate}");
        }
    }

    #[test]
    fn rotor_and_friction_come_on_top_of_the_rigid_body() {
        let mut random = TestRandom::new(12);
        let (chain, leg, state, gravity) =
            (random.chain::<2>(), random.leg(), random.state(), random.gravity());
        let rigid = rigid_body_torques(&chain, &leg, &state, &gravity);
        for (joint, torque) in joint_torques(&chain, &leg, &state, &gravity).into_iter().enumerate() {
            let [.., ia, fc, fv, off] = leg[joint];
            let (speed, acceleration) = (state.qd[joint], state.qdd[joint]);
            let drive = ia * acceleration + fc * speed.signum() + fv * speed + off;
            // Two orders of summing five numbers of a few tens.
            assert!((torque - rigid[joint] - drive).abs() < 1e-13);
        }
    }
}
