//! Velocity and acceleration of a sampled angle: a two-pole low-pass whose states are its derivatives.
//!
//! ```text
//! H(s) = w^2 / (s^2 + 2 z w s + w^2)        x = H q,  x' = s H q,  x'' = s^2 H q
//! g = tan(w_0 T / 2),  w = 2 g / T          w = w_0 = 2 pi f at the band's edge (prewarped)
//! high = (q - (2 z + g) s1 - s2) / (1 + 2 z g + g^2)
//! band = g high + s1,   low = g band + s2,   s1 += 2 g high,   s2 += 2 g band
//! x = low,  x' = w band,  x'' = w^2 high
//! ```
//!
//! Value, velocity and acceleration have one common delay, 2 z / w.
//!
//! | use | rate | f | delay | noise of the acceleration |
//! | --- | --- | --- | --- | --- |
//! | [`Gains::TICK`]: inertia in the servo's tick | 4 kHz | 80 Hz | 2.8 ms | 0.2 rad/s^2 |
//! | [`Gains::LOG`]: effort of the wearer | 500 Hz | 50 Hz | 4.3 ms | 0.05 rad/s^2 |
//!
//! Noise is that of the default leg's encoder, 15 urad per count.
//!
//! Source: trapezoidal integration of the state-variable filter, V. Zavalishin, The Art of VA Filter Design,
//! 2012, chapter 4. Cost: about 15 operations.

use crate::servo::{LOG_RATE_HZ, SERVO_RATE_HZ};

/// Damping ratio.
const DAMPING_RATIO: f32 = 0.7;

/// Constants of a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    g: f32,
    w: f32,
    scale: f32,
}

impl Gains {
    /// 80 Hz at the servo's rate: g = tan(pi 80 / 4000).
    pub const TICK: Self = Self::new(0.062_914_67, SERVO_RATE_HZ);
    /// 50 Hz at the log's rate: g = tan(pi 50 / 500).
    pub const LOG: Self = Self::new(0.324_919_7, LOG_RATE_HZ);

    const fn new(g: f32, rate_hz: u32) -> Self {
        let scale = 1.0 / (1.0 + 2.0 * DAMPING_RATIO * g + g * g);
        Self { g, w: 2.0 * g * rate_hz as f32, scale }
    }

    /// Delay of value, velocity and acceleration, s.
    #[must_use]
    pub const fn delay_s(&self) -> f32 {
        2.0 * DAMPING_RATIO / self.w
    }
}

/// Low-passed value with its derivatives, per s and per s^2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Derivatives {
    /// Low-passed value.
    pub value: f32,
    /// First derivative.
    pub first: f32,
    /// Second derivative.
    pub second: f32,
}

/// State of the filter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Differentiator {
    band: f32,
    low: f32,
}

impl Differentiator {
    /// Filter at rest at a value.
    #[must_use]
    pub const fn at(value: f32) -> Self {
        Self { band: 0.0, low: value }
    }

    /// Takes a sample.
    pub fn push(&mut self, gains: &Gains, sample: f32) -> Derivatives {
        let Gains { g, w, scale } = *gains;
        let high = (sample - (2.0 * DAMPING_RATIO + g) * self.band - self.low) * scale;
        let band = g * high + self.band;
        let low = g * band + self.low;
        self.band += 2.0 * g * high;
        self.low += 2.0 * g * band;
        Derivatives { value: low, first: w * band, second: w * w * high }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::sin_cos;

    const BOTH: [(Gains, f64, f64); 2] = [(Gains::TICK, 80.0, 4000.0), (Gains::LOG, 50.0, 500.0)];

    #[test]
    fn the_constants_are_tangents_of_the_corners() {
        for (gains, corner, rate) in BOTH {
            let (sine, cosine) = sin_cos(core::f64::consts::PI * corner / rate);
            assert!((sine / cosine - f64::from(gains.g)).abs() < 1e-6);
        }
    }

    #[test]
    fn derivatives_of_a_slow_sine_are_its_own_delayed() {
        let rate = core::f64::consts::TAU * 1.5;
        for (gains, _, sampling) in BOTH {
            let mut filter = Differentiator::at(0.0);
            for sample in 0..4 * sampling as u32 {
                let time = f64::from(sample) / sampling;
                let found = filter.push(&gains, sin_cos(rate * time).0 as f32);
                let (sine, cosine) = sin_cos(rate * (time - f64::from(gains.delay_s())));
                if time > 0.2 {
                    let errors = [
                        f64::from(found.value) - sine,
                        f64::from(found.first) / rate - cosine,
                        f64::from(found.second) / (rate * rate) + sine,
                    ];
                    // 1e-4 of the band's edge, and the rounding of the angle: 6e-8 w^2 / rate^2.
                    assert!(errors.iter().all(|error| error.abs() < 1e-3), "{sample}: {errors:?}");
                }
            }
        }
    }

    #[test]
    fn a_filter_at_rest_stays_at_rest() {
        let mut filter = Differentiator::at(0.7);
        for _ in 0..1000 {
            let Derivatives { value, first, second } = filter.push(&Gains::LOG, 0.7);
            assert!((value - 0.7).abs() < 1e-6 && first.abs() < 1e-4 && second.abs() < 0.1);
        }
    }
}
