//! The plant's own access to `libm`, separate from the firmware's.
//!
//! Double precision throughout. The functions are identical on every host, so a seed gives identical bits
//! everywhere.

/// Sine and cosine of an angle in rad.
#[expect(clippy::disallowed_methods, reason = "this file is the plant's only access to libm")]
pub(crate) fn sin_cos(angle: f64) -> (f64, f64) {
    libm::sincos(angle)
}

/// Exponential function.
#[expect(clippy::disallowed_methods, reason = "this file is the plant's only access to libm")]
pub(crate) fn exp(value: f64) -> f64 {
    libm::exp(value)
}

/// Natural logarithm.
#[expect(clippy::disallowed_methods, reason = "this file is the plant's only access to libm")]
pub(crate) fn ln(value: f64) -> f64 {
    libm::log(value)
}

/// Square root.
#[expect(clippy::disallowed_methods, reason = "this file is the plant's only access to libm")]
pub(crate) fn sqrt(value: f64) -> f64 {
    libm::sqrt(value)
}

/// Largest integer not above the value; saturates at the ends of `i64`, 0 for NaN.
pub(crate) fn floor(value: f64) -> i64 {
    let truncated = value as i64;
    if (truncated as f64) > value { truncated.saturating_sub(1) } else { truncated }
}

/// Nearest integer, halves upward; saturates at the ends of `i64`, 0 for NaN.
pub(crate) fn nearest(value: f64) -> i64 {
    floor(value + 0.5)
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn nearest_rounds_both_signs_alike() {
        let cases =
            [(0.49, 0), (0.5, 1), (-0.5, 0), (-0.51, -1), (-7.9, -8), (1e300, i64::MAX), (f64::NAN, 0)];
        for (value, whole) in cases {
            assert_eq!(nearest(value), whole, "{value}");
        }
    }
}
