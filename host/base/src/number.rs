//! Numbers of results: unknown ones, and their text.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Number for JSON: values that are not finite are unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Number(pub Option<f64>);

impl Number {
    /// Unknown number.
    pub const UNKNOWN: Self = Self(None);

    /// The number, if it is finite.
    pub fn known(self) -> Option<f64> {
        self.0.filter(|value| value.is_finite())
    }
}

impl From<f64> for Number {
    fn from(value: f64) -> Self {
        Self(Some(value).filter(|value| value.is_finite()))
    }
}

impl From<f32> for Number {
    fn from(value: f32) -> Self {
        f64::from(value).into()
    }
}

impl<T: Into<f64>> From<Option<T>> for Number {
    fn from(value: Option<T>) -> Self {
        Self(value.map(Into::into).filter(|value: &f64| value.is_finite()))
    }
}

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.known() {
            Some(value) => serializer.serialize_f64(value),
            None => serializer.serialize_none(),
        }
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Option::deserialize(from).map(Self)
    }
}

/// Formats a number with four significant digits, or a dash.
pub fn number(value: Number) -> String {
    match value.known() {
        None => "-".into(),
        Some(0.0) => "0".into(),
        Some(value) if value.abs() >= 1e5 || value.abs() < 1e-4 => format!("{value:.2e}"),
        Some(value) => {
            let digits = (3 - value.abs().log10().floor() as i32).clamp(0, 7) as usize;
            format!("{value:.digits$}")
        }
    }
}
