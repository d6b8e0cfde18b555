//! What a mode of the beetle swarm decides; the order of evaluations is the same for all and lies with the swarm.

use super::super::particles::Particles;
use super::super::random::Random;

/// One of a beetle's two whiskers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Side {
    Right,
    Left,
}

/// What the swarm does next, decided when a round opens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Opening {
    Search,
    /// Scatter the swarm anew; the rules have forgotten what they learned.
    Scatter,
}

/// The rules of one mode, called in the order of the methods; `beetle` counts from 0 in each phase.
pub(super) trait Rules<T, const N: usize, const D: usize> {
    /// Before the whiskers of a round; may reorder the beetles.
    fn open(&mut self, beetles: &mut Particles<T, N, D>) -> Opening;
    /// How many beetles put out whiskers, 1..=N.
    fn whiskered(&self) -> usize;
    /// How many beetles move, 1..=N; the first ones.
    fn moved(&self) -> usize;
    /// Chooses a beetle's whisker direction and length.
    fn aim(&mut self, beetle: usize, beetles: &Particles<T, N, D>, random: &mut Random);
    /// Tip of a whisker, box coordinates, possibly outside the box.
    fn tip(&self, beetle: usize, side: Side, beetles: &Particles<T, N, D>) -> [T; D];
    /// The values at both tips.
    fn smell(&mut self, beetle: usize, beetles: &Particles<T, N, D>, right: T, left: T);
    /// Changes a beetle's velocity and position.
    fn displace(&mut self, beetle: usize, beetles: &mut Particles<T, N, D>, random: &mut Random);
    /// The first beetles have moved; `found` holds the values at their new positions.
    fn close(&mut self, beetles: &mut Particles<T, N, D>, found: &[T]);
    /// Whether the round that was closed is the last of an iteration.
    fn closes_iteration(&self) -> bool;
}
