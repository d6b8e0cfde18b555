//! Time integration of mechanism and friction.
//!
//! One step of length h, from angles q and rates v to q', u (position Verlet with Coriolis torque bilinear in
//! the two rates):
//!
//! ```text
//! q_half = q + h/2 v
//! (M + h C(q_half, v) + h/2 diag(viscous)) u = M v - h/2 viscous v + h (torque - G - offset) - dry impulse
//! q' = q_half + h/2 u
//! ```
//!
//! Torque is the mean over the step. Since C(q, v) u = C(q, u) v, the step is its own inverse under reversed
//! time. So it is of second order, and the energy of a frictionless leg does not drift. Dry friction enters
//! as an impulse bounded by its level (`friction`). So a stuck joint keeps its position to the last bit, and
//! no friction level makes a step unstable. Instants at which a joint starts, stops or reverses are met to
//! within one step only. A servo tick with such an instant is repeated in `FINE_STEPS` steps.
//!
//! Measured bias on a driven leg: inertias 7e-5 of their value, viscous friction 3e-5, Coulomb friction 2e-5.
//! The reference is eighth-order differences of the leg's own motion, turning points included.
//! Symbols: rad, rad/s, N m, s.
//! Source: Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), for symmetric steps; Kahan
//! (1993) for the bilinear treatment of quadratic terms.
//! Cost: one evaluation of the mechanism per step.

use crate::description::{FrictionDescription, LegDescription};
use crate::friction::{Contact, Slide};
use crate::mechanism::{Mechanism, times};

/// Steps of a tick in which some joint starts, stops or reverses.
pub(crate) const FINE_STEPS: u32 = 8;

/// Rigid bodies with friction in their joints; all angles and torques are joint (D-H) ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg<const N: usize> {
    mechanism: Mechanism<N>,
    friction: [FrictionDescription; N],
    /// Blocked joints, which no torque moves.
    blocked: [bool; N],
}

/// Angles, rad, and rates, rad/s, of the joints; a rate of exactly 0 is a joint at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegState<const N: usize> {
    /// Joint angles, rad.
    pub angles: [f64; N],
    /// Joint rates, rad/s.
    pub rates: [f64; N],
}

impl<const N: usize> Leg<N> {
    /// Bodies and friction of a described leg.
    pub fn new(description: &LegDescription<N>) -> Self {
        Self {
            mechanism: Mechanism::new(description),
            friction: core::array::from_fn(|joint| description.joints[joint].friction),
            blocked: [false; N],
        }
    }

    /// This leg with some joints mechanically blocked; their rates must be 0.
    pub(crate) fn with_blocked(mut self, blocked: [bool; N]) -> Self {
        self.blocked = blocked;
        self
    }

    /// Breakaway levels of the joints; infinite for blocked ones.
    fn breakaway(&self, levels: [f64; N]) -> [f64; N] {
        core::array::from_fn(|joint| if self.blocked[joint] { f64::INFINITY } else { levels[joint] })
    }

    /// Rigid bodies without friction.
    pub fn mechanism(&self) -> &Mechanism<N> {
        &self.mechanism
    }

    /// Joint torques for a motion, friction and offset included, N m. At rest the dry friction of a joint is
    /// undetermined and omitted.
    pub fn inverse_dynamics(
        &self,
        angles: &[f64; N],
        rates: &[f64; N],
        accelerations: &[f64; N],
    ) -> [f64; N] {
        let rigid = self.mechanism.inverse_dynamics(angles, rates, accelerations);
        core::array::from_fn(|joint| rigid[joint] + self.friction[joint].torque(rates[joint]))
    }

    /// Accelerations under joint torques (N m), rad/s^2; exactly 0 for a joint that stays at rest.
    pub fn forward_dynamics(&self, state: &LegState<N>, torque: &[f64; N]) -> [f64; N] {
        let dynamics = self.mechanism.dynamics(&state.angles, &state.rates);
        let coriolis = times(&dynamics.coriolis, &state.rates);
        let levels = core::array::from_fn(|joint| self.friction[joint].dry_level(state.rates[joint]));
        let slide = Slide {
            matrix: dynamics.inertia,
            momentum: core::array::from_fn(|joint| {
                let friction = &self.friction[joint];
                let smooth = friction.viscous * state.rates[joint] + friction.offset;
                torque[joint] - coriolis[joint] - dynamics.gravity[joint] - smooth
            }),
            sliding: levels,
            breakaway: self.breakaway(levels),
            committed: state.rates.map(|rate| rate != 0.0),
        };
        slide.solve(&state.rates.map(Contact::from_rate))
    }

    /// Advances the leg by `duration` s under a torque (N m) that changes linearly between two values.
    pub fn advance(&self, state: &mut LegState<N>, from: &[f64; N], to: &[f64; N], duration: f64) {
        let mean = core::array::from_fn(|joint| 0.5 * (from[joint] + to[joint]));
        let coarse = self.step(state, &mean, duration);
        let before = state.rates.map(Contact::from_rate);
        if coarse.rates.map(Contact::from_rate) == before {
            *state = coarse;
            return;
        }
        let fine = 1.0 / f64::from(FINE_STEPS);
        for number in 0..FINE_STEPS {
            let share = (f64::from(number) + 0.5) * fine;
            let torque = core::array::from_fn(|joint| from[joint] + share * (to[joint] - from[joint]));
            *state = self.step(state, &torque, duration * fine);
        }
    }

    /// State after one step of `duration` s under a mean torque (N m).
    #[inline(always)]
    pub(crate) fn step(&self, state: &LegState<N>, torque: &[f64; N], duration: f64) -> LegState<N> {
        let half = 0.5 * duration;
        let rates = &state.rates;
        let middle: [f64; N] = core::array::from_fn(|joint| state.angles[joint] + half * rates[joint]);
        let dynamics = self.mechanism.dynamics(&middle, rates);
        let mut momentum = times(&dynamics.inertia, rates);
        let mut matrix = dynamics.inertia;
        for joint in 0..N {
            let friction = &self.friction[joint];
            let drag = half * friction.viscous;
            let smooth = torque[joint] - dynamics.gravity[joint] - friction.offset;
            momentum[joint] += duration * smooth - drag * rates[joint];
            for other in 0..N {
                matrix[joint][other] += duration * dynamics.coriolis[joint][other];
            }
            matrix[joint][joint] += drag;
        }
        let impulse = |rate: &[f64; N]| -> [f64; N] {
            core::array::from_fn(|joint| duration * self.friction[joint].dry_level(rate[joint]))
        };
        let present = rates.map(Contact::from_rate);
        let breakaway = self.breakaway(impulse(&[0.0; N]));
        let mut slide = Slide { matrix, momentum, sliding: impulse(rates), breakaway, committed: [false; N] };
        let mut after = slide.solve(&present);
        if self.friction.iter().any(|friction| friction.stribeck.is_some()) {
            // Using the level at the mean rate preserves the second order where friction depends on speed.
            slide.sliding = impulse(&core::array::from_fn(|joint| 0.5 * (rates[joint] + after[joint])));
            after = slide.solve(&present);
        }
        LegState { angles: core::array::from_fn(|joint| middle[joint] + half * after[joint]), rates: after }
    }
}
