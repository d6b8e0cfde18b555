//! The wearer's thigh and shank by Lagrange's equations in the directions of the segments.
//!
//! ```text
//! M_00 = I_0 + m_0 |c_0|^2 + m_1 L^2          M_11 = I_1 + m_1 |c_1|^2
//! M_01 = m_1 L (x_1 cos D + y_1 sin D),  D = p_0 - p_1
//! M p'' + [-M_01' p_1'^2, M_01' p_0'^2] + dV/dp = forces,     M_01' = dM_01/dD
//! V    = -m_0 g . (x_0 e_0 + y_0 n_0) - m_1 g . (L e_0 + x_1 e_1 + y_1 n_1) + sum 1/2 K_j (a_j - rest_j)^2
//! passive torque at a joint = -K (a - rest) - D a'
//! ```
//!
//! Segment i has mass m_i, inertia I_i about its centre of mass c_i = [x_i, y_i], and direction p_i; L is the
//! length of the thigh. With directions instead of joint angles there is no Coriolis term, only two
//! centrifugal ones. [`super::plane`] has the conversions. SI units.
//! Source: any text on analytical mechanics, double pendulum.

use super::description::{PassiveDescription, SegmentDescription, WearerDescription};
use super::plane::{LimbSegment, Pair, TwoLinkChain, convert_angles, convert_torques, dot};
use crate::maths::sin_cos;
use crate::mechanism::times;

/// Directions of thigh and shank, rad, and their rates, rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LimbState {
    pub(crate) angles: Pair,
    pub(crate) rates: Pair,
}

/// Limb of the wearer without muscles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Body {
    pub(crate) chain: TwoLinkChain,
    segments: [SegmentDescription; 2],
    passive: [PassiveDescription; 2],
    gravity: Pair,
    inertia: Pair,
}

impl Body {
    /// Limb under gravity (m/s^2) in the exoskeleton's plane.
    pub(super) fn new(wearer: &WearerDescription, gravity: Pair) -> Self {
        let segments = [wearer.thigh, wearer.shank];
        let [thigh, shank] =
            segments.map(|segment| segment.inertia_com + segment.mass * dot(segment.com, segment.com));
        let beyond = wearer.shank.mass * wearer.thigh_length * wearer.thigh_length;
        Self {
            chain: TwoLinkChain { hip: wearer.hip_offset, thigh: wearer.thigh_length },
            segments,
            passive: wearer.passive,
            gravity,
            inertia: [thigh + beyond, shank],
        }
    }

    /// M_01 and its derivative by the difference of the directions.
    fn coupling(&self, angles: Pair) -> Pair {
        let (sine, cosine) = sin_cos(angles[0] - angles[1]);
        let [x, y] = self.segments[1].com;
        let scale = self.segments[1].mass * self.chain.thigh;
        [scale * (x * cosine + y * sine), scale * (y * cosine - x * sine)]
    }

    /// Inertia matrix of the directions, kg m^2.
    pub(super) fn inertia(&self, angles: Pair) -> [Pair; 2] {
        let coupling = self.coupling(angles)[0];
        [[self.inertia[0], coupling], [coupling, self.inertia[1]]]
    }

    /// dV/dp without the springs, N m.
    fn gravity_torques(&self, angles: Pair) -> Pair {
        let [thigh, shank] = self.segments;
        let first = self.chain.point(LimbSegment::Thigh, thigh.com, angles);
        let second = self.chain.point(LimbSegment::Shank, shank.com, angles);
        [0, 1].map(|angle| {
            -thigh.mass * dot(self.gravity, first.slope[angle])
                - shank.mass * dot(self.gravity, second.slope[angle])
        })
    }

    /// Elastic torque at the joints, N m.
    pub(super) fn elastic(&self, position: Pair) -> Pair {
        [0, 1].map(|joint| self.passive[joint].stiffness * (self.passive[joint].rest - position[joint]))
    }

    /// Passive damping at the joints, N m.
    pub(super) fn damping(&self, velocity: Pair) -> Pair {
        [0, 1].map(|joint| -self.passive[joint].damping * velocity[joint])
    }

    /// Whether some joint has passive damping.
    pub(super) fn is_damped(&self) -> bool {
        self.passive.iter().any(|passive| passive.damping > 0.0)
    }

    /// Torque of the muscles at hip and knee for a motion of the free limb: rad, rad/s, rad/s^2 to N m.
    pub(super) fn inverse_dynamics(&self, position: Pair, velocity: Pair, acceleration: Pair) -> Pair {
        let [angles, rates, accelerations] = [position, velocity, acceleration].map(convert_angles);
        let slope = self.coupling(angles)[1];
        let inertial = times(&self.inertia(angles), &accelerations);
        let gravity = self.gravity_torques(angles);
        let forces = [
            inertial[0] - slope * rates[1] * rates[1] + gravity[0],
            inertial[1] + slope * rates[0] * rates[0] + gravity[1],
        ];
        let (torque, elastic, damping) =
            (convert_torques(forces), self.elastic(position), self.damping(velocity));
        [0, 1].map(|joint| torque[joint] - elastic[joint] - damping[joint])
    }

    /// Accelerations of the directions under generalised forces (N m) besides gravity, rad/s^2.
    pub(super) fn accelerations(&self, limb: &LimbState, forces: Pair) -> Pair {
        let slope = self.coupling(limb.angles)[1];
        let gravity = self.gravity_torques(limb.angles);
        let [first, second] = limb.rates;
        let right = [
            forces[0] - gravity[0] + slope * second * second,
            forces[1] - gravity[1] - slope * first * first,
        ];
        solve(&self.inertia(limb.angles), right)
    }

    /// Rates after `duration` s under generalised forces (N m) besides gravity, with the directions of the
    /// interval's middle. The centrifugal term is bilinear in old and new rates, as in [`crate::leg`].
    pub(super) fn rates_after(&self, middle: Pair, rates: Pair, forces: Pair, duration: f64) -> Pair {
        let [coupling, slope] = self.coupling(middle);
        let gravity = self.gravity_torques(middle);
        let momentum = times(&[[self.inertia[0], coupling], [coupling, self.inertia[1]]], &rates);
        let right = [0, 1].map(|angle| momentum[angle] + duration * (forces[angle] - gravity[angle]));
        let matrix = [
            [self.inertia[0], coupling - duration * slope * rates[1]],
            [coupling + duration * slope * rates[0], self.inertia[1]],
        ];
        solve(&matrix, right)
    }

    /// Kinetic energy, J.
    pub(super) fn kinetic_energy(&self, limb: &LimbState) -> f64 {
        0.5 * dot(times(&self.inertia(limb.angles), &limb.rates), limb.rates)
    }

    /// Energy in gravity and in passive springs, J; zero of gravity at the exoskeleton's hip axis.
    pub(super) fn potential_energy(&self, angles: Pair) -> f64 {
        let heights: f64 = [LimbSegment::Thigh, LimbSegment::Shank]
            .into_iter()
            .zip(&self.segments)
            .map(|(segment, body)| {
                -body.mass * dot(self.gravity, self.chain.point(segment, body.com, angles).position)
            })
            .sum();
        let position = convert_angles(angles);
        let stretched: f64 = (0..2)
            .map(|joint| {
                let turned = position[joint] - self.passive[joint].rest;
                0.5 * self.passive[joint].stiffness * turned * turned
            })
            .sum();
        heights + stretched
    }
}

fn solve([[a, b], [c, d]]: &[Pair; 2], [x, y]: Pair) -> Pair {
    let determinant = a * d - b * c;
    [(d * x - b * y) / determinant, (a * y - c * x) / determinant]
}
