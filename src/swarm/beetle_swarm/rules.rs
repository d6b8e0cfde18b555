//! Decisions of a beetle swarm's mode; the swarm itself controls the order of evaluations.

use super::super::particles::Particles;
use super::super::random::Random;

/// One of a beetle's two whiskers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Side {
    Right,
    Left,
}

/// Next action of the swarm, decided when a round opens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Opening {
    Search,
    /// Scatter the swarm again; the rules have discarded what they learned.
    Scatter,
}

/// Rules of one mode, called in the order of the methods; `beetle` counts from 0 in each phase.
pub(super) trait Rules<T, const N: usize, const D: usize> {
    /// Called before the whiskers of a round; may reorder the beetles.
    fn open(&mut self, beetles: &mut Particles<T, N, D>) -> Opening;
    /// Number of beetles with whiskers, 1..=N.
    fn whiskered(&self) -> usize;
    /// Number of beetles that move, 1..=N; the first ones.
    fn moved(&self) -> usize;
    /// Chooses a beetle's whisker direction and length.
    fn aim(&mut self, beetle: usize, beetles: &Particles<T, N, D>, random: &mut Random);
    /// Tip of a whisker, box coordinates, possibly outside the box.
    fn tip(&self, beetle: usize, side: Side, beetles: &Particles<T, N, D>) -> [T; D];
    /// Takes the values at both tips.
    fn smell(&mut self, beetle: usize, beetles: &Particles<T, N, D>, right: T, left: T);
    /// Changes a beetle's velocity and position.
    fn displace(&mut self, beetle: usize, beetles: &mut Particles<T, N, D>, random: &mut Random);
    /// Called after the first beetles have moved; `found` holds the values at their new positions.
    fn close(&mut self, beetles: &mut Particles<T, N, D>, found: &[T]);
    /// True if the closed round is the last of an iteration.
    fn closes_iteration(&self) -> bool;
}
