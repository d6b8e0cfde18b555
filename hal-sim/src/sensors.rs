//! Encoder and current sensor of one joint, read at the same instant.
//!
//! ```text
//! counts  = nearest integer of  angle / 2 pi * counts per turn * turns per joint turn, 32 bits, wrapping
//! current = nearest step of (true current + offset + sigma * standard normal + outlier)
//! outlier = uniform in -size..=size in a share of the logged samples, constant over eight ticks, else 0
//! sigma   = sqrt(8) * noise    noise is stated for the mean of eight 4 kHz samples, as logged at 500 Hz
//! ```
//!
//! Gear and joint are rigid: inertia on the motor side is stated at the joint (`rotor_inertia`).
//! Count 0 is centred on the anatomical zero (the reference pose).
//! Known limits: no missed counts, no eccentricity, no saturation of the converter; other modules inject
//! faults.
//! Cost: one random number per joint and tick while noise is on.

use crate::description::{CurrentSensorDescription, EncoderDescription, OutlierDescription};
use crate::maths::nearest;
use core::f64::consts::{SQRT_2, TAU};
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Square root of 8: eight samples make a logged one.
const SAMPLES_PER_LOGGED_ROOT: f64 = 2.0 * SQRT_2;

/// Incremental encoder, counting from the reference pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoder {
    /// Encoder turns per joint turn.
    ratio: f64,
    counts_per_radian: f64,
}

impl Encoder {
    /// Creates an encoder.
    pub fn new(description: &EncoderDescription) -> Self {
        Self { ratio: description.ratio, counts_per_radian: description.counts / TAU }
    }

    /// Counts at an anatomical joint angle in rad.
    pub fn read(&self, angle: f64) -> i32 {
        // Dropping the upper half is the wrap of a 32-bit counter.
        nearest(self.ratio * angle * self.counts_per_radian) as i32
    }
}

/// Sensor of the torque-producing motor current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CurrentSensor {
    sigma: f64,
    offset: f64,
    step: f64,
    outliers: Option<OutlierDescription>,
    outlier: f64,
}

impl CurrentSensor {
    /// A sensor by its description.
    pub fn new(description: &CurrentSensorDescription) -> Self {
        let mut sensor = Self {
            sigma: 0.0,
            offset: description.offset,
            step: description.step,
            outliers: description.outliers,
            outlier: 0.0,
        };
        sensor.set_noise(description.noise);
        sensor
    }

    /// Sets the standard deviation of the mean of eight samples, A.
    pub(crate) fn set_noise(&mut self, noise: f64) {
        self.sigma = noise * SAMPLES_PER_LOGGED_ROOT;
    }

    /// Starts a logged sample and decides whether it is an outlier.
    pub(crate) fn begin_logged(&mut self, generator: &mut Xoshiro256PlusPlus) {
        let Some(outliers) = self.outliers else { return };
        let [chance, size]: [f64; 2] = core::array::from_fn(|_| StandardUniform.sample(generator));
        self.outlier = if chance < outliers.share { outliers.current * (2.0 * size - 1.0) } else { 0.0 };
    }

    /// Reading of a current in A.
    pub fn read(&self, current: f64, generator: &mut Xoshiro256PlusPlus) -> f64 {
        let mut reading = current + self.offset + self.outlier;
        if self.sigma > 0.0 {
            let normal: f64 = StandardNormal.sample(generator);
            reading += self.sigma * normal;
        }
        if self.step > 0.0 {
            reading = nearest(reading / self.step) as f64 * self.step;
        }
        reading
    }
}
