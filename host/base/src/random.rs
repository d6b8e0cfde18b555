//! Random numbers of one run, from the row's name and the run's seed.

use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Random generator of one run.
#[derive(Clone, Debug)]
pub struct Random(Xoshiro256PlusPlus);

impl Random {
    /// Generator for one run of one row.
    pub fn new(row: &str, seed: u64) -> Self {
        let name = row.bytes().fold(0, |name, byte| name << 8 | u64::from(byte));
        Self(Xoshiro256PlusPlus::seed_from_u64(seed ^ name << 32))
    }

    /// Uniform in 0..1 with 53 bits.
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform integer below a bound.
    pub fn below(&mut self, bound: u64) -> u64 {
        ((self.unit() * bound as f64) as u64).min(bound.saturating_sub(1))
    }

    /// Uniform between two numbers.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + self.unit() * (high - low)
    }

    /// Sum of twelve uniform numbers: mean 0, variance 1, at most 6.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }

    /// Log-uniform between two positive numbers.
    pub fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    /// 1 or -1, equally likely.
    pub fn sign(&mut self) -> f64 {
        if self.coin() { 1.0 } else { -1.0 }
    }

    /// True or false, equally likely.
    pub fn coin(&mut self) -> bool {
        self.below(2) == 1
    }
}
