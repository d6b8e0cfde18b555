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
//! Value, velocity and acceleration have one common delay, 2 z / w = 4.4 ms for f = 50 Hz.
//!
//! [`LedAcceleration`] makes up for a part of it: the acceleration plus [`LEAD_S`] of its change, which is
//! low-passed at 60 Hz.
//!
//! | acceleration | delay below 10 Hz | noise of the default leg's encoder, 15 urad per count |
//! | --- | --- | --- |
//! | 50 Hz | 4.4 ms | 0.17 rad/s^2 |
//! | 50 Hz, led | 1.5 ms | 0.35 rad/s^2 |
//! | 80 Hz, for comparison | 2.8 ms | 0.43 rad/s^2 |
//! | 50 Hz, led without its low-pass, for comparison | 1.4 ms | 1.6 rad/s^2 |
//!
//! Source: trapezoidal integration of the state-variable filter, V. Zavalishin, The Art of VA Filter Design,
//! 2012, chapter 4. Cost: about 15 operations.

use crate::servo::{LOG_RATE_HZ, SERVO_RATE_HZ};

/// Damping ratio.
const DAMPING_RATIO: f32 = 0.7;

/// Constants of a filter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gains {
    g: f32,
    w: f32,
    scale: f32,
}

impl Gains {
    /// 50 Hz at the servo's rate: g = tan(pi 50 / 4000).
    pub(crate) const TICK: Self = Self::new(0.039_290_11, SERVO_RATE_HZ);
    /// 50 Hz at the log's rate: g = tan(pi 50 / 500).
    pub(crate) const LOG: Self = Self::new(0.324_919_7, LOG_RATE_HZ);

    const fn new(g: f32, rate_hz: u32) -> Self {
        let scale = 1.0 / (1.0 + 2.0 * DAMPING_RATIO * g + g * g);
        Self { g, w: 2.0 * g * rate_hz as f32, scale }
    }
}

/// Low-passed value with its derivatives, per s and per s^2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Derivatives {
    /// Low-passed value.
    pub(crate) value: f32,
    /// First derivative.
    pub(crate) first: f32,
    /// Second derivative.
    pub(crate) second: f32,
}

/// State of the filter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Differentiator {
    band: f32,
    low: f32,
}

impl Differentiator {
    /// Filter at rest at a value.
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

/// Lead of the acceleration, s.
pub const LEAD_S: f32 = 0.003;
/// Share of a new value in the low-pass of the lead: 1 - exp(-2 pi 60 / 4000).
const NEW: f32 = 0.089_942;

/// Acceleration of a joint at the servo's rate, with a lead.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LedAcceleration {
    filter: Differentiator,
    last: f32,
    /// Low-passed change of the acceleration, rad/s^3.
    jerk: f32,
}

impl LedAcceleration {
    /// Filter at rest at an angle, rad.
    pub const fn at(angle: f32) -> Self {
        Self { filter: Differentiator::at(angle), last: 0.0, jerk: 0.0 }
    }

    /// Takes an angle (rad); returns the acceleration, rad/s^2.
    pub fn push(&mut self, angle: f32) -> f32 {
        let now = self.filter.push(&Gains::TICK, angle).second;
        let jerk = (now - core::mem::replace(&mut self.last, now)) * SERVO_RATE_HZ as f32;
        self.jerk += NEW * (jerk - self.jerk);
        now + LEAD_S * self.jerk
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::sin_cos;

    const BOTH: [(Gains, f64, f64); 2] = [(Gains::TICK, 50.0, 4000.0), (Gains::LOG, 50.0, 500.0)];

    #[test]
    fn the_constants_are_tangents_of_the_corners() {
        for (gains, corner, rate) in BOTH {
            let (sine, cosine) = sin_cos(core::f64::consts::PI * corner / rate);
            assert!((sine / cosine - f64::from(gains.g)).abs() < 1e-6);
        }
    }

    /// Delay of value, velocity and acceleration, s.
    fn delay_s(gains: &Gains) -> f64 {
        f64::from(2.0 * DAMPING_RATIO / gains.w)
    }

    #[test]
    fn derivatives_of_a_slow_sine_are_its_own_delayed() {
        let rate = core::f64::consts::TAU * 1.5;
        for (gains, _, sampling) in BOTH {
            let mut filter = Differentiator::at(0.0);
            for sample in 0..4 * sampling as u32 {
                let time = f64::from(sample) / sampling;
                let found = filter.push(&gains, sin_cos(rate * time).0 as f32);
                let (sine, cosine) = sin_cos(rate * (time - delay_s(&gains)));
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
    fn a_led_acceleration_is_late_by_half_as_much() {
        let rate = core::f64::consts::TAU * 4.0;
        let mut led = LedAcceleration::at(0.0);
        let delay = delay_s(&Gains::TICK) - f64::from(LEAD_S);
        for tick in 0..8000 {
            let time = f64::from(tick) / f64::from(SERVO_RATE_HZ);
            let found = f64::from(led.push(sin_cos(rate * time).0 as f32)) / (rate * rate);
            let expected = -sin_cos(rate * (time - delay)).0;
            // The gain of a lead rises with the square of its phase: (25 / s 3 ms)^2 / 2 is 0.3 %.
            assert!(time < 0.2 || (found - expected).abs() < 0.01, "{time}: {found} against {expected}");
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
