//! Random numbers of one run, from the row's name and the run's seed.

use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// A run's random numbers.
#[derive(Clone, Debug)]
pub struct Dice(Xoshiro256PlusPlus);

impl Dice {
    /// Of one run of one row.
    #[must_use]
    pub fn new(row: &str, seed: u64) -> Self {
        let name = row.bytes().fold(0, |name, byte| name << 8 | u64::from(byte));
        Self(Xoshiro256PlusPlus::seed_from_u64(seed ^ name << 32))
    }

    /// 0..1 with 53 bits.
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A whole number below a bound.
    pub fn below(&mut self, bound: u64) -> u64 {
        ((self.unit() * bound as f64) as u64).min(bound.saturating_sub(1))
    }

    /// Between two numbers.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + self.unit() * (high - low)
    }

    /// Between two positive numbers, each factor as likely.
    pub fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    /// 1 or -1.
    pub fn sign(&mut self) -> f64 {
        if self.coin() { 1.0 } else { -1.0 }
    }

    /// Either.
    pub fn coin(&mut self) -> bool {
        self.below(2) == 1
    }
}
