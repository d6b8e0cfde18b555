//! Thermistor in a motor's winding: its resistance falls with temperature (NTC). It lies between pin and
//! ground, with a pull-up resistor to the converter's supply.
//!
//! ```text
//! R = pull_up code / (4096 - code)        1 / T = 1 / 298.15 K + ln(R / R_25) / beta
//! ```
//!
//! Source: beta equation of data sheets. For a 103AT-2 (Semitec) it agrees with the sheet's table within 1.1
//! K from 0 to 100 degrees Celsius. At 100 degrees a resistance 5 % off adds 2.0 K, a beta 3 % off 2.8 K.

use crate::real::ln;
use crate::units::Ohm;

/// Largest code of a shorted wire.
pub const SHORTED: u16 = 40;
/// Smallest code of an open wire.
pub const OPEN: u16 = 4056;

/// Codes of a converter of 12 bits.
const CODES: f32 = 4096.0;
/// Kelvin at zero, and at 25 degrees Celsius.
const ZERO_K: f32 = 273.15;
const REFERENCE_K: f32 = ZERO_K + 25.0;

/// Constants of a thermistor and its divider.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermistor {
    /// Resistor from the pin to 3.3 V.
    pub pull_up: Ohm,
    /// Resistance of the thermistor at 25 degrees Celsius.
    pub at_25_c: Ohm,
    /// Constant beta, K.
    pub beta_k: f32,
}

impl Thermistor {
    /// Temperature of a code, degrees Celsius; `None` where the wire is open or shorted.
    pub fn celsius(&self, code: u16) -> Option<f32> {
        if code <= SHORTED || code >= OPEN {
            return None;
        }
        let code = f32::from(code);
        let ratio = self.pull_up.0 / self.at_25_c.0 * code / (CODES - code);
        let inverse = 1.0 / REFERENCE_K + ln(ratio) / self.beta_k;
        // At or below zero no temperature has this resistance. NaN is refused too.
        (inverse > 0.0).then(|| 1.0 / inverse - ZERO_K)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Thermistor of 10 kOhm, beta 3435 K between 25 and 85 degrees, with 3.3 kOhm.
    pub(crate) const THERMISTOR: Thermistor =
        Thermistor { pull_up: Ohm(3300.0), at_25_c: Ohm(10_000.0), beta_k: 3435.0 };

    #[test]
    fn codes_agree_with_a_data_sheet() {
        // Resistances in ohm of a 103AT-2 (Semitec) at 0, 25, 50, 85 and 100 degrees: 27280, 10000, 4161,
        // 1452 and 974.
        for (ohm, celsius) in
            [(27_280.0, 0.0), (10_000.0, 25.0), (4161.0, 50.0), (1452.0, 85.0), (974.0, 100.0)]
        {
            let code = (4096.0_f32 * ohm / (ohm + 3300.0)).round() as u16;
            let read = THERMISTOR.celsius(code).expect("within the range");
            assert!((read - celsius).abs() < 1.2, "{ohm}: {read}");
        }
    }

    #[test]
    fn codes_without_a_temperature_are_unreadable() {
        let weak = Thermistor { beta_k: 1000.0, ..THERMISTOR };
        assert_eq!(weak.celsius(SHORTED + 1), None);
        let unknown = Thermistor { beta_k: f32::NAN, ..THERMISTOR };
        assert_eq!(unknown.celsius(2000), None);
    }

    #[test]
    fn an_open_or_shorted_wire_has_no_temperature() {
        for code in [0, SHORTED, OPEN, 4095] {
            assert_eq!(THERMISTOR.celsius(code), None, "{code}");
        }
        let celsius = |code| THERMISTOR.celsius(code).expect("readable");
        for code in SHORTED + 1..OPEN - 1 {
            assert!(celsius(code) > celsius(code + 1), "{code}");
        }
    }
}
