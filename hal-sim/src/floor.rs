//! The floor under the foot: a contact that closes the chain.
//!
//! Why: a standing leg is not an open chain. The floor's force passes through every joint and no motor
//! current shows it; identification must detect it.
//!
//! ```text
//! depth   = level(t) - height of the foot,   level rises by RISE from where the foot is, within RISE_TIME
//! normal  = max(0, STIFFNESS depth - DAMPING speed upwards)        while depth > 0: pushes, never pulls
//! along   = -FRICTION normal v / sqrt(|v|^2 + SLIP^2)              v the foot's velocity along the floor
//! torque  = J' (normal up + along),          J_j = axis_j x (foot - point_j)
//! ```
//!
//! Up is against gravity. The foot is a point of the last link in its D-H frame. The trunk is fixed here, so
//! the rise of the floor represents the weight with which the wearer presses the foot down: up to 300 N on a
//! leg at rest. Stiffness, damping and friction are assumptions about a soft shoe, not measurements. SI
//! units.
//! Source: penalty contact (Moore and Wilhelms 1988) with regularised Coulomb friction.
//! Cost: one pose of the mechanism per tick, only during contact.
//! Known limits: one point, no rolling foot.

use nalgebra::Vector3;

use crate::leg::LegState;
use crate::maths::sqrt;
use crate::mechanism::Mechanism;

/// Stiffness of shoe and foot, N/m.
const STIFFNESS: f64 = 10e3;
/// Damping, N s/m: critical for some 15 kg.
const DAMPING: f64 = 700.0;
/// Friction coefficient of rubber on an indoor floor.
const FRICTION: f64 = 0.7;
/// Speed at which friction has reached 71 % of its level, m/s.
const SLIP: f64 = 0.01;
/// Rise of the floor into the foot, m.
const RISE: f64 = 0.03;
/// Duration of the rise, s.
const RISE_TIME: f64 = 0.2;

/// Contact of the foot with the floor during one interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Floor {
    /// Vector from the last joint to the foot, world frame at the reference pose, m.
    foot: Vector3<f64>,
    /// Start of the contact, s.
    start: f64,
    /// Duration of the contact, s.
    duration: f64,
    /// Height of the foot at the first touch, m; against gravity from the base's origin.
    height: Option<f64>,
}

impl Floor {
    /// A floor before contact; `foot` from the last joint, in the world frame at the reference pose.
    pub fn new(foot: Vector3<f64>, start: f64, duration: f64) -> Self {
        Self { foot, start, duration, height: None }
    }

    /// Torque on the joints at `time`, N m, joint sign.
    pub fn torque<const N: usize>(
        &mut self,
        mechanism: &Mechanism<N>,
        state: &LegState<N>,
        time: f64,
    ) -> [f64; N] {
        let since = time - self.start;
        if !(0.0..self.duration).contains(&since) {
            return [0.0; N];
        }
        let (foot, jacobian) = mechanism.point_of_last_link(&state.angles, &self.foot);
        let velocity = (0..N).fold(Vector3::zeros(), |sum, joint| sum + jacobian[joint] * state.rates[joint]);
        let up = mechanism.up();
        let height = up.dot(&foot);
        let level = *self.height.get_or_insert(height) + RISE * (since / RISE_TIME).min(1.0);
        let rising = up.dot(&velocity);
        let normal = if level > height { STIFFNESS * (level - height) - DAMPING * rising } else { 0.0 };
        let normal = normal.max(0.0);
        let along = velocity - up * rising;
        let force = up * normal - along * (FRICTION * normal / sqrt(along.norm_squared() + SLIP * SLIP));
        core::array::from_fn(|joint| jacobian[joint].dot(&force))
    }
}
