//! Rules of the adaptive beetle swarm: whiskers share a frame, learn a metric and retreat from bad moves.
//!
//! The main mechanism: the whiskers of the best beetles together make a Newton step in the subspace of their
//! frame, in a metric they learn. The velocity of Eq. (19), with one pair of random numbers for a beetle,
//! contributes little: it shortens the way along Rosenbrock's valley and into Ackley's cone. In order of
//! importance:
//! 1. Shared scent: every beetle steps along all directions of the frame, not only along its own.
//! 2. Learned metric: measured curvature stretches it; disabled where readings are not convex (ripples).
//! 3. Retreat: a move to a value worse than the previous one and the personal best is undone.
//!
//! Move of beetle i at x_i (frame.rs has s_j, d_j, w_j):
//!   q_ij  = clip(s_j - w_j.(x_i - x_j)) om_i for j != i, q_ii = s_i
//!   psi_i = sum_j q_ij d_j
//!   x_i   = x_i + lambda v_i + (1 - lambda) psi_i        (Eq. 29 with this psi), at most 2 % outside the box
//! om_i is the trust in the other beetles' whiskers: 1.6 om for every second beetle, om / 1.6 for the others.
//! Pairs are compared after the move, and om follows the better. The min(2 n, N) best beetles move; the best
//! n = min(N, D) have whiskers. In few dimensions most evaluations would otherwise move bad beetles. Whisker
//! length follows the steps, within limits (learning.rs). Without progress for `patience` rounds the swarm
//! leaps (leap.rs); if leaps bring nothing it is scattered again. `docs/bso.md` has the whole algorithm as
//! pseudocode, with the contribution of each part.
//!
//! Source: own experiments on test functions and identification problems. Taken from the beetle swarm: x, v,
//! P, G, Eq. (19), two whiskers, the weighted move.
//! Cost: 2 n + min(2 n, N) evaluations per round, which is an iteration where 4 n >= N; `docs/bso.md` counts
//! the rest. Up to six square roots per direction are the only calls into `libm`.
//! Known limits: the search exploits fast. Only leaps and restarts search globally; a leap assumes ripples on
//! a convex envelope. On a quadratic cost least squares is exact and
//! instant. A noise of 1e-4 of the cost's value corrupts the last digits: the search is meant for fixed data.

use crate::real::{Real, clamp, dot, max, min, sqrt};

use super::super::particles::{Particles, VelocityRule};
use super::super::random::Random;
use super::super::rows::{add_scaled, live, live_mut};
use super::super::search::is_usable;
use super::frame::{Frame, Reach};
use super::leap::{Leap, leap_whisker};
use super::metric::Metric;
use super::rules::{Opening, Rules, Side};
use super::settings::{AdaptiveSettings, Part};

/// Whisker length of a scattered swarm, metric coordinates.
const FIRST_WHISKER: f64 = 0.1;
/// Trust in other beetles' whiskers: first value, and factor between the two levels that are compared.
const FIRST_TRUST: f64 = 0.3;
const TRUST_LEVELS: f64 = 1.6;
/// Largest distance of a beetle outside the box (it is evaluated at the nearest point inside).
const MARGIN: f64 = 0.02;
/// Moving beetles per beetle with whiskers: a round has as many whisker evaluations as moves.
const MOVES_PER_READER: usize = 2;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct AdaptiveRules<T, const N: usize, const D: usize> {
    pub(super) settings: AdaptiveSettings<T>,
    pub(super) frame: Frame<T, N, D>,
    pub(super) metric: Metric<T, D>,
    /// Gradient of the latest frame, box coordinates; `None` before the first.
    pub(super) gradient: Option<[T; D]>,
    /// Usual whisker length, metric coordinates.
    pub(super) whisker: T,
    /// Trust om.
    pub(super) trust: T,
    /// Smoothed share of convex readings; `None` before the first.
    pub(super) convex_share: Option<T>,
    /// Decrease of the cost that the parabolas predict for the steps psi of this round.
    pub(super) predicted: T,
    /// Rounds since the swarm was scattered or landed, including the current one.
    pub(super) round: u32,
    pub(super) leap: Leap<T, D>,
    /// Best value that counted as progress, and the rounds since.
    progress: T,
    waited: u32,
}

impl<T: Real, const N: usize, const D: usize> AdaptiveRules<T, N, D> {
    pub fn new(settings: AdaptiveSettings<T>, dimension: usize) -> Self {
        Self {
            settings,
            frame: Frame::new(dimension),
            metric: Metric::identity(dimension),
            gradient: None,
            whisker: T::from_double(FIRST_WHISKER),
            trust: T::from_double(FIRST_TRUST),
            convex_share: None,
            predicted: T::zero(),
            leap: Leap::none(),
            round: 0,
            progress: T::LARGEST,
            waited: 0,
        }
    }

    /// Discards all learned values, when the swarm is scattered again or has leapt.
    pub(super) fn forget(&mut self) {
        self.metric.forget();
        self.gradient = None;
        self.whisker = T::from_double(FIRST_WHISKER);
        self.trust = T::from_double(FIRST_TRUST);
        self.convex_share = None;
        self.round = 0;
        self.progress = T::LARGEST;
        self.waited = 0;
    }

    /// Preferred direction of a beetle: downhill for the first. Some follow the difference of two personal
    /// bests (such differences point into narrow valleys); the others have none.
    fn proposal(&self, beetle: usize, beetles: &Particles<T, N, D>, random: &mut Random) -> Option<[T; D]> {
        match beetle {
            _ if self.leap.under_way => None,
            0 if self.has(Part::GradientDirection) => {
                self.gradient.map(|gradient| self.metric.gradient_to_metric(&gradient))
            }
            1.. if beetle <= self.settings.pair_directions => {
                let one = &beetles.personal_best[random.below(self.movers()).min(N - 1)];
                let other = &beetles.personal_best[random.below(self.movers()).min(N - 1)];
                let mut difference = *one;
                let dimension = beetles.dimension();
                add_scaled(live_mut(&mut difference, dimension), -T::one(), live(other, dimension));
                Some(self.metric.to_metric(&difference))
            }
            _ => None,
        }
    }

    fn reach(&self) -> Reach<T> {
        Reach {
            whisker: self.whisker,
            limit: self.settings.step_limit,
            parabola: self.has(Part::Parabola),
            long: None,
        }
    }

    /// Number m of beetles that move in a round without a leap.
    fn movers(&self) -> usize {
        if self.has(Part::BestMove) { N.min(MOVES_PER_READER * self.frame.count()) } else { N }
    }

    pub(super) fn has(&self, part: Part) -> bool {
        self.settings.without != Some(part)
    }

    /// Trust om_i: beetles alternate between more and less trust.
    fn trust_of(&self, beetle: usize) -> T {
        if !self.has(Part::TrustAdaptation) {
            return T::one();
        }
        let levels = T::from_double(TRUST_LEVELS);
        let trust = if self.trusts_more(beetle) { self.trust * levels } else { self.trust / levels };
        min(trust, T::one())
    }

    pub(super) fn trusts_more(&self, beetle: usize) -> bool {
        (beetle as u32 ^ self.round) & 1 == 0
    }

    /// Step psi_i, box coordinates, and the decrease of the cost that the parabolas predict for it.
    fn scent(&self, beetle: usize, position: &[T; D], dimension: usize) -> ([T; D], T) {
        let (mut psi, mut decrease) = ([T::zero(); D], T::zero());
        let trust = self.trust_of(beetle);
        let count = self.frame.count();
        let directions = self.frame.covector.iter().zip(&self.frame.displacement);
        for (index, ((covector, displacement), whisker)) in
            directions.zip(&self.frame.whisker).take(count).enumerate()
        {
            let Some(reading) = whisker.reading else { continue };
            let (offset, step) = if index == beetle {
                (T::zero(), reading.step)
            } else if !self.has(Part::Sharing) {
                continue;
            } else {
                let offset = dot(live(covector, dimension), live(position, dimension)) - whisker.coordinate;
                let longest = self.settings.step_limit / whisker.box_length;
                (offset, clamp(reading.step - offset, -longest, longest) * trust)
            };
            decrease -= step * (reading.slope + reading.curvature * (offset + step * T::from_double(0.5)));
            add_scaled(live_mut(&mut psi, dimension), step, live(displacement, dimension));
        }
        (psi, decrease)
    }
}

impl<T: Real, const N: usize, const D: usize> Rules<T, N, D> for AdaptiveRules<T, N, D> {
    fn open(&mut self, beetles: &mut Particles<T, N, D>) -> Opening {
        if self.has(Part::Ranking) {
            beetles.sort();
        }
        let best = beetles.personal_best_value[beetles.leader().min(N - 1)];
        if self.progress - best > self.leap.least_progress(best) {
            self.progress = best;
            self.waited = 0;
        } else {
            self.waited += 1;
            if self.waited >= self.settings.patience {
                if !self.leaps_from(best) {
                    self.forget();
                    return Opening::Scatter;
                }
                self.gather(beetles);
            }
        }
        self.round = self.round.wrapping_add(1);
        self.predicted = T::zero();
        Opening::Search
    }

    fn whiskered(&self) -> usize {
        self.frame.count()
    }

    fn moved(&self) -> usize {
        if self.leap.under_way { N } else { self.movers() }
    }

    fn aim(&mut self, beetle: usize, beetles: &Particles<T, N, D>, random: &mut Random) {
        let mut reach = self.reach();
        if self.leap.under_way {
            reach.long = Some(leap_whisker(random));
        }
        let proposal = self.proposal(beetle, beetles, random);
        let position = &beetles.position[beetle.min(N - 1)];
        self.frame.aim(beetle, proposal, position, &self.metric, reach, random);
        if let (1.., Some(pair)) = (beetle, proposal) {
            self.frame.whisker[beetle.min(N - 1)].distance = sqrt(dot(&pair, &pair));
        }
    }

    fn tip(&self, beetle: usize, side: Side, beetles: &Particles<T, N, D>) -> [T; D] {
        let beetle = beetle.min(N - 1);
        let dimension = beetles.dimension();
        let length = self.frame.whisker[beetle].length;
        let signed = if side == Side::Right { length } else { -length };
        let mut tip = beetles.position[beetle];
        add_scaled(live_mut(&mut tip, dimension), signed, live(&self.frame.displacement[beetle], dimension));
        tip
    }

    fn smell(&mut self, beetle: usize, beetles: &Particles<T, N, D>, right: T, left: T) {
        let centre = beetles.value[beetle.min(N - 1)];
        self.frame.read(beetle, centre, right, left, self.reach());
    }

    fn displace(&mut self, beetle: usize, beetles: &mut Particles<T, N, D>, random: &mut Random) {
        let beetle = beetle.min(N - 1);
        let dimension = beetles.dimension();
        if self.leap.under_way {
            if beetle == 0 {
                self.learn_gradient(dimension);
                self.aim_leap(&beetles.position[beetle]);
            }
            self.leap.to(live_mut(&mut beetles.position[beetle], dimension), random);
            return;
        }
        let (psi, decrease) = self.scent(beetle, &beetles.position[beetle], dimension);
        if is_usable(beetles.value[beetle]) {
            self.predicted += decrease;
        }
        let rule = VelocityRule {
            inertia_weight: self.settings.inertia_weight,
            individual_learning: self.settings.individual_learning,
            global_learning: self.settings.global_learning,
            limit: self.settings.velocity_limit,
            per_coordinate: false,
        };
        beetles.steer(beetle, &rule, random);
        let share = self.settings.velocity_share;
        let position = live_mut(&mut beetles.position[beetle], dimension);
        add_scaled(position, share, live(&beetles.velocity[beetle], dimension));
        add_scaled(position, T::one() - share, live(&psi, dimension));
        for entry in position {
            *entry = clamp(*entry, T::from_double(-MARGIN), T::from_double(1.0 + MARGIN));
        }
    }

    fn close(&mut self, beetles: &mut Particles<T, N, D>, found: &[T]) {
        let dimension = beetles.dimension();
        if self.leap.under_way {
            self.land(beetles, found);
            return;
        }
        self.learn_trust(&beetles.value, found);
        let is_kinked = self.is_kinked(&beetles.value, found, dimension);
        for (beetle, &value) in found.iter().enumerate() {
            let worse = value > max(beetles.value[beetle], beetles.personal_best_value[beetle]);
            beetles.record(beetle, value);
            if worse && self.has(Part::Retreat) {
                beetles.retreat(beetle);
            }
        }
        self.learn_gradient(dimension);
        self.learn_metric();
        self.learn_whisker(dimension, is_kinked);
    }

    /// An iteration takes the rounds that evaluate N times. A leap restarts the count of rounds.
    fn closes_iteration(&self) -> bool {
        let evaluations = 2 * self.frame.count() + self.movers();
        self.round.is_multiple_of(N.div_ceil(evaluations.max(1)) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 6;
    const D: usize = 4;

    /// Coupled bowl with its minimum at 0.3, 0.4, 0.5, 0.6 of the box.
    fn bowl(point: &[f64; D]) -> f64 {
        let offset = |index: usize| point[index] - (0.3 + 0.1 * index as f64);
        (0..D).map(|index| square(offset(index))).sum::<f64>() + 0.5 * square(offset(0) + offset(3))
    }

    fn square(value: f64) -> f64 {
        value * value
    }

    #[test]
    fn every_beetle_finds_the_food_of_a_bowl_by_the_whiskers_of_all() {
        // With full trust and directions along the bowl's axes the shared step is
        // Newton's: one move is enough.
        let settings =
            AdaptiveSettings { velocity_share: 0.0, pair_directions: 0, ..AdaptiveSettings::default() };
        let mut rules = AdaptiveRules::<f64, N, D>::new(settings, D);
        rules.trust = TRUST_LEVELS;
        let mut random = Random::new(3);
        let mut beetles = Particles::<f64, N, D>::new(D);
        beetles.scatter(&mut random);
        for beetle in 0..N {
            beetles.record(beetle, bowl(&beetles.position[beetle]));
        }
        assert_eq!(rules.open(&mut beetles), Opening::Search);
        let half = core::f64::consts::FRAC_1_SQRT_2;
        let axes =
            [[half, 0.0, 0.0, half], [half, 0.0, 0.0, -half], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        for (beetle, axis) in axes.into_iter().enumerate() {
            let (reach, metric) = (rules.reach(), Metric::identity(D));
            rules.frame.aim(beetle, Some(axis), &beetles.position[beetle], &metric, reach, &mut random);
            let tip = |side| bowl(&rules.tip(beetle, side, &beetles));
            let (right, left) = (tip(Side::Right), tip(Side::Left));
            rules.smell(beetle, &beetles, right, left);
        }
        for beetle in 0..N {
            let position = &beetles.position[beetle];
            let within_reach = (0..D).all(|index| (position[index] - (0.3 + 0.1 * index as f64)).abs() < 0.3);
            let (before, predicted) = (beetles.value[beetle], rules.predicted);
            rules.displace(beetle, &mut beetles, &mut random);
            let decrease = before - bowl(&beetles.position[beetle]);
            assert!((rules.predicted - predicted - decrease).abs() < 1e-13, "beetle {beetle}: {decrease}");
            if within_reach {
                // Parabolas over whiskers of 0.1 leave 1e-16 / 0.01 of rounding.
                assert!(bowl(&beetles.position[beetle]) < 1e-24, "beetle {beetle}");
            }
        }
        let best = bowl(&beetles.position[0]);
        assert!(best < 1e-24, "{best:e}");
    }

    #[test]
    fn a_whisker_along_a_pair_knows_its_length_except_in_a_leap() {
        let mut random = Random::new(4);
        let mut beetles = Particles::<f64, N, D>::new(D);
        beetles.scatter(&mut random);
        for beetle in 0..N {
            beetles.record(beetle, bowl(&beetles.position[beetle]));
        }
        let distance = |one: &[f64; D], other: &[f64; D]| {
            sqrt((0..D).map(|index| square(one[index] - other[index])).sum::<f64>())
        };
        for under_way in [false, true] {
            let settings = AdaptiveSettings { pair_directions: 2, ..AdaptiveSettings::default() };
            let mut rules = AdaptiveRules::<f64, N, D>::new(settings, D);
            rules.leap.under_way = under_way;
            for beetle in 0..D {
                rules.aim(beetle, &beetles, &mut random);
            }
            for (beetle, whisker) in rules.frame.whisker.iter().take(D).enumerate() {
                let ends = &beetles.personal_best;
                let joins_two = ends.iter().any(|one| {
                    ends.iter().any(|other| (distance(one, other) - whisker.distance).abs() < 1e-15)
                });
                assert_eq!(joins_two, !under_way && (1..=2).contains(&beetle), "beetle {beetle}");
                assert!(joins_two || whisker.distance < 0.0, "{}", whisker.distance);
            }
        }
    }

    #[test]
    fn a_bad_move_is_taken_back_and_a_tolerable_one_is_kept() {
        let mut rules = AdaptiveRules::<f64, N, D>::new(AdaptiveSettings::default(), D);
        let mut random = Random::new(5);
        let mut beetles = Particles::<f64, N, D>::new(D);
        beetles.scatter(&mut random);
        for beetle in 0..N {
            beetles.record(beetle, 1.0);
        }
        let before = beetles.clone();
        // Beetle 1 is somewhere worse than its best.
        beetles.value[1] = 3.0;
        for beetle in 0..N {
            beetles.position[beetle] = [0.5; D];
        }
        rules.close(&mut beetles, &[2.0, 2.0, 0.5, 1.0, 2.0, 2.0]);
        assert_eq!(beetles.position[0], before.position[0], "worse than before and than its best");
        assert_eq!((beetles.velocity[0], beetles.value[0]), ([0.0; D], 1.0));
        assert_eq!((beetles.position[1], beetles.value[1]), ([0.5; D], 2.0), "better than before");
        assert_eq!((beetles.personal_best[2], beetles.personal_best_value[2]), ([0.5; D], 0.5));
        assert_eq!((beetles.position[3], beetles.velocity[3]), ([0.5; D], before.velocity[3]));
    }
}
