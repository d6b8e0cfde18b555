//! Regular samples pass, isolated outliers do not.

extern crate std;

use std::vec::Vec;

use super::*;
use crate::real::sin_cos;
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

struct Dice(Xoshiro256PlusPlus);

impl Dice {
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
    /// Box and Muller: the tails matter here.
    fn normal(&mut self) -> f64 {
        let radius = real::sqrt(-2.0 * real::ln(1.0 - self.uniform()));
        radius * sin_cos(core::f64::consts::TAU * self.uniform()).1
    }
}

fn dice(seed: u64) -> Dice {
    Dice(Xoshiro256PlusPlus::seed_from_u64(seed))
}

fn run(quantity: Quantity, samples: &[f64]) -> Vec<Cleaned<f32>> {
    let mut filter = Hampel::<f32>::new(quantity);
    let mut cleaned: Vec<_> = samples.iter().filter_map(|&sample| filter.push(sample as f32)).collect();
    while let Some(last) = filter.finish() {
        cleaned.push(last);
    }
    cleaned
}

/// 12 N m at 0.5 Hz, a Coulomb step of 9 N m at every reversal.
fn torque(index: usize) -> f64 {
    let (sine, cosine) = sin_cos(core::f64::consts::TAU * 0.5 * index as f64 / 500.0);
    12.0 * sine + 4.5 * real::sign(cosine)
}

#[test]
fn gaussian_noise_with_coulomb_steps_is_touched_less_than_once_in_ten_thousand() {
    let mut dice = dice(1);
    let samples: Vec<f64> = (0..400_000).map(|index| torque(index) + dice.normal()).collect();
    let wild = run(Quantity::Torque, &samples).iter().filter(|cleaned| cleaned.wild).count();
    assert!(wild < 40, "{wild} of 400,000");
}

#[test]
fn every_sample_comes_back_once_and_in_order() {
    for count in 0..30 {
        let samples: Vec<f64> = (0..count).map(f64::from).collect();
        let values: Vec<f64> =
            run(Quantity::Torque, &samples).iter().map(|cleaned| f64::from(cleaned.value)).collect();
        assert_eq!(values, samples);
    }
}

#[test]
fn three_percent_of_wild_torques_are_found_and_leave_errors_of_the_size_of_the_noise() {
    let mut dice = dice(2);
    let clean: Vec<f64> = (0..100_000).map(|index| torque(index) + dice.normal()).collect();
    let hit: Vec<bool> = clean.iter().map(|_| dice.uniform() < 0.03).collect();
    let samples: Vec<f64> = clean
        .iter()
        .zip(&hit)
        .map(|(value, hit)| if *hit { value + 30.0 * (2.0 * dice.uniform() - 1.0) } else { *value })
        .collect();
    let cleaned = run(Quantity::Torque, &samples);
    let (mut missed, mut false_alarms, mut squared) = (0, 0, 0.0);
    for (((cleaned, clean), sample), hit) in cleaned.iter().zip(&clean).zip(&samples).zip(&hit) {
        missed += u32::from(*hit && !cleaned.wild && (sample - clean).abs() > 8.0);
        false_alarms += u32::from(!*hit && cleaned.wild);
        let error = f64::from(cleaned.value) - clean;
        squared += error * error / 100_000.0;
    }
    // About 2,200 lie beyond eight standard deviations; the few missed stand in clusters.
    assert!(missed < 25, "{missed} missed");
    assert!(false_alarms < 20, "{false_alarms} false alarms");
    // Uncleaned the mean square is 0.03 * 30^2 / 3 = 9; the noise alone is 1.
    assert!(squared < 0.15, "mean square error {squared}");
}

#[test]
fn three_wild_values_in_a_row_are_found_and_a_step_is_not() {
    let mut dice = dice(3);
    let mut samples: Vec<f64> = (0..4000).map(|index| torque(index) + 0.3 * dice.normal()).collect();
    for place in [1000, 1001, 1002, 2500, 2501] {
        samples[place] += 25.0;
    }
    samples.iter_mut().skip(3200).for_each(|value| *value += 25.0);
    let wild: Vec<usize> = run(Quantity::Torque, &samples)
        .iter()
        .enumerate()
        .filter_map(|(place, cleaned)| cleaned.wild.then_some(place))
        .collect();
    assert_eq!(wild, [1000, 1001, 1002, 2500, 2501]);
}

#[test]
fn a_smooth_angle_passes_bit_for_bit_and_a_wild_one_is_put_back_where_it_was() {
    // 0.4 rad at 1.5 Hz on a 14-bit encoder, mean of eight readings: curvature and quantisation, no noise.
    let count = core::f64::consts::TAU / 16384.0;
    let angle = |index: usize| {
        let exact = 0.7 + 0.4 * sin_cos(core::f64::consts::TAU * 1.5 * index as f64 / 500.0).0;
        real::sign(exact) * ((exact / count * 8.0).round() * count / 8.0)
    };
    let mut samples: Vec<f64> = (0..5000).map(angle).collect();
    let untouched = run(Quantity::Angle, &samples);
    assert!(untouched.iter().zip(&samples).all(|(cleaned, sample)| cleaned.value == *sample as f32));
    for place in (200..4900).step_by(37) {
        samples[place] += 0.02;
    }
    for (place, cleaned) in run(Quantity::Angle, &samples).iter().enumerate() {
        assert_eq!(cleaned.wild, (200..4900).contains(&place) && (place - 200) % 37 == 0, "{place}");
        // An extrapolated parabola is at most seven errors of an eighth of a count off.
        assert!((f64::from(cleaned.value) - angle(place)).abs() < count, "{place}");
    }
}
