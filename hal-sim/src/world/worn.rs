//! World with a wearer who has a body of their own.
//!
//! The wearer decides the muscles' torque once per servo tick. Both bodies move in the same steps, those of a
//! servo tick with ideal drives and those of a PWM period with complete ones.

use super::{TICK_S, World};
use crate::leg::{Leg, LegState};
use crate::wearer::{
    Wearer, WearerTruth,
    description::{WearerDescription, WearerError},
    muscles::Intention,
};

impl<const N: usize> World<N> {
    /// Puts the exoskeleton on a wearer, who is limp and in its posture. The bodies of this world's leg are
    /// then those of the exoskeleton alone. A second wearer replaces the first.
    ///
    /// # Errors
    /// [`WearerError`] if the leg is not a hip and a knee in a vertical plane, a number is out of range, or
    /// the cuffs are too stiff or too damped to be integrated.
    pub fn wear(&mut self, wearer: &WearerDescription) -> Result<(), WearerError> {
        self.wearer = Some(Wearer::new(wearer, &self.description, &self.state)?);
        Ok(())
    }

    /// Lets the wearer intend something from now on.
    ///
    /// # Errors
    /// [`WearerError::NotWorn`] without a wearer, [`WearerError::OutOfRange`] for a wrong number of a motion.
    pub fn intend(&mut self, intention: Intention) -> Result<(), WearerError> {
        let now = self.time();
        self.wearer.as_mut().ok_or(WearerError::NotWorn)?.intend(intention, now)
    }

    /// True state of the wearer now, if any.
    pub fn wearer_truth(&self) -> Option<WearerTruth> {
        self.wearer.as_ref().map(|wearer| wearer.truth(&self.state))
    }
}

impl<const N: usize> World<N> {
    /// Start of the present servo tick, s.
    pub(super) fn time(&self) -> f64 {
        self.tick as f64 * TICK_S
    }

    /// Decides the wearer's muscle torque of the servo tick that begins now.
    pub(super) fn decide_muscles(&mut self) {
        let now = self.time();
        if let Some(wearer) = &mut self.wearer {
            wearer.decide(self.tick, now);
        }
    }
}

/// Advances leg and wearer by `duration` s under a torque (N m, joint sign) that changes linearly.
pub(super) fn advance<const N: usize>(
    leg: &Leg<N>,
    wearer: &mut Option<Wearer>,
    state: &mut LegState<N>,
    [from, to]: [&[f64; N]; 2],
    duration: f64,
) {
    match wearer {
        Some(wearer) => wearer.advance(leg, state, [from, to], duration),
        None => leg.advance(state, from, to, duration),
    }
}
