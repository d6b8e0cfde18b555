//! Learning of the adaptive beetle swarm at the end of a round: trust, gradient, metric, whisker length.
//!
//! Why separate from the moves: this learning lets one set of constants serve every function.
//!   om    grows or shrinks by 10 % per pair of beetles, as the more or the less trusting one gained more
//!   grad  = sum_j g_j w_j, the next frame's first direction
//!   al_j  = 1 + rate gate (1 / sqrt(h_j / mean h) - 1), over its mean: stretch of A along z_j; gate is 0
//!           up to 70 % of convex readings and 1 at 100 %, so that ripples have no effect
//!   l     = 0.7 l + 0.3 sqrt(D) median |s_j|: whiskers as long as the usual step average ripples of its
//!           size; at least 0.8 l, and at least 0.2 of the median distance of two personal bests (beetles
//!           far apart are in different ripples). Not shorter than before where the moves gained
//!           max(3, sqrt(D)) times the predicted decrease: there the whiskers measure a kink. 0.8 l where
//!           more than a third of the whiskers have no reading: they reach where the cost is not finite
//! Symbols as in adaptive.rs and frame.rs; h_j relative to the mean of the positive ones, limited to 1/4..4.
//!
//! Source: own experiments. Cost: 4 D^2 min(N, D) operations, the metric's; two square roots per direction.
//! Tried and rejected: no stretches below 5 % (equally many iterations, few stretches saved; at 10 % a tenth
//! more iterations); rates of 0.85 and 1, curvature limited to 1/9..9 (3 % faster on one function, longer
//! tails on another).

use crate::real::{Real, abs, clamp, max, median, sqrt};

use super::super::rows::{add_scaled, live, live_mut};
use super::super::search::is_usable;
use super::adaptive::AdaptiveRules;
use super::settings::Part;

/// Least trust in other beetles' whiskers, and its change per compared pair.
const LEAST_TRUST: f64 = 0.02;
const TRUST_CHANGE: f64 = 0.1;
/// Longest usual whisker, metric coordinates.
const LONGEST_WHISKER: f64 = 0.3;
/// Shortest usual whisker, metric coordinates, and its least number of roundings. In single precision a
/// longer one leaves narrow valleys: in the box it is up to [`LONGEST_AXIS`] times as long.
const SHORTEST_WHISKER: f64 = 1e-8;
const WHISKER_ROUNDINGS: f64 = 32.0;
/// Least ratio of the usual whisker length to that of the round before: the metric of a cost with a sharp
/// ridge needs time to turn to the ridge.
const LEAST_WHISKER_CHANGE: f64 = 0.8;
/// Least whisker length, share of the median distance between two personal bests in metric coordinates:
/// beetles far apart are in different ripples, and a whisker must average them.
const WHISKER_PER_DISTANCE: f64 = 0.2;
/// Share of the whiskers that must have a reading; with less the whiskers get shorter.
const LEAST_READ: f64 = 0.65;
/// Least ratio of gained to predicted decrease that shows a kink; sqrt(D) where that is more.
const LEAST_KINK: f64 = 3.0;
/// Decay per round without adaptation of the length ([`Part::WhiskerAdaptation`]).
const WHISKER_DECAY: f64 = 0.95;
/// Weight of the latest round in whisker length and convex share.
const SMOOTHING: f64 = 0.3;
/// Share of convex readings above which the metric learns; full effect at 1.
const CONVEX_SHARE: f64 = 0.7;
/// Share of one round's stretch towards the measured curvature, and the range of curvature over its mean.
const METRIC_RATE: f64 = 0.7;
const LEAST_CURVATURE: f64 = 0.25;
const MOST_CURVATURE: f64 = 4.0;
/// Longest image of a metric step of 1, in boxes.
const LONGEST_AXIS: f64 = 100.0;

impl<T: Real, const N: usize, const D: usize> AdaptiveRules<T, N, D> {
    /// Moves om towards the level whose beetles gained more, pair by pair.
    pub(super) fn learn_trust(&mut self, before: &[T; N], found: &[T]) {
        let mut vote = T::zero();
        let pairs = before.chunks_exact(2).zip(found.chunks_exact(2));
        for (before, found) in pairs {
            let ([even, odd], [even_found, odd_found]) = (before, found) else { continue };
            let (even_gain, odd_gain) = (*even - *even_found, *odd - *odd_found);
            let (more, less) =
                if self.trusts_more(0) { (even_gain, odd_gain) } else { (odd_gain, even_gain) };
            if more > less {
                vote += T::from_double(TRUST_CHANGE);
            } else if more < less {
                vote -= T::from_double(TRUST_CHANGE);
            }
        }
        let trust =
            if vote > T::zero() { self.trust * (T::one() + vote) } else { self.trust / (T::one() - vote) };
        self.trust = clamp(trust, T::from_double(LEAST_TRUST), T::one());
    }

    /// True if the moves gained far more than the parabolas predicted: along a sharp ridge the whiskers
    /// measure its kink. On a cone, where whiskers are sqrt(D) steps long, moves gain up to sqrt(D) times the
    /// prediction and whiskers must shrink with the steps.
    pub(super) fn is_kinked(&self, before: &[T; N], found: &[T], dimension: usize) -> bool {
        let moves =
            before.iter().zip(found).filter(|&(&before, &found)| is_usable(before) && is_usable(found));
        let gained = moves.fold(T::zero(), |sum, (&before, &found)| sum + (before - found));
        let ratio = max(T::from_double(LEAST_KINK), sqrt(number(dimension)));
        self.has(Part::Kink) && self.predicted > T::zero() && gained > ratio * self.predicted
    }

    /// Computes the gradient in box coordinates from the slopes along the frame: A^-T sum_j g_j z_j.
    pub(super) fn learn_gradient(&mut self, dimension: usize) {
        let mut gradient = [T::zero(); D];
        for (whisker, covector) in
            self.frame.whisker.iter().zip(&self.frame.covector).take(self.frame.count())
        {
            if let Some(reading) = whisker.reading {
                add_scaled(live_mut(&mut gradient, dimension), reading.slope, live(covector, dimension));
            }
        }
        self.gradient = Some(gradient);
    }

    /// Stretches the metric where the cost curves less than the frame's average, and shrinks it where it
    /// curves more. Directions without a reading keep their length.
    pub(super) fn learn_metric(&mut self) {
        let count = self.frame.count();
        let readings = || self.frame.whisker.iter().take(count).filter_map(|whisker| whisker.reading);
        let (mut read, mut convex, mut curved, mut curvature) = (0, 0, 0, T::zero());
        for reading in readings() {
            read += 1;
            convex += usize::from(reading.convex);
            if reading.curvature > T::zero() {
                curved += 1;
                curvature += reading.curvature;
            }
        }
        if read == 0 {
            return;
        }
        let share = number::<T>(convex) / number(read);
        let share = match self.convex_share {
            None => share,
            Some(before) => smoothed(before, share),
        };
        self.convex_share = Some(share);
        let gate = if self.has(Part::ConvexityGate) {
            (share - T::from_double(CONVEX_SHARE)) / T::from_double(1.0 - CONVEX_SHARE)
        } else {
            T::one()
        };
        if gate <= T::zero() || curved == 0 || read == 1 || !self.has(Part::Metric) {
            return;
        }
        let mean_curvature = curvature / number(curved);
        let rate = T::from_double(METRIC_RATE) * gate;
        let stretch = |curvature: T| {
            let relative = clamp(
                curvature / mean_curvature,
                T::from_double(LEAST_CURVATURE),
                T::from_double(MOST_CURVATURE),
            );
            T::one() + rate * (T::one() / sqrt(relative) - T::one())
        };
        let mean = readings().fold(T::zero(), |sum, reading| sum + stretch(reading.curvature)) / number(read);
        let frame = &self.frame;
        let images = frame.displacement.iter().zip(&frame.covector);
        for ((whisker, direction), (displacement, covector)) in
            frame.whisker.iter().zip(&frame.direction).zip(images).take(count)
        {
            let Some(reading) = whisker.reading else { continue };
            let factor = stretch(reading.curvature) / mean;
            if factor <= T::one() || factor * whisker.box_length <= T::from_double(LONGEST_AXIS) {
                self.metric.stretch(direction, displacement, covector, factor);
            }
        }
    }

    /// Moves the usual whisker length towards the usual step, at a kink not to a shorter one; shortens it
    /// where many whiskers have no reading.
    pub(super) fn learn_whisker(&mut self, dimension: usize, is_kinked: bool) {
        if !self.has(Part::WhiskerAdaptation) {
            self.whisker = limited(T::from_double(WHISKER_DECAY) * self.whisker);
            return;
        }
        let count = self.frame.count();
        let whiskers = || self.frame.whisker.iter().take(count);
        let steps = || whiskers().filter_map(|whisker| whisker.reading).map(|reading| abs(reading.step));
        let read = number::<T>(steps().count()) / number(count);
        let step = median_of::<T, N>(steps(), 1).filter(|_| read >= T::from_double(LEAST_READ));
        let Some(step) = step else {
            self.whisker = limited(T::from_double(LEAST_WHISKER_CHANGE) * self.whisker);
            return;
        };
        let distances = whiskers().map(|whisker| whisker.distance).filter(|&distance| distance >= T::zero());
        let distance = median_of::<T, N>(distances, 2).filter(|_| self.has(Part::Distance));
        let least_change = if is_kinked { T::one() } else { T::from_double(LEAST_WHISKER_CHANGE) };
        let apart = T::from_double(WHISKER_PER_DISTANCE) * distance.unwrap_or(T::zero());
        let shortest = max(least_change * self.whisker, apart);
        let usual = sqrt(number::<T>(dimension)) * step;
        self.whisker = limited(max(smoothed(self.whisker, usual), shortest));
    }
}

/// Median of at most N values; `None` of fewer than `least`.
fn median_of<T: Real, const N: usize>(values: impl Iterator<Item = T>, least: usize) -> Option<T> {
    let mut all = [T::zero(); N];
    let mut count = 0;
    for (entry, value) in all.iter_mut().zip(values) {
        *entry = value;
        count += 1;
    }
    (count >= least).then(|| median(live_mut(&mut all, count)))
}

fn number<T: Real>(count: usize) -> T {
    nalgebra::convert::<f32, T>(count as f32)
}

fn limited<T: Real>(whisker: T) -> T {
    let roundings = T::from_double(WHISKER_ROUNDINGS) * T::EPSILON;
    clamp(whisker, max(T::from_double(SHORTEST_WHISKER), roundings), T::from_double(LONGEST_WHISKER))
}

fn smoothed<T: Real>(before: T, now: T) -> T {
    T::from_double(1.0 - SMOOTHING) * before + T::from_double(SMOOTHING) * now
}

#[cfg(test)]
mod tests {
    use super::super::frame::Reading;
    use super::super::settings::AdaptiveSettings;
    use super::*;

    const N: usize = 4;
    const D: usize = 4;

    /// Rules whose whiskers were 0.1 long and measured steps of 0.001.
    fn measured() -> AdaptiveRules<f64, N, D> {
        let mut rules = AdaptiveRules::new(AdaptiveSettings::default(), D);
        for whisker in &mut rules.frame.whisker {
            whisker.reading = Some(Reading { slope: -1e-3, curvature: 1.0, step: 1e-3, convex: true });
        }
        rules
    }

    #[test]
    fn whiskers_get_shorter_with_the_steps_but_not_at_a_kink() {
        for (is_kinked, expected) in [(false, 0.08), (true, 0.1)] {
            let mut rules = measured();
            rules.learn_whisker(D, is_kinked);
            assert!(abs(rules.whisker - expected) < 1e-15, "{}", rules.whisker);
        }
    }

    #[test]
    fn whiskers_get_shorter_where_more_than_a_third_has_no_reading() {
        for (unread, expected) in [(1, 0.14), (2, 0.08), (N, 0.08)] {
            let mut rules = measured();
            for (index, whisker) in rules.frame.whisker.iter_mut().enumerate() {
                whisker.distance = 0.7;
                whisker.reading = whisker.reading.filter(|_| index >= unread);
            }
            rules.learn_whisker(D, true);
            assert!(abs(rules.whisker - expected) < 1e-15, "{unread}: {}", rules.whisker);
        }
    }

    #[test]
    fn directions_without_a_reading_do_not_make_the_cost_rippled() {
        let mut rules = measured();
        rules.frame.whisker[0].reading = None;
        rules.frame.whisker[1].reading = None;
        rules.learn_metric();
        assert_eq!(rules.convex_share, Some(1.0));
    }

    #[test]
    fn whiskers_reach_a_fifth_of_the_way_to_the_other_beetles() {
        for (distances, expected) in
            [([-1.0, 0.7, 0.0, 20.0], 0.14), ([-1.0, 0.7, -1.0, -1.0], 0.08), ([-1.0; N], 0.08)]
        {
            let mut rules = measured();
            for (whisker, distance) in rules.frame.whisker.iter_mut().zip(distances) {
                whisker.distance = distance;
            }
            rules.learn_whisker(D, false);
            assert!(abs(rules.whisker - expected) < 1e-15, "{distances:?}: {}", rules.whisker);
        }
    }

    #[test]
    fn a_kink_is_a_gain_of_three_times_the_predicted_one() {
        let mut rules = measured();
        rules.predicted = 2.0;
        let before = [2.0; N];
        assert!(!rules.is_kinked(&before, &[0.0, 0.1, 1.0, 1.0], D), "gained 5.9 of 6");
        assert!(rules.is_kinked(&before, &[0.0, 0.0, 1.0, 0.9], D));
        rules.predicted = -1.0;
        assert!(!rules.is_kinked(&before, &[0.0; N], D));
    }

    #[test]
    fn values_that_are_not_finite_neither_show_nor_hide_a_kink() {
        const NOT_FINITE: f64 = f64::MAX;
        let mut rules = measured();
        rules.predicted = 2.0;
        assert!(!rules.is_kinked(&[NOT_FINITE, 2.0, 2.0, 2.0], &[0.0, 0.1, 1.0, 1.0], D));
        assert!(rules.is_kinked(&[9.0, 2.0, 2.0, 4.0], &[NOT_FINITE, 0.0, 1.0, 0.0], D));
    }
}
