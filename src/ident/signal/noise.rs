//! Noise level of the torque signal, from its own scatter, without any model.
//!
//! Why: a residual can only be judged against noise that was not estimated from that residual. Consecutive
//! samples at 500 Hz differ by noise alone, once the smooth part is removed:
//!
//! ```text
//! d_k   = x_k - 3 x_(k-1) + 3 x_(k-2) - x_(k-3)          a motion of 2 Hz leaves 1.6e-5 of its amplitude
//! var d = 20 v                                            v the variance of white noise
//! sigma = median |d| / (0.674490 sqrt 20)                 robust: steps and outliers are few
//! ```
//!
//! Five markers that move with the data give the median in constant memory (P^2 algorithm, Jain and Chlamtac
//! 1985). Cost: some 40 flops for each joint and sample. Memory: 13 numbers for each joint.
//! Known limits: the noise must be white from 5 to 250 Hz. The servo's response to encoder steps is real
//! torque but counts as noise here. Samples interpolated from another grid have lost their scatter; the
//! result is then too small.

use crate::real::{self, Real};

/// The median of a stream in five markers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Median<T> {
    heights: [T; 5],
    positions: [u32; 5],
    seen: u32,
}

impl<T: Real> Median<T> {
    fn new() -> Self {
        Self { heights: [T::zero(); 5], positions: [0, 1, 2, 3, 4], seen: 0 }
    }

    fn push(&mut self, value: T) {
        if self.seen < 5 {
            if let Some(slot) = self.heights.get_mut(self.seen as usize) {
                *slot = value;
            }
            self.seen += 1;
            if self.seen == 5 {
                sort(&mut self.heights);
            }
            return;
        }
        self.seen = self.seen.saturating_add(1);
        self.heights[0] = real::min(self.heights[0], value);
        self.heights[4] = real::max(self.heights[4], value);
        for marker in 1..5 {
            if value < self.heights[marker] || marker == 4 {
                self.positions[marker] = self.positions[marker].saturating_add(1);
            }
        }
        for marker in 1..4 {
            self.adjust(marker);
        }
    }

    /// Moves a marker by one position if it lags its quarter by one or more.
    fn adjust(&mut self, marker: usize) {
        // In whole quarters: exact for a stream of any length, without double precision on the device.
        let wanted = u64::from(self.seen - 1) * marker as u64;
        let position = u64::from(self.positions[marker]) * 4;
        let (before, after) = (self.gap(marker - 1), self.gap(marker));
        let forward = wanted >= position + 4 && after > 1;
        let backward = wanted + 4 <= position && before > 1;
        if !forward && !backward {
            return;
        }
        let step = if forward { T::one() } else { -T::one() };
        let (before, after) = (T::from_double(f64::from(before)), T::from_double(f64::from(after)));
        let (low, height, high) = (self.heights[marker - 1], self.heights[marker], self.heights[marker + 1]);
        let parabola = height
            + step / (before + after)
                * ((before + step) * (high - height) / after + (after - step) * (height - low) / before);
        self.heights[marker] = if parabola > low && parabola < high {
            parabola
        } else if forward {
            height + (high - height) / after
        } else {
            height + (low - height) / before
        };
        self.positions[marker] =
            if forward { self.positions[marker] + 1 } else { self.positions[marker].saturating_sub(1) };
    }

    /// Distance in positions from a marker to the next one.
    fn gap(&self, marker: usize) -> u32 {
        self.positions[marker + 1].saturating_sub(self.positions[marker])
    }

    /// The median; `None` before the fifth value.
    fn value(&self) -> Option<T> {
        (self.seen >= 5).then_some(self.heights[2])
    }
}

fn sort<T: Real>(values: &mut [T; 5]) {
    for end in (1..5).rev() {
        for index in 0..end {
            if values[index] > values[index + 1] {
                values.swap(index, index + 1);
            }
        }
    }
}

/// Running estimate of the standard deviation of one joint's torque noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NoiseLevel<T> {
    /// Newest first.
    last: [T; 3],
    filled: u8,
    scatter: Median<T>,
}

impl<T: Real> NoiseLevel<T> {
    /// Starts without data.
    pub fn new() -> Self {
        Self { last: [T::zero(); 3], filled: 0, scatter: Median::new() }
    }

    /// Ends a continuous stretch of samples.
    pub(crate) fn break_off(&mut self) {
        self.filled = 0;
    }

    /// Takes the next 500 Hz sample.
    pub fn push(&mut self, sample: T) {
        let [newest, middle, oldest] = self.last;
        if self.filled < 3 {
            self.filled += 1;
        } else {
            self.scatter.push(real::abs(sample - oldest + T::from_double(3.0) * (middle - newest)));
        }
        self.last = [sample, newest, middle];
    }

    /// Standard deviation of the noise of one sample; zero before the fifth difference.
    pub(crate) fn sigma(&self) -> T {
        self.scatter.value().map_or(T::zero(), |median| median / T::from_double(0.674_490 * 4.472_136))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRandom;

    fn level(signal: impl Fn(u32, f64) -> f64, samples: u32, seed: u64) -> f64 {
        let mut random = TestRandom::new(seed);
        let mut noise = NoiseLevel::<f32>::new();
        for index in 0..samples {
            noise.push(signal(index, random.normal()) as f32);
        }
        f64::from(noise.sigma())
    }

    #[test]
    fn the_level_of_white_noise_is_found_under_a_motion_steps_and_outliers() {
        for seed in 0..10 {
            let found = level(
                |index, normal| {
                    let motion = 30.0 * real::sin_cos(f64::from(index) * 0.0126).0; // 1 Hz
                    let reversal = if index % 400 < 200 { 4.0 } else { -4.0 };
                    let outlier = if index % 50 == 0 { 40.0 } else { 0.0 }; // 2 %, each in four differences
                    motion + reversal + outlier + 1.5 * normal
                },
                10_000,
                seed,
            );
            // The median of 10,000 correlated differences scatters by 1.6 %; 8 %
            // of outliers raise it by 10 %.
            assert!(found > 1.45 && found < 1.75, "{found}");
            let clean = level(|_, normal| 1.5 * normal, 10_000, seed);
            assert!((clean / 1.5 - 1.0).abs() < 0.06, "{clean}");
        }
    }

    #[test]
    fn a_marker_that_goes_back_beside_a_steep_tail_comes_down_towards_its_neighbour() {
        // The parabola through 0, 1 and 100 leads below 0, so the line to the
        // neighbour two positions before counts.
        let mut median =
            Median::<f64> { heights: [0.0, 0.0, 1.0, 100.0, 200.0], positions: [0, 1, 3, 4, 8], seen: 5 };
        median.adjust(2);
        assert_eq!((median.heights[2], median.positions[2]), (0.5, 2));
    }

    #[test]
    fn a_smooth_signal_has_no_noise_and_nothing_seen_is_zero() {
        assert_eq!(NoiseLevel::<f32>::new().sigma(), 0.0);
        let found = level(|index, _| real::sin_cos(f64::from(index) * 0.0126).0, 5_000, 1);
        // 2e-6 of curvature, 1e-7 of single precision.
        assert!(found < 1e-5, "{found}");
    }
}
