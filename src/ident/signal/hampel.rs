//! Outlier filter: replaces isolated outliers before the filter chain.
//!
//! Why before: one outlier of angle or torque corrupts every filtered row within two reaches of it; 3 %
//! outliers touch 94 % of the rows. A sample is an outlier if it lies far from its eight neighbours'
//! prediction *and* far outside their range:
//!
//! ```text
//! torque   p = median of (x[k-j] + x[k+j]) / 2, j = 1..4                     a linear trend cancels
//! angle    p = median of the parabolas through +-1, +-2; through +-3, +-4; and through -1, -2, -3
//! s        running median of |x - p|: s := s exp(+-eta), up where |x - p| > s
//! limit    L = max(FACTOR s, floor)
//! outlier  |x - p| > L  and  x outside [third smallest - L, third largest + L] of neighbours; then x := p
//! ```
//!
//! The second condition spares real steps, ramps and jittered recordings: where a signal moves steadily, each
//! sample lies within the range of its neighbours. Past neighbours are already clean, so two of the four
//! later ones may be outliers: up to three in a row are found. A longer run is not isolated and passes;
//! reweighting handles it later. At the ends of a motion neighbours are missing; there the range is widened
//! by its own width.
//!
//! | symbol | meaning | here |
//! | --- | --- | --- |
//! | eta | step of the running median | 0.02; 1/n at first |
//! | FACTOR | limit over the running median; 6 medians are 4 standard deviations of x - p | 6 |
//! | floor | angle: 5e-4 rad; torque: 10 % of the running mean of its size | |
//!
//! Source: the decision filter of Hampel (1974), with pairs for trends. The scale outlives the window,
//! because a scale of eight samples alone would flag 1 % of Gaussian noise.
//! Cost: about 150 operations a value. Memory: 16 numbers a value. Delay: four samples.
//! Limits: an outlier below the limit stays; its size is that of the noise.

use crate::real::{self, Real};

/// Delay of the filter in samples: neighbours needed on each side.
pub(crate) const REACH: usize = 4;
const WINDOW: usize = 2 * REACH + 1;
const FACTOR: f64 = 6.0;
const STEP: f64 = 0.02;
/// Smallest limit for an angle, rad. A smaller error in speed is below the
/// uncertainty that a reversal leaves.
const ANGLE_FLOOR_RAD: f64 = 5e-4;
/// Smallest limit for a torque, as a share of the running mean size.
const TORQUE_FLOOR_SHARE: f64 = 0.1;
/// Neighbours trimmed at either end of their range: up to this many may be outliers.
const TRIMMED: usize = 2;

/// Kind of measured value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Smooth and almost free of noise: parabolas predict.
    Angle,
    /// Noisy: means of pairs predict.
    Torque,
}

/// One cleaned value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cleaned<T> {
    /// The sample or its replacement.
    pub value: T,
    /// True if it was replaced.
    pub outlier: bool,
}

/// The filter of one measured value.
#[derive(Clone, Debug, PartialEq)]
pub struct Hampel<T> {
    quantity: Quantity,
    /// Newest last; those before the candidate are clean.
    window: [T; WINDOW],
    filled: usize,
    /// Samples missing after the newest one, at the end of a motion ([`Self::finish`]).
    missing: usize,
    deviation: T,
    size: T,
    seen: u32,
}

impl<T: Real> Hampel<T> {
    /// A filter without samples.
    pub fn new(quantity: Quantity) -> Self {
        Self {
            quantity,
            window: [T::zero(); WINDOW],
            filled: 0,
            missing: 0,
            deviation: T::zero(),
            size: T::zero(),
            seen: 0,
        }
    }

    /// Begins a new stretch of samples; the learned scale stays.
    pub(crate) fn restart(&mut self) {
        (self.filled, self.missing) = (0, 0);
    }

    /// Takes a sample; returns the cleaned sample of four samples ago, once there is one.
    pub fn push(&mut self, sample: T) -> Option<Cleaned<T>> {
        self.shift(sample);
        self.filled = (self.filled + 1).min(WINDOW);
        (self.filled > REACH).then(|| self.clean())
    }

    /// Returns one held-back sample per call, after the last sample of a motion.
    pub fn finish(&mut self) -> Option<Cleaned<T>> {
        if self.missing >= REACH || self.missing >= self.filled {
            return None;
        }
        self.missing += 1;
        self.shift(T::zero());
        self.filled = (self.filled + 1).min(WINDOW);
        // In a motion shorter than the reach the first sample is not in the middle yet.
        if self.filled > REACH { Some(self.clean()) } else { self.finish() }
    }

    fn shift(&mut self, sample: T) {
        self.window.copy_within(1.., 0);
        if let Some(newest) = self.window.last_mut() {
            *newest = sample;
        }
    }

    fn clean(&mut self) -> Cleaned<T> {
        let value = self.window[REACH];
        // Range of the window that holds samples.
        let first = WINDOW - self.filled;
        let end = WINDOW - self.missing;
        let whole = first == 0 && end == WINDOW;
        let Some(predicted) = self.predict(first, end) else { return Cleaned { value, outlier: false } };
        let deviation = real::abs(value - predicted);
        let (floor, factor) = match self.quantity {
            Quantity::Angle => (T::from_double(ANGLE_FLOOR_RAD), T::from_double(FACTOR)),
            Quantity::Torque => (T::from_double(TORQUE_FLOOR_SHARE) * self.size, T::from_double(FACTOR)),
        };
        let limit = real::max(factor * self.deviation, floor);
        let settled = self.seen >= SETTLED;
        let (low, high) = self.range(first, end);
        let slack = if whole { limit } else { limit + (high - low) };
        let outlier = settled && deviation > limit && (value < low - slack || value > high + slack);
        if whole {
            self.learn(deviation, predicted);
        }
        let value = if outlier { predicted } else { value };
        self.window[REACH] = value;
        Cleaned { value, outlier }
    }

    fn learn(&mut self, deviation: T, predicted: T) {
        self.seen = self.seen.saturating_add(1);
        let step = real::max(T::from_double(STEP), T::one() / T::from_double(f64::from(self.seen)));
        if self.deviation > T::zero() {
            let change = real::exp(if deviation > self.deviation { step } else { -step });
            self.deviation = real::max(self.deviation * change, T::from_double(1e-9));
        } else {
            self.deviation = deviation;
        }
        self.size += (real::abs(predicted) - self.size)
            * real::max(step * T::from_double(0.1), T::one() / T::from_double(f64::from(self.seen)));
    }

    /// Prediction from the neighbours; `None` with too few.
    fn predict(&self, first: usize, end: usize) -> Option<T> {
        let at = |index: usize| self.window[index];
        if first > 0 || end < WINDOW {
            return self.extrapolate(first, end);
        }
        let mean = |distance: usize| T::from_double(0.5) * (at(REACH - distance) + at(REACH + distance));
        Some(match self.quantity {
            Quantity::Torque => {
                let mut means = [mean(1), mean(2), mean(3), mean(4)];
                sort(&mut means);
                T::from_double(0.5) * (means[1] + means[2])
            }
            Quantity::Angle => {
                let near = (T::from_double(4.0) * mean(1) - mean(2)) / T::from_double(3.0);
                let far =
                    (T::from_double(16.0) * mean(3) - T::from_double(9.0) * mean(4)) / T::from_double(7.0);
                let past = T::from_double(3.0) * (at(REACH - 1) - at(REACH - 2)) + at(REACH - 3);
                let mut all = [near, far, past];
                sort(&mut all);
                all[1]
            }
        })
    }

    /// Prediction from the longer side.
    fn extrapolate(&self, first: usize, end: usize) -> Option<T> {
        let (before, after) = (REACH - first.min(REACH), end.saturating_sub(REACH + 1));
        let side =
            |distance: usize| self.window[if before >= after { REACH - distance } else { REACH + distance }];
        if before.max(after) < 3 {
            return None;
        }
        Some(match self.quantity {
            Quantity::Angle => T::from_double(3.0) * (side(1) - side(2)) + side(3),
            Quantity::Torque => {
                let mut three = [side(1), side(2), side(3)];
                sort(&mut three);
                three[1]
            }
        })
    }

    /// The neighbours' range without its extremes.
    fn range(&self, first: usize, end: usize) -> (T, T) {
        let mut neighbours = [T::zero(); WINDOW];
        let mut count = 0;
        for index in (first..end).filter(|&index| index != REACH) {
            neighbours[count] = self.window[index];
            count += 1;
        }
        let Some(present) = neighbours.get_mut(..count) else { return (T::zero(), T::zero()) };
        sort(present);
        let trimmed = TRIMMED.min(count.saturating_sub(1) / 2);
        match (present.get(trimmed), present.get(count.saturating_sub(1 + trimmed))) {
            (Some(&low), Some(&high)) => (low, high),
            _ => (T::zero(), T::zero()),
        }
    }
}

/// Deviations to learn before any sample is replaced.
const SETTLED: u32 = 25;

/// Insertion sort: a handful of numbers.
fn sort<T: Real>(values: &mut [T]) {
    for end in 1..values.len() {
        let mut index = end;
        while index > 0 && values[index] < values[index - 1] {
            values.swap(index, index - 1);
            index -= 1;
        }
    }
}

#[cfg(test)]
mod tests;
