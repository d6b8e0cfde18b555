//! Leap of a stuck swarm: very long whiskers read the slope below the ripples, and all beetles follow it.
//!
//! Why: a converged swarm sits in one of many minima, and a scattered swarm falls into another one. From the
//! bottom of a ripple, ripples look alike to both sides. They cancel in f_r - f_l for whiskers of any length,
//! and the slope of the funnel remains. They do not cancel in the curvature, which comes out too large. A
//! leap is therefore too short rather than too long; several leaps reach the funnel's bottom.
//!
//! One round, otherwise like any other (frame.rs, adaptive.rs):
//!   z_j   along coordinate (j + round) mod D, each whisker L long with L uniform in 0.15..0.4 of the box
//!   x_i   = the usual move with full trust, and up to 2 % of the box at random
//! No beetle retreats; personal bests restart where the beetles land; all learned values are discarded. A
//! leap succeeds if the next standstill is better by 1e-3 of its value. After more than `leaps` failures in a
//! row the swarm is scattered.
//!
//! Source: own experiments; hopping between minima is from Wales, Doye (1997), the coarse
//! scale from homotopy methods.
//! Cost: nothing until progress has stopped, then 2 min(N, D) + N evaluations: all beetles leap.
//! Known limits: axes. Along other directions ripples of several coordinates add up in the curvature, and a
//! leap comes out too short: the swarm does not leave rotated ripples in 10 dimensions. Ripples that are not
//! symmetric about their minima do not cancel.

use crate::real::{Real, abs, min};

use super::super::particles::Particles;
use super::super::random::Random;
use super::adaptive::AdaptiveRules;

/// Shortest whisker of a leap and the range above it, box coordinates.
const LEAP_WHISKER: f64 = 0.15;
const LEAP_WHISKER_RANGE: f64 = 0.25;
/// Random landing distance of a beetle from its target, box coordinates.
pub(super) const LEAP_SPREAD: f64 = 0.02;
/// Least relative improvement of a standstill for a successful leap.
const LEAP_PROGRESS: f64 = 1e-3;

/// State of the leaps since the swarm was scattered.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Leap<T> {
    /// True while the current round is a leap.
    pub(crate) under_way: bool,
    /// Best standstill so far.
    best: T,
    /// Failed leaps in a row.
    in_vain: u32,
}

impl<T: Real> Leap<T> {
    pub(crate) fn none() -> Self {
        Self { under_way: false, best: T::LARGEST, in_vain: 0 }
    }
}

/// Whisker length of a leap, box coordinates.
pub(super) fn leap_whisker<T: Real>(random: &mut Random) -> T {
    T::from_double(LEAP_WHISKER) + T::from_double(LEAP_WHISKER_RANGE) * random.uniform()
}

impl<T: Real, const N: usize, const D: usize> AdaptiveRules<T, N, D> {
    /// Decides at a standstill with this best value: true for a leap. Otherwise the leap state is reset.
    pub(super) fn leaps_from(&mut self, best: T) -> bool {
        let led_somewhere = self.leap.best - best > T::from_double(LEAP_PROGRESS) * abs(best);
        self.leap.in_vain = if led_somewhere { 0 } else { self.leap.in_vain + 1 };
        self.leap.best = min(best, self.leap.best);
        self.leap.under_way = self.leap.in_vain <= self.settings.leaps && self.settings.leaps > 0;
        if !self.leap.under_way {
            self.leap = Leap::none();
        }
        self.leap.under_way
    }

    /// Preferred whisker direction in a leap, metric coordinates: another axis in every leap.
    pub(super) fn axis(&self, beetle: usize, dimension: usize) -> [T; D] {
        let mut axis = [T::zero(); D];
        let turn = beetle.wrapping_add(self.round as usize) % dimension.max(1);
        if let Some(entry) = axis.get_mut(turn) {
            *entry = T::one();
        }
        self.metric.to_metric(&axis)
    }

    /// Ends a leap: the landing positions replace everything that the beetles learned.
    pub(super) fn land(&mut self, beetles: &mut Particles<T, N, D>, found: &[T]) {
        self.forget();
        self.leap.under_way = false;
        beetles.personal_best_value = [T::LARGEST; N];
        for (beetle, &value) in found.iter().enumerate() {
            beetles.record(beetle, value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::settings::AdaptiveSettings;
    use super::*;

    type Rules = AdaptiveRules<f64, 4, 3>;

    #[test]
    fn so_many_leaps_in_vain_are_made_and_no_more_until_one_led_somewhere() {
        let settings = AdaptiveSettings { leaps: 2, ..AdaptiveSettings::default() };
        let mut rules = Rules::new(settings, 3);
        let standstills = [10.0, 10.0, 9.0, 9.0, 8.999, 9.5];
        let leaps = standstills.map(|best| rules.leaps_from(best));
        // 10.0 fails once, 9.0 succeeds, then two failures; the third one ends the leaps.
        assert_eq!(leaps, [true, true, true, true, true, false]);
        assert!(rules.leap == Leap::none() && rules.leaps_from(9.5), "scattered: leaps count anew");
        let mut never = Rules::new(AdaptiveSettings { leaps: 0, ..settings }, 3);
        assert!(!never.leaps_from(10.0));
    }

    #[test]
    fn whoever_has_landed_knows_only_where_it_is() {
        let mut rules = Rules::new(AdaptiveSettings::default(), 3);
        let mut random = Random::new(2);
        let mut beetles = Particles::<f64, 4, 3>::new(3);
        beetles.scatter(&mut random);
        for beetle in 0..4 {
            beetles.record(beetle, 1.0);
        }
        beetles.position[2] = [0.25, 1.5, 0.5];
        rules.leap.under_way = true;
        rules.land(&mut beetles, &[3.0, 4.0, 5.0, 6.0]);
        assert_eq!(beetles.personal_best_value, [3.0, 4.0, 5.0, 6.0]);
        assert_eq!(beetles.personal_best[2], [0.25, 1.0, 0.5], "inside the box");
        assert!(!rules.leap.under_way && rules.gradient.is_none());
    }
}
