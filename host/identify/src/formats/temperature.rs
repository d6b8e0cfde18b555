//! Temperature of the drives: stored with a model, with a warning about differences.
//!
//! ```text
//! k_t(T) = k_t(T0) (1 - 0.0011 (T - T0))                       remanence of neodymium magnets, per kelvin
//! ```
//!
//! A warm motor makes less torque from the same current, so every parameter, in the cold motor's
//! units, becomes larger. Grease becomes thinner, and viscous friction falls by an unknown amount.
//! Nothing is corrected: the behaviour of the leg's magnets and gears is unknown, and the housing's
//! temperature is not that of the magnets.

/// Range of a drive's temperature, degrees Celsius.
pub const RANGE_C: (f64, f64) = (-40.0, 125.0);
/// Difference above which a warning is printed, kelvin. The constants then differ by 1.1 %, several
/// sigma of the first moments from 22 s of motion.
pub(crate) const LARGEST_DIFFERENCE_K: f64 = 10.0;
/// Temperature coefficient of neodymium's remanence, per kelvin.
pub(crate) const MAGNET_SHARE_PER_KELVIN: f64 = -0.0011;

/// Parses a temperature from the command line.
///
/// # Errors
/// The text is not a number, or outside the range of a drive.
pub fn parse(text: &str) -> Result<f64, String> {
    text.parse().map_or(Err(()), |celsius| checked(celsius).map_err(drop)).map_err(|()| refusal(text))
}

/// This temperature, if a drive can have it.
///
/// # Errors
/// The temperature is outside the range of a drive.
pub fn checked(celsius: f64) -> Result<f64, String> {
    let (low, high) = RANGE_C;
    if (low..=high).contains(&celsius) { Ok(celsius) } else { Err(refusal(&celsius.to_string())) }
}

fn refusal(text: &str) -> String {
    let (low, high) = RANGE_C;
    format!("`{text}` is not a temperature from {low} to {high} degrees Celsius")
}

/// Warning about a model identified at `model` degrees Celsius on a leg at `leg`; `None` if one is
/// unknown or the difference is small.
pub fn warning(model: Option<f64>, leg: Option<f64>) -> Option<String> {
    let (model, leg) = (model?, leg?);
    let warmer = leg - model;
    (warmer.abs() > LARGEST_DIFFERENCE_K).then(|| {
        format!(
            "the model was identified at {model} degrees Celsius, the leg is at {leg}: over {warmer:+} K the magnets' torque \
             per ampere changes by {:+.1} %, and every parameter by the opposite; viscous friction changes too, it \
             falls with temperature",
            100.0 * MAGNET_SHARE_PER_KELVIN * warmer
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_than_ten_kelvin_give_a_warning_and_unknown_temperatures_none() {
        assert_eq!((warning(Some(20.0), Some(30.0)), warning(Some(20.0), None)), (None, None));
        assert_eq!(warning(None, Some(90.0)), None);
        let warmer = warning(Some(20.0), Some(40.0)).expect("20 K");
        assert!(warmer.contains("+20 K") && warmer.contains("by -2.2 %"), "{warmer}");
        assert!(warning(Some(40.0), Some(20.0)).expect("20 K").contains("by +2.2 %"));
    }

    #[test]
    fn implausible_temperatures_are_refused() {
        assert_eq!((parse("-40"), parse("125")), (Ok(-40.0), Ok(125.0)));
        for text in ["-40.1", "125.5", "nan", "inf", "", "warm"] {
            assert!(parse(text).expect_err(text).contains("-40 to 125"), "{text}");
        }
    }
}
