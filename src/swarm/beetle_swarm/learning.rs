//! Learning of the adaptive beetle swarm at the end of a round: trust, gradient, metric, whisker length.
//!
//! Why separate from the moves: this learning lets one set of constants serve every function.
//!   om    grows or shrinks by 10 % per pair of beetles, as the more or the less trusting one gained more
//!   grad  = sum_j g_j w_j, the next frame's first direction
//!   al_j  = 1 + rate gate (1 / sqrt(h_j / mean h) - 1), over its mean: stretch of A along z_j; gate is 0
//!           up to 70 % of convex readings and 1 at 100 %, so that ripples have no effect
//!   l     = 0.7 l + 0.3 sqrt(D) median |s_j|, at least 0.8 l: whiskers as long as the usual step average
//!           ripples of its size
//! Symbols as in adaptive.rs and frame.rs; h_j relative to the mean of the positive ones, limited to 1/4..4.
//!
//! Source: own experiments. Cost: 4 D^2 min(N, D) operations, the metric's; two square roots per direction.
//! Tried and rejected: no stretches below 5 % (equally many iterations, few stretches saved; at 10 % a tenth
//! more iterations); rates of 0.85 and 1, curvature limited to 1/9..9 (3 % faster on one function, longer
//! tails on another).

use crate::real::{Real, abs, clamp, max, median, sqrt};

use super::super::rows::{add_scaled, live, live_mut};
use super::adaptive::AdaptiveRules;
use super::settings::Part;

/// Least trust in other beetles' whiskers, and its change per compared pair.
const LEAST_TRUST: f64 = 0.02;
const TRUST_CHANGE: f64 = 0.1;
/// Longest usual whisker, metric coordinates. The shortest is the root of the type's rounding: near a value
/// of 1 a shorter one measures rounding only.
const LONGEST_WHISKER: f64 = 0.3;
/// Least ratio of the usual whisker length to that of the round before: the metric of a cost with a sharp
/// ridge needs time to turn to the ridge.
const LEAST_WHISKER_CHANGE: f64 = 0.8;
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
        let (mut read, mut convex, mut curved, mut curvature) = (0_u16, 0_u16, 0_u16, T::zero());
        for reading in readings() {
            read += 1;
            convex += u16::from(reading.convex);
            if reading.curvature > T::zero() {
                curved += 1;
                curvature += reading.curvature;
            }
        }
        let number = |count: u16| nalgebra::convert::<f32, T>(f32::from(count));
        let share = number(convex) / nalgebra::convert(count as f32);
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
        if gate <= T::zero() || curved == 0 || read < 2 || !self.has(Part::Metric) {
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

    /// Moves the usual whisker length towards the usual step.
    pub(super) fn learn_whisker(&mut self, dimension: usize) {
        if !self.has(Part::WhiskerAdaptation) {
            self.whisker = limited(T::from_double(WHISKER_DECAY) * self.whisker);
            return;
        }
        let mut steps = [T::zero(); N];
        let mut read = 0;
        for whisker in self.frame.whisker.iter().take(self.frame.count()) {
            if let Some(reading) = whisker.reading {
                steps[read.min(N - 1)] = abs(reading.step);
                read += 1;
            }
        }
        if read == 0 {
            return;
        }
        let median = median(live_mut(&mut steps, read));
        let root = sqrt(nalgebra::convert::<f32, T>(dimension as f32));
        let shortest = T::from_double(LEAST_WHISKER_CHANGE) * self.whisker;
        self.whisker = limited(max(smoothed(self.whisker, root * median), shortest));
    }
}

fn limited<T: Real>(whisker: T) -> T {
    clamp(whisker, sqrt(T::EPSILON), T::from_double(LONGEST_WHISKER))
}

fn smoothed<T: Real>(before: T, now: T) -> T {
    T::from_double(1.0 - SMOOTHING) * before + T::from_double(SMOOTHING) * now
}
