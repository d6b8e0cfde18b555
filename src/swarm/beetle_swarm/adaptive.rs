//! The adaptive beetle swarm: whiskers that share a frame, learn a metric and retreat from bad moves.
//!
//! What does the work, said openly: the whiskers of the best beetles together make a Newton step in the subspace
//! of their frame, in a metric they learn. The velocity of Eq. (19) is not the engine, without it the medians are
//! the same; it trims the tails. In order of weight:
//! 1. Shared scent: every beetle steps along all directions of the frame, not along its own only.
//! 2. Learned metric: measured curvature stretches it; off where readings are not convex (ripples).
//! 3. Retreat: a move that is worse than before and worse than the personal best is taken back.
//!
//! Move of beetle i at metric coordinates y_i = A^-1 x_i (frame.rs has s_j, z_j, d_j):
//!   q_ij  = clip(s_j - z_j.(y_i - y_j)) om_i for j != i, q_ii = s_i
//!   psi_i = sum_j q_ij d_j
//!   x_i   = x_i + lambda v_i + (1 - lambda) psi_i            (Eq. 29 with this psi), at most 2 % outside the box
//! om_i, the trust in the others' whiskers, is 1.6 om for every second beetle and om / 1.6 for the others; pairs are
//! compared after the move and om follows the better. Whisker length follows sqrt(D) times the median |s|.
//! Without progress for `patience` iterations the swarm is scattered anew and forgets all but its best.
//!
//! Source: own experiments on test functions and identification problems; kept of the beetle swarm: x, v, P, G,
//! Eq. (19), two whiskers, the weighted move.
//! Cost: N + 2 min(N, D) evaluations per iteration and, without them, 1 kflop (D = 2), 174 (21), 285 (28);
//! one square root per direction is the only call into `libm`.
//! Known limits: a fast exploiter. Global search is the restart only: it fails on Rastrigin's function in 10
//! dimensions, and needs more evaluations there than a particle swarm in 2. On a quadratic cost least squares is
//! exact and instant. Noise in the cost of 1e-4 of its value spoils the last digits: meant for fixed data.

use crate::real::{Real, abs, clamp, max, min, sqrt};

use super::super::particles::{Particles, VelocityRule};
use super::super::random::Random;
use super::super::rows::{add_scaled, dot, live, live_mut, median};
use super::frame::{Frame, Reach};
use super::metric::Metric;
use super::rules::{Opening, Rules, Side};
use super::settings::AdaptiveSettings;

/// Whisker length of a scattered swarm and its range, metric coordinates.
const FIRST_WHISKER: f64 = 0.1;
const SHORTEST_WHISKER: f64 = 3e-4;
const LONGEST_WHISKER: f64 = 0.3;
/// Weight of the latest iteration in whisker length and convex share.
const SMOOTHING: f64 = 0.3;
/// Trust in the others' whiskers: first value, least value, factor between the two levels that are compared, and
/// change per compared pair.
const FIRST_TRUST: f64 = 0.3;
const LEAST_TRUST: f64 = 0.02;
const TRUST_LEVELS: f64 = 1.6;
const TRUST_CHANGE: f64 = 0.1;
/// How far a beetle may stand outside the box (it is evaluated at the nearest point inside).
const MARGIN: f64 = 0.02;
/// Progress below this share of the best value does not count.
const PROGRESS: f64 = 1e-7;
/// Share of convex readings from which the metric learns; in full at 1.
const CONVEX_SHARE: f64 = 0.7;
/// How far one iteration stretches towards the measured curvature, and the range of curvature over its mean.
const METRIC_RATE: f64 = 0.7;
const LEAST_CURVATURE: f64 = 0.25;
const MOST_CURVATURE: f64 = 4.0;
/// A metric step of 1 is never stretched beyond this many boxes.
const LONGEST_AXIS: f64 = 100.0;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct AdaptiveRules<T, const N: usize, const D: usize> {
    settings: AdaptiveSettings<T>,
    frame: Frame<T, N, D>,
    metric: Metric<T, D>,
    /// Gradient of the latest frame, box coordinates; `None` before the first.
    gradient: Option<[T; D]>,
    /// Usual whisker length, metric coordinates.
    whisker: T,
    /// om.
    trust: T,
    /// Smoothed share of convex readings; `None` before the first.
    convex_share: Option<T>,
    /// Iterations since the swarm was scattered, the running one included.
    iteration: u32,
    /// The best value that counted as progress, and the iterations since.
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
            whisker: T::of(FIRST_WHISKER),
            trust: T::of(FIRST_TRUST),
            convex_share: None,
            iteration: 0,
            progress: T::LARGEST,
            waited: 0,
        }
    }

    /// As new, in place.
    pub fn restart(&mut self, settings: AdaptiveSettings<T>, dimension: usize) {
        self.settings = settings;
        self.frame.restart(dimension);
        self.metric.restart(dimension);
        self.forget();
    }

    /// Everything learned, when the swarm is scattered anew.
    fn forget(&mut self) {
        self.metric.forget();
        self.gradient = None;
        self.whisker = T::of(FIRST_WHISKER);
        self.trust = T::of(FIRST_TRUST);
        self.convex_share = None;
        self.iteration = 0;
        self.progress = T::LARGEST;
        self.waited = 0;
    }

    /// The direction a beetle would like: the first downhill, some along the difference of two personal bests
    /// (such differences point into narrow valleys), the others anywhere.
    fn wish(&self, beetle: usize, beetles: &Particles<T, N, D>, random: &mut Random) -> Option<[T; D]> {
        match beetle {
            0 => self.gradient.map(|gradient| self.metric.gradient_to_metric(&gradient)),
            _ if beetle <= self.settings.pair_directions => {
                let one = &beetles.personal_best[random.below(N).min(N - 1)];
                let other = &beetles.personal_best[random.below(N).min(N - 1)];
                let mut difference = *one;
                let dimension = beetles.dimension();
                add_scaled(live_mut(&mut difference, dimension), -T::one(), live(other, dimension));
                Some(self.metric.to_metric(&difference))
            }
            _ => None,
        }
    }

    fn reach(&self) -> Reach<T> {
        Reach { whisker: self.whisker, limit: self.settings.step_limit }
    }

    /// om_i: beetles take turns in trusting more and less.
    fn trust_of(&self, beetle: usize) -> T {
        let levels = T::of(TRUST_LEVELS);
        let trust = if self.trusts_more(beetle) { self.trust * levels } else { self.trust / levels };
        min(trust, T::one())
    }

    fn trusts_more(&self, beetle: usize) -> bool {
        (beetle as u32 ^ self.iteration) & 1 == 0
    }

    /// psi_i, box coordinates.
    fn scent(&self, beetle: usize, position: &[T; D], dimension: usize) -> [T; D] {
        let mut psi = [T::zero(); D];
        let metric_position = self.metric.to_metric(position);
        let trust = self.trust_of(beetle);
        let count = self.frame.count();
        let directions = self.frame.direction.iter().zip(&self.frame.displacement);
        for (index, ((direction, displacement), whisker)) in
            directions.zip(&self.frame.whisker).take(count).enumerate()
        {
            let Some(reading) = whisker.reading else { continue };
            let step = if index == beetle {
                reading.step
            } else {
                let at = dot(live(direction, dimension), live(&metric_position, dimension));
                let longest = self.settings.step_limit / whisker.box_length;
                clamp(reading.step - (at - whisker.coordinate), -longest, longest) * trust
            };
            add_scaled(live_mut(&mut psi, dimension), step, live(displacement, dimension));
        }
        psi
    }

    /// om follows the level whose beetles gained more, pair by pair.
    fn learn_trust(&mut self, before: &[T; N], found: &[T; N]) {
        let mut vote = T::zero();
        for pair in 0..N / 2 {
            let (even, odd) = (2 * pair, 2 * pair + 1);
            let (even_gain, odd_gain) = (before[even] - found[even], before[odd] - found[odd]);
            let (more, less) =
                if self.trusts_more(even) { (even_gain, odd_gain) } else { (odd_gain, even_gain) };
            if more > less {
                vote += T::of(TRUST_CHANGE);
            } else if more < less {
                vote -= T::of(TRUST_CHANGE);
            }
        }
        let trust =
            if vote > T::zero() { self.trust * (T::one() + vote) } else { self.trust / (T::one() - vote) };
        self.trust = clamp(trust, T::of(LEAST_TRUST), T::one());
    }

    /// Gradient in box coordinates from the slopes along the frame: A^-T sum_j g_j z_j.
    fn learn_gradient(&mut self, dimension: usize) {
        let mut gradient = [T::zero(); D];
        for (whisker, direction) in
            self.frame.whisker.iter().zip(&self.frame.direction).take(self.frame.count())
        {
            if let Some(reading) = whisker.reading {
                add_scaled(live_mut(&mut gradient, dimension), reading.slope, live(direction, dimension));
            }
        }
        self.gradient = Some(self.metric.gradient_to_box(&gradient));
    }

    /// Stretches the metric where the cost curves less than on average along the frame, and shrinks it where it
    /// curves more. Directions without a reading keep their length.
    fn learn_metric(&mut self) {
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
        let gate = (share - T::of(CONVEX_SHARE)) / T::of(1.0 - CONVEX_SHARE);
        if gate <= T::zero() || curved == 0 || read < 2 {
            return;
        }
        let mean_curvature = curvature / number(curved);
        let rate = T::of(METRIC_RATE) * gate;
        let stretch = |curvature: T| {
            let relative = clamp(curvature / mean_curvature, T::of(LEAST_CURVATURE), T::of(MOST_CURVATURE));
            T::one() + rate * (T::one() / sqrt(relative) - T::one())
        };
        let mean = readings().fold(T::zero(), |sum, reading| sum + stretch(reading.curvature)) / number(read);
        let directions = self.frame.direction.iter().zip(&self.frame.displacement);
        for (whisker, (direction, displacement)) in self.frame.whisker.iter().zip(directions).take(count) {
            let Some(reading) = whisker.reading else { continue };
            let factor = stretch(reading.curvature) / mean;
            if factor <= T::one() || factor * whisker.box_length <= T::of(LONGEST_AXIS) {
                self.metric.stretch(direction, displacement, factor);
            }
        }
    }

    /// The usual whisker follows the usual step.
    fn learn_whisker(&mut self, dimension: usize) {
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
        let length = smoothed(self.whisker, root * median);
        self.whisker = clamp(length, T::of(SHORTEST_WHISKER), T::of(LONGEST_WHISKER));
    }
}

fn smoothed<T: Real>(before: T, now: T) -> T {
    T::of(1.0 - SMOOTHING) * before + T::of(SMOOTHING) * now
}

impl<T: Real, const N: usize, const D: usize> Rules<T, N, D> for AdaptiveRules<T, N, D> {
    fn open(&mut self, beetles: &mut Particles<T, N, D>) -> Opening {
        beetles.sort();
        let best = beetles.personal_best_value[0];
        if self.progress - best > T::of(PROGRESS) * abs(best) {
            self.progress = best;
            self.waited = 0;
        } else {
            self.waited += 1;
            if self.waited >= self.settings.patience {
                self.forget();
                return Opening::Scatter;
            }
        }
        self.iteration = self.iteration.wrapping_add(1);
        Opening::Search
    }

    fn whiskered(&self) -> usize {
        self.frame.count()
    }

    fn aim(&mut self, beetle: usize, beetles: &Particles<T, N, D>, random: &mut Random) {
        let wish = self.wish(beetle, beetles, random);
        let position = &beetles.position[beetle.min(N - 1)];
        self.frame.aim(beetle, wish, position, &self.metric, self.reach(), random);
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
        let psi = self.scent(beetle, &beetles.position[beetle], dimension);
        let rule = VelocityRule {
            inertia_weight: self.settings.inertia_weight,
            individual_learning: self.settings.individual_learning,
            global_learning: self.settings.global_learning,
            limit: self.settings.velocity_limit,
        };
        beetles.steer(beetle, &rule, random);
        let share = self.settings.velocity_share;
        let position = live_mut(&mut beetles.position[beetle], dimension);
        add_scaled(position, share, live(&beetles.velocity[beetle], dimension));
        add_scaled(position, T::one() - share, live(&psi, dimension));
        for entry in position {
            *entry = clamp(*entry, T::of(-MARGIN), T::of(1.0 + MARGIN));
        }
    }

    fn close(&mut self, beetles: &mut Particles<T, N, D>, found: &[T; N]) {
        let dimension = beetles.dimension();
        self.learn_trust(&beetles.value, found);
        for (beetle, &value) in found.iter().enumerate() {
            let worse = value > max(beetles.value[beetle], beetles.personal_best_value[beetle]);
            beetles.record(beetle, value);
            if worse {
                beetles.retreat(beetle);
            }
        }
        self.learn_gradient(dimension);
        self.learn_metric();
        self.learn_whisker(dimension);
    }
}
