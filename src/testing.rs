//! Random numbers of all tests of this crate, from fixed seeds.
//!
//! The tests in `tests/` include this file too, so that there is one generator.

use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Random generator; a seed gives the same numbers on every machine.
#[derive(Clone, Debug)]
pub(crate) struct TestRandom(Xoshiro256PlusPlus);

#[allow(dead_code, reason = "each test program uses some of these")]
impl TestRandom {
    /// Starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    /// Random bits.
    pub(crate) fn bits(&mut self) -> u32 {
        self.0.next_u32()
    }

    /// Random byte.
    pub(crate) fn byte(&mut self) -> u8 {
        self.bits() as u8
    }

    /// Uniform integer below `bound`.
    pub(crate) fn below(&mut self, bound: u64) -> u64 {
        self.0.next_u64() % bound
    }

    /// Uniform in 0..1.
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in -bound..bound.
    pub(crate) fn within(&mut self, bound: f64) -> f64 {
        (2.0 * self.uniform() - 1.0) * bound
    }

    /// Sum of twelve uniform numbers: mean 0, variance 1, at most 6.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}
