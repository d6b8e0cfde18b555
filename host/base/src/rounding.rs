//! Removes the rounding of a computation from a number where a short decimal number lies within it.
//!
//! A length of 0.3 m that comes back from a rotation as 0.30000000000000004 was 0.3. Nothing else is rounded:
//! a number without a short neighbour keeps all its digits.

use core::f64::consts::FRAC_PI_2;

/// Rounding of a few dozen operations, as a share of the numbers that were added.
const NOISE: f64 = 1e-14;
/// Most significant digits of a short number.
const DIGITS: usize = 12;

/// Shortest decimal number of at most twelve digits within the rounding, else the value itself. `scale` is
/// the magnitude of the numbers from which it was computed.
pub fn without_noise(value: f64, scale: f64) -> f64 {
    let noise = NOISE * value.abs().max(scale);
    if value.abs() <= noise {
        return 0.0;
    }
    let short = |digits: usize| format!("{value:.digits$e}").parse::<f64>().ok();
    let is_near = |short: &f64| (short - value).abs() <= noise;
    (0..DIGITS).filter_map(short).find(is_near).unwrap_or(value)
}

/// Angle in radians without rounding: a right angle, which has no short decimal number, or a short number.
pub fn without_noise_rad(angle: f64) -> f64 {
    let right = (angle / FRAC_PI_2).round() * FRAC_PI_2;
    if (angle - right).abs() <= NOISE { right } else { without_noise(angle, 1.0) }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    #[test]
    fn only_rounding_is_removed() {
        for (value, scale, expected) in [
            (0.1 + 0.2, 0.0, 0.3),
            (-0.199_999_999_999_999_98, 0.2, -0.2),
            (2.4e-17, 0.2, 0.0),
            (2.4e-17, 0.0, 2.4e-17),
            (90.000_000_000_000_01, 0.0, 90.0),
            (1.0 / 3.0, 1.0, 1.0 / 3.0),
            (28.647_889_756_541_16, 0.0, 28.647_889_756_541_16),
            (0.0, 0.0, 0.0),
        ] {
            assert_eq!(without_noise(value, scale), expected, "{value}");
        }
        // Farther away than rounding.
        assert_eq!(without_noise(0.300_000_000_01, 0.3), 0.300_000_000_01);
        assert_eq!(without_noise(0.300_000_000_000_3, 0.3), 0.300_000_000_000_3);
    }

    #[test]
    fn right_angles_are_exact() {
        assert_eq!(without_noise_rad(FRAC_PI_2 + 2e-15), FRAC_PI_2);
        assert_eq!(without_noise_rad(-PI - 4e-15), -PI);
        assert_eq!(without_noise_rad(0.250_000_000_000_000_06), 0.25);
        let rounded = FRAC_PI_2 + 4e-6;
        assert_eq!(without_noise_rad(rounded), rounded);
        assert_eq!(without_noise_rad(3e-16), 0.0);
    }
}
