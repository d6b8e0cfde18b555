//! Means of eight ticks of angle and torque, 500 Hz, for identification.
//!
//! Why means: eight readings of the encoder and the current carry more information than one. The mean
//! of eight (its first zero is at 500 Hz) is the first anti-alias filter of the chain that follows.
//! Angles are averaged as integers relative to the first of the eight. The mean resolves an eighth of a
//! count, and no digit is lost.
//!
//! A mean belongs to the middle of its ticks, 3.5 ticks (0.875 ms) before [`LogSample::tick`], for angle and
//! torque alike. The mean includes readings that the step gate rejects: the outlier filter has the
//! neighbouring samples.
//! Cost: some 10 operations per joint and tick.

use super::SERVO_RATE_HZ;
use super::scale::JointScale;
use crate::hal::Sample;
use crate::units::Ampere;

/// Ticks per logged sample.
pub const TICKS_PER_LOG: u32 = 8;
/// Logged samples per second.
pub const LOG_RATE_HZ: u32 = SERVO_RATE_HZ / TICKS_PER_LOG;

/// Means of [`TICKS_PER_LOG`] ticks, in the model's angles and signs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogSample<const N: usize> {
    /// Joint angles, rad.
    pub position_rad: [f32; N],
    /// Joint torques from the measured currents, N m.
    pub torque_nm: [f32; N],
    /// Sums of the eight encoder counts, modulo 2^32, with the drive's sign: the exact means.
    pub counts_sum: [i32; N],
    /// Last of the eight ticks.
    pub tick: u32,
}

/// Collects ticks into a logged sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LogAverager<const N: usize> {
    first: [i32; N],
    /// Sums of counts minus `first`.
    counts: [i32; N],
    current_a: [f32; N],
    collected: u32,
}

impl<const N: usize> LogAverager<N> {
    /// Averager without ticks.
    pub(crate) const EMPTY: Self = Self { first: [0; N], counts: [0; N], current_a: [0.0; N], collected: 0 };

    /// Takes one tick; true at every eighth.
    pub(crate) fn collect(&mut self, sample: &Sample<N>) -> bool {
        if self.collected == 0 {
            *self = Self { first: sample.joints.map(|joint| joint.encoder_counts), ..Self::EMPTY };
        }
        for (joint, reading) in sample.joints.iter().enumerate() {
            let counts = reading.encoder_counts.wrapping_sub(self.first[joint]);
            self.counts[joint] = self.counts[joint].wrapping_add(counts);
            self.current_a[joint] += reading.current.0;
        }
        self.collected += 1;
        if self.collected < TICKS_PER_LOG {
            return false;
        }
        self.collected = 0;
        true
    }

    /// Means of eight ticks, the last of which is `tick`.
    pub(crate) fn means(&self, tick: u32, scales: &[JointScale; N]) -> LogSample<N> {
        const SHARE: f32 = 1.0 / TICKS_PER_LOG as f32;
        let mean_counts = |joint: usize| self.first[joint] as f32 + self.counts[joint] as f32 * SHARE;
        let eightfold = |joint: usize| self.first[joint].wrapping_mul(TICKS_PER_LOG as i32);
        LogSample {
            position_rad: core::array::from_fn(|joint| scales[joint].position(mean_counts(joint)).0),
            torque_nm: core::array::from_fn(|joint| {
                scales[joint].torque(Ampere(self.current_a[joint] * SHARE)).0
            }),
            counts_sum: core::array::from_fn(|joint| eightfold(joint).wrapping_add(self.counts[joint])),
            tick,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scale::tests::{HIP, KNEE};
    use super::*;
    use crate::hal::JointSample;

    /// Takes one tick; every eighth returns the means.
    fn push(averager: &mut LogAverager<2>, tick: u32, sample: &Sample<2>) -> Option<LogSample<2>> {
        averager.collect(sample).then(|| averager.means(tick, &[HIP, KNEE]))
    }

    fn sample(counts: [i32; 2], current: f32) -> Sample<2> {
        Sample {
            joints: counts.map(|encoder_counts| JointSample {
                encoder_counts,
                current: Ampere(current),
                doubtful: false,
            }),
        }
    }

    #[test]
    fn means_are_exact_to_an_eighth_of_a_count() {
        let mut averager = LogAverager::EMPTY;
        // Far from the reference and moving: 1.5 million counts are 23 rad.
        let origin = 1_500_000;
        let mut logged = None;
        for tick in 0..8 {
            assert!(logged.is_none());
            let counts = origin + tick * tick;
            logged = push(&mut averager, tick as u32, &sample([counts, -counts], tick as f32));
        }
        let logged = logged.expect("eight ticks make a sample");
        // Squares of 0..=7 sum up to 140; the mean current is 3.5 A.
        assert_eq!(logged.counts_sum, [8 * origin + 140, -(8 * origin + 140)]);
        let mean = origin as f32 + 17.5;
        assert_eq!(logged.position_rad, [HIP.position(mean).0; 2]);
        assert_eq!((logged.torque_nm, logged.tick), ([5.25, -5.25], 7));
    }

    #[test]
    fn large_counts_have_means_although_their_sum_wraps() {
        let mut averager = LogAverager::EMPTY;
        let counts = [1_600_000_000, -1_600_000_000];
        let logged = (0..8).find_map(|tick| push(&mut averager, tick, &sample(counts, 0.0)));
        let expected = [HIP.position(counts[0] as f32).0, KNEE.position(counts[1] as f32).0];
        assert_eq!(logged.map(|logged| logged.position_rad), Some(expected));
    }

    #[test]
    fn a_sample_comes_every_eighth_tick_and_shares_nothing_with_the_last() {
        let mut averager = LogAverager::EMPTY;
        let mut logged = 0;
        for tick in 0..80 {
            let value = (tick / 8) as i32;
            if let Some(mean) = push(&mut averager, tick, &sample([value, 0], value as f32)) {
                assert_eq!((tick % 8, mean.counts_sum[0]), (7, 8 * value));
                assert_eq!(mean.torque_nm[0], 1.5 * value as f32);
                logged += 1;
            }
        }
        assert_eq!(logged, 10);
    }

    #[test]
    fn counts_that_wrap_within_the_eight_are_averaged_across() {
        let mut averager = LogAverager::EMPTY;
        let mut logged = None;
        for tick in 0..8 {
            let counts = (i32::MAX - 3).wrapping_add(tick);
            logged = push(&mut averager, tick as u32, &sample([counts, 0], 0.0));
        }
        let exact = 8 * i64::from(i32::MAX - 3) + 28;
        assert_eq!(logged.expect("eight ticks").counts_sum[0], exact as i32);
    }
}
