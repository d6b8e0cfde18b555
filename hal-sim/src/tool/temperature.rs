//! The drives' temperature: kept with a model, and what a difference does to it.
//!
//! ```text
//! k_t(T) = k_t(T0) (1 - 0.0011 (T - T0))                       remanence of neodymium magnets, per kelvin
//! ```
//!
//! A warm motor makes less torque of the same current, so every parameter, believed in the cold motor's units, comes out
//! larger; grease thins, and viscous friction falls by an amount that nobody knows beforehand. Nothing is corrected: what
//! the leg's magnets and gears do is not known, and a thermometer on the housing is not one on the magnet.

/// Temperatures that a drive can have, degrees Celsius.
pub const RANGE_C: (f64, f64) = (-40.0, 125.0);
/// A larger difference is worth a warning, kelvin: the constants then differ by 1.1 %, several sigma of the first moments
/// that 22 s of motion tell.
pub const LARGEST_DIFFERENCE_K: f64 = 10.0;
/// Of neodymium's remanence, per kelvin.
pub const MAGNET_SHARE_PER_KELVIN: f64 = -0.0011;

/// A temperature given on the command line.
///
/// # Errors
/// What is no number, or no drive's temperature.
pub fn parse(text: &str) -> Result<f64, String> {
    let (low, high) = RANGE_C;
    match text.parse::<f64>() {
        Ok(celsius) if (low..=high).contains(&celsius) => Ok(celsius),
        _ => Err(format!("`{text}` is not a temperature from {low} to {high} degrees Celsius")),
    }
}

/// What to think of a model found at `model` degrees Celsius on a leg at `leg`; nothing where either is unknown or they
/// hardly differ.
#[must_use]
pub fn warning(model: Option<f64>, leg: Option<f64>) -> Option<String> {
    let (model, leg) = (model?, leg?);
    let warmer = leg - model;
    (warmer.abs() > LARGEST_DIFFERENCE_K).then(|| {
        format!(
            "the model was found at {model} degrees Celsius, the leg is at {leg}: over {warmer:+} K the magnets' torque per \
             ampere changes by {:+.1} % and with it every parameter, the other way; viscous friction changes besides, \
             falling where it gets warmer",
            100.0 * MAGNET_SHARE_PER_KELVIN * warmer
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_ten_kelvin_are_worth_a_warning_and_what_is_unknown_is_not() {
        assert_eq!((warning(Some(20.0), Some(30.0)), warning(Some(20.0), None)), (None, None));
        assert_eq!(warning(None, Some(90.0)), None);
        let warmer = warning(Some(20.0), Some(40.0)).expect("20 K");
        assert!(warmer.contains("+20 K") && warmer.contains("by -2.2 %"), "{warmer}");
        assert!(warning(Some(40.0), Some(20.0)).expect("20 K").contains("by +2.2 %"));
    }

    #[test]
    fn what_no_drive_has_is_refused() {
        assert_eq!((parse("-40"), parse("125")), (Ok(-40.0), Ok(125.0)));
        for text in ["-40.1", "125.5", "nan", "inf", "", "warm"] {
            assert!(parse(text).expect_err(text).contains("-40 to 125"), "{text}");
        }
    }
}
