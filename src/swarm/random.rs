//! Seeded random numbers: a thin wrapper of xoshiro128++ for scalars of either precision.
//!
//! Why a wrapper: the crate provides the generator. The searches need uniform and bell-shaped scalars without
//! double precision, which a Cortex-M4F computes in software. Both precisions draw the same 24 bits, so a run
//! in `f64` starts from the positions of the `f32` run that it checks.
//!
//! Source: xoshiro128++ (Blackman, Vigna, 2019), seeded through SplitMix64. State 16 bytes.

use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro128PlusPlus;

use crate::real::Real;

/// 2^-24: the spacing of the uniform numbers.
const UNIFORM_SPACING: f32 = 1.0 / 16_777_216.0;

/// Random generator; a seed gives the same numbers on every machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Random(Xoshiro128PlusPlus);

impl Random {
    /// Generator that starts from a seed.
    pub fn new(seed: u64) -> Self {
        Self(Xoshiro128PlusPlus::seed_from_u64(seed))
    }

    /// Uniform number in 0 (included) to 1 (excluded), in steps of 2^-24.
    pub fn uniform<T: Real>(&mut self) -> T {
        nalgebra::convert((self.0.next_u32() >> 8) as f32 * UNIFORM_SPACING)
    }

    /// Uniform number in -1 (included) to 1 (excluded).
    pub fn signed<T: Real>(&mut self) -> T {
        let uniform: T = self.uniform();
        uniform + uniform - T::one()
    }

    /// Bell-shaped number around 0 within -2..2, variance 1/3: the sum of four uniform numbers less 2. Enough
    /// for a direction, whose length does not matter.
    pub fn bell<T: Real>(&mut self) -> T {
        let pair: T = self.uniform::<T>() + self.uniform();
        pair + self.uniform() + self.uniform() - T::from_double(2.0)
    }

    /// Uniform integer in `0..count`; 0 for a `count` of 0. Bias at most count / 2^32.
    pub fn below(&mut self, count: usize) -> usize {
        ((u64::from(self.0.next_u32()) * count as u64) >> 32) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_precisions_draw_the_same_numbers() {
        let (mut single, mut double) = (Random::new(7), Random::new(7));
        for _ in 0..1_000 {
            assert_eq!(f64::from(single.uniform::<f32>()), double.uniform::<f64>());
        }
    }

    #[test]
    fn moments_are_those_of_the_named_distributions() {
        // 100,000 draws: standard error of a mean is 0.0009 (uniform) and 0.0018
        // (bell); five of them allowed.
        let mut random = Random::new(11);
        let count = 100_000;
        let (mut uniform, mut signed, mut bell, mut bell_square) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..count {
            let value: f64 = random.uniform();
            assert!((0.0..1.0).contains(&value));
            uniform += value;
            let value: f64 = random.signed();
            assert!((-1.0..1.0).contains(&value));
            signed += value;
            let value: f64 = random.bell();
            assert!(value.abs() <= 2.0);
            bell += value;
            bell_square += value * value;
        }
        let count = f64::from(count);
        assert!((uniform / count - 0.5).abs() < 0.005);
        assert!((signed / count).abs() < 0.01);
        assert!((bell / count).abs() < 0.01);
        assert!((bell_square / count - 1.0 / 3.0).abs() < 0.01);
    }

    #[test]
    fn an_index_stays_below_its_count_and_reaches_every_value() {
        let mut random = Random::new(3);
        let mut seen = [false; 20];
        for _ in 0..2_000 {
            seen[random.below(20)] = true;
        }
        assert!(seen.iter().all(|&value| value));
        assert_eq!(random.below(0), 0);
    }
}
