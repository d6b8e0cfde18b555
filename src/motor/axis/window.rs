//! Means of count and current between two joint samples, over the same ticks and so for one instant.

use crate::hal::JointSample;
use crate::units::Ampere;

/// Sums since the last joint sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Window {
    first: i32,
    /// Sum of counts minus `first`.
    counts: i32,
    current_a: f32,
    pub(super) ticks: i32,
}

impl Window {
    pub(super) const EMPTY: Self = Self { first: 0, counts: 0, current_a: 0.0, ticks: 0 };
    /// Longest window, ticks. If no one reads the sample, averaging restarts.
    const MOST: i32 = 48;

    pub(super) fn push(&mut self, counts: i32, current_a: f32) {
        if self.ticks == 0 || self.ticks == Self::MOST {
            *self = Self { first: counts, ..Self::EMPTY };
        }
        self.counts += counts.wrapping_sub(self.first);
        self.current_a += current_a;
        self.ticks += 1;
    }

    pub(super) fn mean(&self) -> Option<JointSample> {
        (self.ticks > 0).then(|| JointSample {
            encoder_counts: self.first.wrapping_add(self.counts.div_euclid(self.ticks)),
            current: Ampere(self.current_a / self.ticks as f32),
            doubtful: false,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_of_counts_is_right_although_their_sum_wraps() {
        let mut window = Window::EMPTY;
        for ticks in 0..4 {
            window.push(1_600_000_000 + ticks, 2.0);
        }
        let mean = window.mean().expect("four ticks");
        assert_eq!((mean.encoder_counts, mean.current), (1_600_000_001, Ampere(2.0)));
    }
}
