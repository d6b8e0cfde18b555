//! The bank stands for any speed in its range; surplus and speed come back from rows.

use super::*;

#[test]
fn the_bank_makes_the_curve_of_any_speed_in_its_range() {
    for index in 0..=40 {
        let speed = 0.06 * real::exp(real::ln(4.0) * f64::from(index) / 40.0);
        let Combination { bank, friction } = combination(speed);
        let mut sum = 0.0;
        for place in 0..1500 {
            let velocity = 1e-3 * (0.5 + f64::from(place));
            let ratio = velocity / speed;
            let made = dot(&bank_columns(velocity), &bank) + friction[0] + friction[1] * velocity;
            let error = made - real::exp(-(ratio * ratio));
            // What the header promises, where there are rows.
            assert!(velocity < 0.03 || error.abs() < 0.033, "{error} at {velocity} rad/s for {speed}");
            sum += 1e-3 * error;
        }
        // Nothing is left for Coulomb friction to explain; the integral ends at 1.5 rad/s in both.
        assert!(sum.abs() < 1e-5, "{sum} for {speed}");
    }
}

#[test]
fn single_precision_makes_the_same_weights() {
    for speed in [0.05, 0.085, 0.17, 0.3] {
        let (single, double) = (combination(speed as f32), combination(speed));
        for (single, double) in single.bank.iter().zip(double.bank) {
            // Condition of (S2) some 1e4, rounding 6e-8.
            assert!((f64::from(*single) - double).abs() < 2e-3, "{single} {double}");
        }
    }
}

#[test]
fn the_column_is_odd_and_zero_at_rest() {
    assert_eq!(bank_columns(0.0_f32), [0.0; BANK]);
    assert_eq!(bank_columns(0.1_f64), bank_columns(-0.1_f64).map(|element| -element));
}
