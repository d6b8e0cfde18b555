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
//! Value, velocity and acceleration have one common delay, 2 z / w = 4.4 ms for f = 50 Hz and z = 0.7. Noise
//! of the acceleration for the default leg's encoder (15 urad per count, mean of eight readings): 0.05
//! rad/s^2.
//!
//! Source: trapezoidal integration of the state-variable filter, V. Zavalishin, The Art of VA Filter Design,
//! 2012, chapter 4. Cost: about 15 operations.

use crate::servo::LOG_RATE_HZ;

/// Corner frequency, Hz. Twice would halve the delay and double the noise of the acceleration four times
/// over.
pub const CORNER_HZ: f32 = 50.0;
/// tan(pi CORNER_HZ / LOG_RATE_HZ), for 50 Hz at 500 Hz.
const G: f32 = 0.324_919_7;
/// Damping ratio.
const DAMPING_RATIO: f32 = 0.7;
const W: f32 = 2.0 * G * LOG_RATE_HZ as f32;
const SCALE: f32 = 1.0 / (1.0 + 2.0 * DAMPING_RATIO * G + G * G);

/// Delay of value, velocity and acceleration, s.
pub const DELAY_S: f32 = 2.0 * DAMPING_RATIO / W;

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
    pub fn push(&mut self, sample: f32) -> Derivatives {
        let high = (sample - (2.0 * DAMPING_RATIO + G) * self.band - self.low) * SCALE;
        let band = G * high + self.band;
        let low = G * band + self.low;
        self.band += 2.0 * G * high;
        self.low += 2.0 * G * band;
        Derivatives { value: low, first: W * band, second: W * W * high }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::sin_cos;

    #[test]
    fn the_constant_is_the_tangent_of_the_corner() {
        let (sine, cosine) = sin_cos(core::f32::consts::PI * CORNER_HZ / LOG_RATE_HZ as f32);
        assert!((sine / cosine - G).abs() < 1e-6);
    }

    #[test]
    fn derivatives_of_a_slow_sine_are_its_own_delayed() {
        let rate = core::f64::consts::TAU * 1.5;
        let mut filter = Differentiator::at(0.0);
        for sample in 0..2000 {
            let time = f64::from(sample) / f64::from(LOG_RATE_HZ);
            let found = filter.push(sin_cos(rate * time).0 as f32);
            let (sine, cosine) = sin_cos(rate * (time - f64::from(DELAY_S)));
            if sample > 100 {
                let errors = [
                    f64::from(found.value) - sine,
                    f64::from(found.first) / rate - cosine,
                    f64::from(found.second) / (rate * rate) + sine,
                ];
                // 1e-4 of the band's edge, and the rounding of the angle: 6e-8 w^2 / rate^2.
                assert!(errors.iter().all(|error| error.abs() < 3e-4), "{sample}: {errors:?}");
            }
        }
    }

    #[test]
    fn a_filter_at_rest_stays_at_rest() {
        let mut filter = Differentiator::at(0.7);
        for _ in 0..1000 {
            let Derivatives { value, first, second } = filter.push(0.7);
            assert!((value - 0.7).abs() < 1e-6 && first.abs() < 1e-4 && second.abs() < 0.1);
        }
    }
}
