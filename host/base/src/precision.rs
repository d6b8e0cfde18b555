//! Digits of reported numbers: as many as the standard deviation supports, three without one.
//!
//! Two significant digits of the standard deviation, and the value to the same decimal place. Source:
//! "Guide to the Expression of Uncertainty in Measurement", JCGM 100:2008, 7.2.6. JSON has all digits.

use crate::number::Number;

/// Smaller numbers are rounding errors of double precision.
const ROUNDING: f64 = 1e-12;
/// Smaller parameters without standard deviation are the rounding of a prior's zero, SI. Shipped
/// legs have rounding up to 7e-11, other values from 1e-5 on.
const ROUNDING_OF_PARAMETERS: f64 = 1e-9;
/// Decimal places beyond which an exponent is used.
const MOST_PLACES: i32 = 7;

/// Formats the value of a parameter, rounded by its standard deviation.
pub fn value(value: Number, sigma: Number) -> String {
    match (value.known(), places(sigma)) {
        (None, _) => "-".into(),
        (Some(0.0), _) => "0".into(),
        (Some(value), Some(places)) => rounded(value, places),
        (Some(value), None) if value.abs() < ROUNDING_OF_PARAMETERS => "0".into(),
        (Some(value), None) => plain(value.into()),
    }
}

/// Formats a standard deviation with two significant digits.
pub fn sigma(sigma: Number) -> String {
    match (sigma.known(), places(sigma)) {
        (None, _) => "-".into(),
        (Some(sigma), Some(places)) => rounded(sigma, places),
        (Some(_), None) => "0".into(),
    }
}

/// Formats a number with three significant digits.
pub fn plain(value: Number) -> String {
    match value.known() {
        None => "-".into(),
        Some(value) if value.abs() < ROUNDING => "0".into(),
        Some(value) if value.abs() >= 1e5 || value.abs() < 1e-4 => format!("{value:.2e}"),
        Some(value) => {
            let places = (2 - magnitude(value, 2)).max(0) as usize;
            format!("{value:.places$}")
        }
    }
}

/// Formats an exact number, for example a limit: at most four significant digits, no trailing zeros.
pub fn exact(value: Number) -> String {
    let Some(value) = value.known() else { return "-".into() };
    if value == 0.0 || (1e-4..1e6).contains(&value.abs()) {
        let places = (3 - magnitude(value, 3)).max(0) as usize;
        let digits = format!("{value:.places$}");
        let has_point = digits.contains('.');
        return if has_point { digits.trim_end_matches('0').trim_end_matches('.').into() } else { digits };
    }
    let digits = format!("{value:.3e}");
    let (mantissa, exponent) = digits.split_once('e').unwrap_or((&digits, "0"));
    format!("{}e{exponent}", mantissa.trim_end_matches('0').trim_end_matches('.'))
}

/// Decimal places at which a standard deviation has two significant digits.
fn places(sigma: Number) -> Option<i32> {
    sigma.known().filter(|sigma| *sigma > 0.0).map(|sigma| 1 - magnitude(sigma, 1))
}

/// Power of ten of the first digit, after rounding to `digits` digits behind it.
fn magnitude(value: f64, digits: usize) -> i32 {
    format!("{value:.digits$e}").split_once('e').and_then(|(_, power)| power.parse().ok()).unwrap_or(0)
}

/// Rounds a value at a decimal place; negative places lie before the point.
fn rounded(value: f64, places: i32) -> String {
    let unit = 10_f64.powi(-places);
    let text = if places > MOST_PLACES {
        let digits = (magnitude(value, 0) + places).max(0) as usize;
        format!("{value:.digits$e}")
    } else if places < 0 {
        format!("{:.0}", (value / unit).round() * unit)
    } else {
        format!("{value:.*}", places as usize)
    };
    // A number that rounds to zero has no sign.
    if value.abs() < unit / 2.0 { text.trim_start_matches('-').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(found: f64, deviation: f64) -> (String, String) {
        (value(found.into(), deviation.into()), sigma(deviation.into()))
    }

    #[test]
    fn a_value_ends_where_its_sigma_has_two_digits() {
        let cases = [
            ((3.558_572, 0.021_521), ("3.559", "0.022")),
            ((-0.891_843, 0.728_478), ("-0.89", "0.73")),
            // Rounding up to the next power of ten adds no digit.
            ((4.546_186, 0.099_6), ("4.55", "0.10")),
            ((12_345.6, 234.5), ("12350", "230")),
            ((0.000_01, 0.09), ("0.000", "0.090")),
            ((-0.000_01, 0.09), ("0.000", "0.090")),
            ((1.234_56e-7, 3.2e-9), ("1.235e-7", "3.2e-9")),
        ];
        for ((found, deviation), (left, right)) in cases {
            assert_eq!(pair(found, deviation), (left.into(), right.into()), "{found} {deviation}");
        }
    }

    #[test]
    fn a_value_without_sigma_has_three_digits_and_rounding_errors_are_zero() {
        let shown = |found: f64| value(found.into(), Number::UNKNOWN);
        for (found, text) in [
            (4.176_224e-17, "0"),
            (-4.597e-13, "0"),
            (6.6e-11, "0"),
            (-4.254e-5, "-4.25e-5"),
            (0.571_818, "0.572"),
            (0.999_6, "1.00"),
            (10.115_697, "10.1"),
            (1215.3, "1215"),
        ] {
            assert_eq!(shown(found), text);
        }
        assert_eq!((shown(f64::NAN), sigma(Number::UNKNOWN)), ("-".into(), "-".into()));
        // A search that ends this far above its optimum is not a rounding error.
        assert_eq!(plain(2.31e-7.into()), "2.31e-7");
        assert_eq!(plain(6.94e-17.into()), "0");
    }

    #[test]
    fn a_limit_has_no_zeros_at_its_end() {
        for (limit, text) in [
            (0.05, "0.05"),
            (f64::from(0.3_f32), "0.3"),
            (30.0, "30"),
            (1000.0, "1000"),
            (65.0, "65"),
            (0.901_34, "0.9013"),
            (f64::from(1e-9_f32), "1e-9"),
            (0.0, "0"),
        ] {
            assert_eq!(exact(limit.into()), text);
        }
    }
}
