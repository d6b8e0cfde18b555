//! A point mass fixed to a link, and its contribution to the parameters.
//!
//! Why: a known load needs no new identification. Parameters of bodies fixed to one another add up, so one
//! addition puts a load on a model or takes it off. A load of known mass is also the reference for torque
//! constants ([`crate::ident::solve::scale`]).
//!
//! ```text
//! delta: M = m     H = m r     I = m (r.r E - r r')      about the origin of the link's joint frame
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | m | mass; negative to take a load off | kg |
//! | r | position in the link's joint frame | m |
//!
//! Source: Steiner's theorem with no inertia of its own. Cost: 20 multiplications. Limits: a load of some
//! size has an inertia of its own, m k^2 with k its radius of gyration. At r = 0.2 m a disc of 0.1 m radius
//! (k = 0.05 m about its diameter) has 6 % of m r^2.

use nalgebra::{Matrix3, Vector3};

use super::inertia::{INERTIAL_PARAMETERS, RigidBody};
use super::parameter::{LegParameters, PARAMETERS_PER_JOINT};
use crate::real::Real;

/// A point mass on a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Payload<T> {
    /// Joint of the link that carries it, from 0.
    pub joint: usize,
    /// Mass, kg.
    pub mass: T,
    /// Position in the joint's frame, m.
    pub position: Vector3<T>,
}

impl<T: Real> Payload<T> {
    /// Contribution to the parameters of a leg; zero for a joint that does not exist.
    pub fn parameters<const N: usize>(&self) -> LegParameters<T, N> {
        let mut parameters = [[T::zero(); PARAMETERS_PER_JOINT]; N];
        let body = RigidBody { mass: self.mass, centre_of_mass: self.position, inertia: Matrix3::zeros() };
        if let Some(joint) = parameters.get_mut(self.joint) {
            for (slot, value) in joint.iter_mut().zip(body.to_parameters()).take(INERTIAL_PARAMETERS) {
                *slot = value;
            }
        }
        parameters
    }

    /// Converts to another precision.
    pub fn convert<U: Real>(&self) -> Payload<U> {
        Payload {
            joint: self.joint,
            mass: U::from_double(self.mass.to_double()),
            position: self.position.map(|element| U::from_double(element.to_double())),
        }
    }

    /// Adds the payload to the parameters of a leg.
    pub fn add_to<const N: usize>(&self, parameters: &mut LegParameters<T, N>) {
        let delta = self.parameters::<N>();
        for (value, added) in parameters.iter_mut().flatten().zip(delta.iter().flatten()) {
            *value += *added;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::newton_euler::joint_torques;
    use super::super::testing::{TestRandom, paper_chain};
    use super::*;

    #[test]
    fn a_point_mass_adds_the_torque_of_its_own_motion() {
        // Torque of a point mass by d'Alembert: its weight and its inertia force through the Jacobian, both
        // by differences of its position, without any tensor.
        let (mut random, chain) = (TestRandom::new(91), paper_chain::<f64>());
        let gravity = Vector3::new(0.3, -0.2, -9.7);
        for joint in 0..3 {
            let payload = Payload { joint, mass: 2.5, position: Vector3::new(0.2, -0.05, 0.03) };
            let point_at = |q: &[f64; 3]| {
                (0..=joint).rev().fold(payload.position, |point, at| {
                    let frame = chain.frames(q)[at];
                    frame.to_parent(&point) + frame.origin
                })
            };
            let state = random.state::<3>();
            let at = |time: f64| -> [f64; 3] {
                core::array::from_fn(|axis| {
                    state.q[axis] + time * state.qd[axis] + 0.5 * time * time * state.qdd[axis]
                })
            };
            let step = 1e-4;
            let acceleration =
                (point_at(&at(step)) - point_at(&at(0.0)) * 2.0 + point_at(&at(-step))) / (step * step);
            let mut loaded = [[0.0; PARAMETERS_PER_JOINT]; 3];
            payload.add_to(&mut loaded);
            let torque = joint_torques(&chain, &loaded, &state, &gravity);
            for axis in 0..3 {
                let mut moved = [state.q, state.q];
                moved[0][axis] += step;
                moved[1][axis] -= step;
                let lever = (point_at(&moved[0]) - point_at(&moved[1])) / (2.0 * step);
                let expected = payload.mass * lever.dot(&(acceleration - gravity));
                // Second differences over 1e-4 s round at 1e-8 of numbers near 1, times mass and lever.
                assert!((torque[axis] - expected).abs() < 1e-5, "{} {expected}", torque[axis]);
            }
        }
    }

    #[test]
    fn a_load_taken_off_leaves_the_leg_and_a_joint_that_is_not_there_carries_nothing() {
        let parameters = TestRandom::new(92).leg::<2>();
        let payload = Payload { joint: 1, mass: 3.0, position: Vector3::new(0.3, 0.1, 0.0) };
        let mut loaded = parameters;
        payload.add_to(&mut loaded);
        assert!(loaded[1][9] > parameters[1][9] + 2.9 && loaded[0] == parameters[0]);
        Payload { mass: -payload.mass, ..payload }.add_to(&mut loaded);
        // One rounding each way.
        for (back, before) in loaded.iter().flatten().zip(parameters.iter().flatten()) {
            assert!((back - before).abs() < 1e-14);
        }
        let mut same = parameters;
        Payload { joint: 2, ..payload }.add_to(&mut same);
        assert_eq!(same, parameters);
    }
}
