//! Position and velocity of a joint from its encoder counts: a second-order tracking loop.
//!
//! Why not differences of counts: at 4 kHz one count of the default leg's encoder is 0.06 rad/s, of a 14-bit
//! joint encoder 1.5 rad/s. The loop runs a model of constant velocity, plus a commanded acceleration if
//! given, and pulls it to every reading. Both poles are at `beta = exp(-w T)`, w = 2 pi times the bandwidth:
//!
//! ```text
//! predict   position += velocity T + a T^2 / 2,   velocity += a T
//! correct   e = reading - position,   position += (1 - beta^2) e,   velocity += (1 - beta)^2 / T e
//! ```
//!
//! | property | value | at 100 Hz |
//! | --- | --- | --- |
//! | position follows to -3 dB up to | 2.48 times the bandwidth | 248 Hz |
//! | velocity follows to -3 dB up to | 0.64 times the bandwidth | 64 Hz |
//! | delay of velocity | 2 / w - T/2 | 3.1 ms |
//! | delay of position | none; error at a constant acceleration a | -a / w^2 |
//! | noise of velocity per noise of reading | sqrt(2 ((1-beta)/(1+beta))^3) / T | 124 1/s |
//!
//! The observer follows a constant velocity without error, and a constant acceleration too if it is given.
//! Source: N. Morrison, Introduction to Sequential Smoothing and Prediction (1969), the
//! fading-memory filter of degree one; critically damped g-h filter in E. Brookner, Tracking and
//! Kalman Filtering Made Easy (1998).
//!
//! The state is relative to the last reading, so counts may wrap and `f32` keeps its digits anywhere.
//! Cost: 10 multiplications and additions per joint.

use super::TICK_S;
use crate::real::exp;
use crate::units::Hertz;

/// Bandwidth used by the servo. Half of it would double the delay and use up the controller's margin, twice
/// would double its noise.
pub(crate) const OBSERVER_BANDWIDTH: Hertz = Hertz(100.0);

/// Constants of the loop, for one bandwidth at the servo's rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ObserverGains {
    position: f32,
    velocity_per_s: f32,
}

impl ObserverGains {
    /// Puts both poles at the given frequency; see the module's table.
    pub fn new(bandwidth: Hertz) -> Self {
        let beta = exp(-core::f32::consts::TAU * bandwidth.0 * TICK_S);
        Self { position: 1.0 - beta * beta, velocity_per_s: (1.0 - beta) * (1.0 - beta) / TICK_S }
    }
}

/// Estimated state of one joint, in counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Observer {
    /// Last reading that was used; `None` before the first.
    reading: Option<i32>,
    /// Estimated position minus that reading, counts.
    deviation: f32,
    velocity_per_s: f32,
}

impl Observer {
    /// Runs one tick with a reading; `acceleration` is the commanded one in counts/s^2, or 0.
    pub(crate) fn update(&mut self, gains: &ObserverGains, reading: i32, acceleration: f32) {
        let Some(last) = self.reading else {
            return self.reseat(reading);
        };
        self.coast(acceleration);
        let predicted_error = self.deviation - reading.wrapping_sub(last) as f32;
        self.reading = Some(reading);
        self.deviation = predicted_error - gains.position * predicted_error;
        self.velocity_per_s -= gains.velocity_per_s * predicted_error;
    }

    /// Runs one tick without a reading.
    #[inline]
    pub(crate) fn coast(&mut self, acceleration: f32) {
        self.deviation += TICK_S * (self.velocity_per_s + 0.5 * TICK_S * acceleration);
        self.velocity_per_s += TICK_S * acceleration;
    }

    /// Moves the position to a new count; the velocity stays.
    pub(crate) fn reseat(&mut self, reading: i32) {
        self.reading = Some(reading);
        self.deviation = 0.0;
    }

    /// Estimated position in counts; exact up to 2^24.
    pub(crate) fn position_counts(&self) -> f32 {
        self.reading.unwrap_or(0) as f32 + self.deviation
    }

    /// Estimated position, rounded to a whole count.
    pub(crate) fn nearest_counts(&self) -> i32 {
        let rounded = if self.deviation < 0.0 { self.deviation - 0.5 } else { self.deviation + 0.5 };
        self.reading.unwrap_or(0).wrapping_add(rounded as i32)
    }

    /// Estimated velocity, counts/s.
    pub(crate) fn velocity_counts_per_s(&self) -> f32 {
        self.velocity_per_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::{sin_cos, sqrt};
    use crate::testing::TestRandom;
    use core::f64::consts::TAU;

    const RATE_HZ: f64 = 4000.0;
    const POLE_RAD_PER_S: f64 = TAU * 100.0;

    /// Runs a position in counts (rounded down to readings) and shows position and
    /// velocity errors of late ticks.
    fn run(ticks: u32, from: u32, path: impl Fn(f64) -> f64, mut see: impl FnMut(f64, f64, f64)) {
        let gains = ObserverGains::new(OBSERVER_BANDWIDTH);
        let mut observer = Observer::default();
        for tick in 0..ticks {
            let time = f64::from(tick) / RATE_HZ;
            observer.update(&gains, path(time).floor() as i32, 0.0);
            if tick >= from {
                let position = f64::from(observer.position_counts());
                see(time, position, f64::from(observer.velocity_counts_per_s()));
            }
        }
    }

    /// Amplitude ratio and delay of position and velocity at a frequency, by projection on whole periods.
    fn response(frequency_hz: f64) -> [(f64, f64); 2] {
        let amplitude = 1e6;
        let period_ticks = (RATE_HZ / frequency_hz).round();
        let omega = TAU * RATE_HZ / period_ticks;
        let (start, ticks) = (10 * period_ticks as u32, 20 * period_ticks as u32);
        let mut sums = [0.0; 4];
        run(
            ticks,
            start,
            |time| amplitude * sin_cos(omega * time).0,
            |time, position, velocity| {
                let (sine, cosine) = sin_cos(omega * time);
                let parts = [position * sine, position * cosine, velocity * cosine, -velocity * sine];
                for (sum, part) in sums.iter_mut().zip(parts) {
                    *sum += part * 2.0 / f64::from(ticks - start);
                }
            },
        );
        let polar = |in_phase: f64, quadrature: f64| {
            (sqrt(in_phase * in_phase + quadrature * quadrature), -crate::real::atan2(quadrature, in_phase))
        };
        let (position, velocity) = (polar(sums[0], sums[1]), polar(sums[2], sums[3]));
        [(position.0 / amplitude, position.1 / omega), (velocity.0 / (amplitude * omega), velocity.1 / omega)]
    }

    #[test]
    fn the_nearest_count_is_rounded_on_both_sides_of_the_reading() {
        for (deviation, nearest) in [(0.4, 70), (0.6, 71), (1.4, 71), (-0.4, 70), (-0.6, 69), (-1.6, 68)] {
            let observer = Observer { reading: Some(70), deviation, velocity_per_s: 0.0 };
            assert_eq!(observer.nearest_counts(), nearest, "{deviation}");
        }
    }

    #[test]
    fn position_and_velocity_follow_as_far_as_stated() {
        // The discrete loop differs from the continuous figures by some w T / 4: 4 %.
        let half_power = core::f64::consts::FRAC_1_SQRT_2;
        assert!((response(64.5)[1].0 - half_power).abs() < 0.03, "{:?}", response(64.5));
        assert!((response(250.0)[0].0 - half_power).abs() < 0.06, "{:?}", response(250.0));
    }

    #[test]
    fn velocity_is_late_by_two_over_the_pole_and_position_is_not_late() {
        let [position, velocity] = response(5.0);
        let stated = 2.0 / POLE_RAD_PER_S - 0.5 / RATE_HZ;
        // A twentieth of a tick; at 5 Hz the delay of the two poles has fallen by (5/100)^2.
        assert!((velocity.1 - stated).abs() < 0.05 / RATE_HZ + 0.0025 * stated, "{} {stated}", velocity.1);
        assert!(position.1.abs() < 0.05 / RATE_HZ, "{}", position.1);
    }

    #[test]
    fn a_constant_velocity_is_followed_without_error() {
        let velocity = 70_000.0;
        run(
            8000,
            4000,
            |time| velocity * time,
            |time, position, estimated| {
                // Readings are whole counts: on average half a count low, and noisy by that.
                assert!((position - velocity * time).abs() < 1.1, "{}", position - velocity * time);
                assert!((estimated - velocity).abs() < 1e-3 * velocity + 150.0, "{estimated}");
            },
        );
        let mut mean = 0.0;
        run(8000, 4000, |time| velocity * time, |_, _, estimated| mean += estimated / 4000.0);
        // The quantisation noise of 35 counts/s averages out over 4,000 ticks.
        assert!((mean - velocity).abs() < 2.0, "{mean}");
    }

    #[test]
    fn a_commanded_acceleration_takes_the_delay_away() {
        let gains = ObserverGains::new(OBSERVER_BANDWIDTH);
        let acceleration = 1e6;
        let lag = |given: f32| {
            let mut observer = Observer::default();
            let mut error = 0.0;
            for tick in 0..2000 {
                let time = f64::from(tick) / RATE_HZ;
                observer.update(&gains, (0.5 * acceleration * time * time) as i32, given);
                error = acceleration * time - f64::from(observer.velocity_counts_per_s());
            }
            error / acceleration
        };
        let stated = 2.0 / POLE_RAD_PER_S - 0.5 / RATE_HZ;
        // Quantisation noise of the readings: 124/s times a third of a count over 1e6 counts/s^2.
        assert!((lag(0.0) - stated).abs() < 1e-4 && lag(acceleration as f32).abs() < 1e-4);
    }

    #[test]
    fn noise_of_velocity_is_as_stated() {
        let gains = ObserverGains::new(OBSERVER_BANDWIDTH);
        let mut random = TestRandom::new(7);
        let mut observer = Observer::default();
        let (mut sum, mut square, ticks) = (0.0, 0.0, 200_000);
        for tick in 0..ticks {
            // Uniform whole numbers in -500..=500: standard deviation sqrt((1001^2 - 1) / 12).
            observer.update(&gains, (random.bits() % 1001) as i32 - 500, 0.0);
            if tick >= 1000 {
                let velocity = f64::from(observer.velocity_counts_per_s());
                sum += velocity;
                square += velocity * velocity;
            }
        }
        let deviation = sqrt(square / f64::from(ticks - 1000));
        let gain = deviation / sqrt(1001.0 * 1001.0 / 12.0);
        // 200,000 samples, correlated over some 13: 1 %, and three times that.
        assert!((gain / 124.1 - 1.0).abs() < 0.03, "{gain}");
        assert!((sum / f64::from(ticks)).abs() < 1000.0);
    }

    #[test]
    fn wrapping_counts_change_nothing() {
        let gains = ObserverGains::new(OBSERVER_BANDWIDTH);
        let (mut near, mut far) = (Observer::default(), Observer::default());
        for tick in 0..4000 {
            let counts = tick * 37;
            near.update(&gains, counts, 0.0);
            far.update(&gains, counts.wrapping_add(i32::MAX - 50_000), 0.0);
            assert_eq!(near.velocity_counts_per_s(), far.velocity_counts_per_s());
            assert_eq!(near.deviation, far.deviation);
        }
    }

    #[test]
    fn a_missing_reading_is_bridged_at_the_last_velocity() {
        let gains = ObserverGains::new(OBSERVER_BANDWIDTH);
        let mut observer = Observer::default();
        for tick in 0..4000 {
            if tick % 50 == 49 {
                observer.coast(0.0);
            } else {
                observer.update(&gains, tick * 20, 0.0);
            }
        }
        // The last tick was bridged; single precision of some 80,000 counts.
        assert!((observer.position_counts() - 79_980.0).abs() < 0.05, "{}", observer.position_counts());
        assert!((observer.velocity_counts_per_s() - 80_000.0).abs() < 1.0);
    }
}
