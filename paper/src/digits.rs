//! Numbers as the paper's tables print them.

use scarab_base::number::{self, Number};

/// Formats a number with four digits; a dash if unknown.
pub fn number(value: Number) -> String {
    match value.known() {
        Some(value) if value != 0.0 && value.abs() < 1e-3 => format!("{value:.1e}"),
        _ => number::number(value),
    }
}

/// Formats a percentage: two decimals below ten, fewer above; a dash if unknown.
pub fn percent(value: Option<f64>) -> String {
    match value {
        None => "-".into(),
        Some(value) if value.abs() < 9.995 => format!("{value:.2}"),
        Some(value) if value.abs() < 99.95 => format!("{value:.1}"),
        Some(value) => format!("{value:.0}"),
    }
}
