//! Regular samples pass, isolated outliers do not.

use super::*;
use crate::real::sin_cos;
use crate::testing::TestRandom;

/// Normal variable by Box and Muller: the tails matter here.
fn gaussian(random: &mut TestRandom) -> f64 {
    let radius = real::sqrt(-2.0 * real::ln(1.0 - random.uniform()));
    radius * sin_cos(core::f64::consts::TAU * random.uniform()).1
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
    let mut random = TestRandom::new(1);
    let samples: Vec<f64> = (0..400_000).map(|index| torque(index) + gaussian(&mut random)).collect();
    let outlier = run(Quantity::Torque, &samples).iter().filter(|cleaned| cleaned.outlier).count();
    assert!(outlier < 40, "{outlier} of 400,000");
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
fn three_percent_of_outliers_are_found_and_leave_errors_of_the_noise() {
    let mut random = TestRandom::new(2);
    let clean: Vec<f64> = (0..100_000).map(|index| torque(index) + gaussian(&mut random)).collect();
    let hit: Vec<bool> = clean.iter().map(|_| random.uniform() < 0.03).collect();
    let samples = clean.iter().zip(&hit);
    let samples: Vec<f64> =
        samples.map(|(value, hit)| if *hit { value + random.within(30.0) } else { *value }).collect();
    let cleaned = run(Quantity::Torque, &samples);
    let (mut missed, mut false_alarms, mut squared) = (0, 0, 0.0);
    for (((cleaned, clean), sample), hit) in cleaned.iter().zip(&clean).zip(&samples).zip(&hit) {
        missed += u32::from(*hit && !cleaned.outlier && (sample - clean).abs() > 8.0);
        false_alarms += u32::from(!*hit && cleaned.outlier);
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
fn three_outliers_in_a_row_are_found_and_a_step_is_not() {
    let mut random = TestRandom::new(3);
    let mut samples: Vec<f64> = (0..4000).map(|index| torque(index) + 0.3 * gaussian(&mut random)).collect();
    for number in [1000, 1001, 1002, 2500, 2501] {
        samples[number] += 25.0;
    }
    samples.iter_mut().skip(3200).for_each(|value| *value += 25.0);
    let cleaned = run(Quantity::Torque, &samples);
    let outlier = (0..cleaned.len()).filter(|number| cleaned[*number].outlier);
    assert!(outlier.eq([1000, 1001, 1002, 2500, 2501]));
}

#[test]
fn a_smooth_angle_passes_bit_for_bit_and_an_outlier_is_replaced() {
    // 0.4 rad at 1.5 Hz on a 14-bit encoder, mean of eight readings: curvature and quantisation, no noise.
    let count = core::f64::consts::TAU / 16384.0;
    let angle = |index: usize| {
        let exact = 0.7 + 0.4 * sin_cos(core::f64::consts::TAU * 1.5 * index as f64 / 500.0).0;
        real::sign(exact) * ((exact / count * 8.0).round() * count / 8.0)
    };
    let mut samples: Vec<f64> = (0..5000).map(angle).collect();
    let untouched = run(Quantity::Angle, &samples);
    assert!(untouched.iter().zip(&samples).all(|(cleaned, sample)| cleaned.value == *sample as f32));
    for number in (200..4900).step_by(37) {
        samples[number] += 0.02;
    }
    for (number, cleaned) in run(Quantity::Angle, &samples).iter().enumerate() {
        assert_eq!(cleaned.outlier, (200..4900).contains(&number) && (number - 200) % 37 == 0, "{number}");
        // An extrapolated parabola is at most seven errors of an eighth of a count off.
        assert!((f64::from(cleaned.value) - angle(number)).abs() < count, "{number}");
    }
}
