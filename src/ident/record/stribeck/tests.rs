//! The bank represents any speed in its range; surplus and speed are recovered from rows.

use super::*;
use crate::ident::record::reweighting::weighted;
use crate::ident::record::rows::FilteredRows;
use crate::ident::record::window::{LARGEST_BLOCKS, Window};
use crate::testing::TestRandom;

#[test]
fn the_bank_makes_the_curve_of_any_speed_in_its_range() {
    for index in 0..=40 {
        let speed = 0.06 * real::exp(real::ln(4.0) * f64::from(index) / 40.0);
        let Combination { bank, friction } = combination(speed);
        let mut sum = 0.0;
        for step in 0..1500 {
            let velocity = 1e-3 * (0.5 + f64::from(step));
            let ratio = velocity / speed;
            let made = dot(&bank_columns(velocity), &bank) + friction[0] + friction[1] * velocity;
            let error = made - real::exp(-(ratio * ratio));
            // The accuracy that the header states, in the range that the rows cover.
            assert!(velocity < 0.03 || error.abs() < 0.033, "{error} at {velocity} rad/s for {speed}");
            sum += 1e-3 * error;
        }
        // No error is left for Coulomb friction to explain; both integrals end at 1.5 rad/s.
        assert!(sum.abs() < 1e-5, "{sum} for {speed}");
    }
}

#[test]
fn single_precision_makes_the_same_weights() {
    for speed in [0.05, 0.085, 0.17, 0.3] {
        let (single, double) = (combination(speed as f32), combination(speed));
        for (single, double) in single.bank.iter().zip(double.bank) {
            // The condition number of (S2) is some 1e4, rounding is 6e-8.
            assert!((f64::from(*single) - double).abs() < 2e-3, "{single} {double}");
        }
    }
}

#[test]
fn the_column_is_odd_and_zero_at_rest() {
    assert_eq!(bank_columns(0.0_f32), [0.0; BANK]);
    assert_eq!(bank_columns(0.1_f64), bank_columns(-0.1_f64).map(|element| -element));
}

const COLUMNS: usize = 4;
const NOISE_NM: f64 = 0.5;
const COULOMB_NM: f64 = 4.6;
const VISCOUS: f64 = 3.3;

/// Fit to 20 s of rows of a joint that swings at up to 1.2 rad/s: gravity, Coulomb, viscous, offset. The
/// least gain and surplus are those of `auto`.
fn found(surplus: f64, speed: f64, seed: u64) -> Option<(StribeckFit<f32, COLUMNS>, [f32; COLUMNS])> {
    let mut random = TestRandom::new(seed);
    let mut window = Window::<f32, 1, COLUMNS, 8192>::with_columns(COLUMNS, [Some(1), Some(2)], BANK);
    for index in 0..1000 {
        let (sine, cosine) = real::sin_cos(1.3 * 0.02 * f64::from(index));
        let velocity = 1.2 * cosine;
        if velocity.abs() < 0.03 {
            continue; // the standstill rule
        }
        let ratio = velocity / speed;
        let sign = real::sign(velocity);
        let curve = surplus * sign * real::exp(-ratio * ratio);
        let torque =
            20.0 * sine + COULOMB_NM * sign + VISCOUS * velocity + 1.0 + curve + NOISE_NM * random.normal();
        let rows = FilteredRows {
            regressor: [[sine, sign, velocity, 1.0].map(|element| element as f32)],
            stribeck: [bank_columns(velocity).map(|element| element as f32)],
            torque: [torque as f32],
            still: [0.0],
        };
        assert!(window.insert(&rows, &[true]));
    }
    let factor = weighted(&window, 0, &[1.0; LARGEST_BLOCKS]);
    let own = JointRows { factor: &factor, columns: &window.columns()[0], noise: NOISE_NM as f32 };
    let least = (SMALLEST_GAIN as f32, SMALLEST_SURPLUS_SHARE as f32 * 15.0);
    let found = strongest(&own, &Factor::new(), COLUMNS);
    let (fit, factor) = eliminate(&own, &found, least)?;
    Some((fit, factor.solve(COLUMNS)))
}

#[test]
fn surplus_and_speed_come_back_from_rows_with_the_sigma_they_claim() {
    const SEEDS: u64 = 60;
    for (surplus, speed) in [(1.8, 0.1), (3.0, 0.15), (2.5, 0.22)] {
        let (mut squares, mut biases) = ([0.0; 3], [0.0; 3]);
        for seed in 0..SEEDS {
            let (fit, values) = found(surplus, speed, seed).expect("far beyond 30 chi-square units");
            let coulomb_sigma = 0.1; // about; the mean below is what counts
            let errors = [
                (f64::from(fit.surplus(&values)) - surplus) / f64::from(fit.sigma),
                (f64::from(fit.speed) - speed) / f64::from(fit.speed_sigma),
                (f64::from(values[1]) - COULOMB_NM) / coulomb_sigma,
            ];
            for (index, error) in errors.into_iter().enumerate() {
                squares[index] += error * error / SEEDS as f64;
                biases[index] += error / SEEDS as f64;
            }
        }
        println!("{surplus} N m, {speed} rad/s: mean square {squares:.2?}, mean {biases:.2?} sigma");
        for index in 0..3 {
            // 60 squares of standard normal numbers scatter by 0.18 about one; speed and surplus are not
            // linear in the rows.
            assert!(index == 2 || (0.4..1.9).contains(&squares[index]), "{}", squares[index]);
            // Their mean scatters by 0.13; the bank's own error (3.2 % of the surplus) adds to it.
            assert!(biases[index].abs() < 0.6, "{}", biases[index]);
        }
    }
}

#[test]
fn a_joint_without_surplus_is_given_none() {
    for seed in 0..40 {
        assert!(found(0.0, 0.1, seed).is_none(), "seed {seed}");
    }
}
