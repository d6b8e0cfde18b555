//! Temperature of a motor's winding, computed from its current.
//!
//! First-order thermal model with the resistance of copper at the present temperature:
//!
//! ```text
//! T' = (rise k(T) i^2 - (T - ambient)) / tau        k(T) = (235 + T) / (235 + limit)
//! ```
//!
//! `rise` is the temperature rise per squared current of a winding at its limit, held for ever. `i` is the
//! length of the current vector, along the flux included. Source of k: IEC 60034-1, copper.
//!
//! Why a model: a motor need not have a thermistor ([`super::Thermistor`]), and one lags behind its winding.
//! The larger of both temperatures counts. The hip of the default leg may be held in a pose with 33 A, which
//! heats its winding from 40 to 100 degrees in seven minutes.
//!
//! The share of the torque cap falls from 1 to 0 over the last [`RAMP_K`] below the limit. A stop at the end
//! of the range keeps the whole cap, so a joint that is pushed against its end heats on. At the limit the leg
//! is therefore damped and turned off ([`super::FaultCode::WindingTemperature`]).
//!
//! **Start.** The temperature survives a reset and a short power cut in memory. Where the memory lost it, the
//! winding is assumed [`RAMP_K`] below its limit: full torque, no reserve. It then cools like a real one. The
//! next calibration, or check at standstill, replaces this by the temperature of the resistance, where the
//! stored calibration has one.
//!
//! Known limits: a winding hotter than that before the memory is lost gets up to [`RAMP_K`] of torque that it
//! should not have. Without a thermistor, ambient temperature, heat of iron and of the gear, and heat from
//! one motor to another are not measured. Demagnetisation is not modelled.

use crate::real::{clamp, is_finite, max};
use crate::units::Ohm;

/// Degrees below the limit at which the share begins to fall.
pub const RAMP_K: f32 = 20.0;

/// Added to a temperature that a resistance shows, K.
const MEASURED_K: f32 = 6.0;
/// Temperature at which the resistance of copper would vanish, below zero degrees Celsius.
const COPPER_C: f32 = 235.0;

/// Thermal constants of a winding.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindingRating {
    /// Steady rise above ambient per squared current, K/A^2, at the resistance of the limit.
    pub rise: f32,
    /// Time constant, s.
    pub time_s: f32,
    /// Highest ambient temperature, degrees Celsius.
    pub ambient_c: f32,
    /// Temperature at which no torque is left, degrees Celsius.
    pub limit_c: f32,
}

impl WindingRating {
    /// Constants of a winding with this phase resistance at 20 degrees Celsius and this thermal resistance to
    /// ambient, K/W. Three phases take 1.5 R i^2.
    pub fn new(resistance: Ohm, kelvin_per_watt: f32, time_s: f32, ambient_c: f32, limit_c: f32) -> Self {
        let hot = (COPPER_C + limit_c) / (COPPER_C + 20.0);
        Self { rise: kelvin_per_watt * 1.5 * resistance.0 * hot, time_s, ambient_c, limit_c }
    }
}

/// Thermal model of one winding; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Winding {
    rating: WindingRating,
    temperature_c: f32,
    /// Rounding error of the temperature, added to the next step, K.
    rest_c: f32,
}

impl Winding {
    /// A winding whose temperature is known, or one that is assumed warm.
    pub fn new(rating: WindingRating, temperature_c: Option<f32>) -> Self {
        Self { rating, temperature_c: temperature_c.unwrap_or(rating.limit_c - RAMP_K), rest_c: 0.0 }
    }

    /// Advances by `duration_s`, in which the squared current had the integral `square_a2s` (A^2 s). The
    /// duration is much shorter than the time constant.
    pub fn advance(&mut self, square_a2s: f32, duration_s: f32) {
        let WindingRating { rise, time_s, ambient_c, limit_c } = self.rating;
        let copper = (COPPER_C + self.temperature_c) / (COPPER_C + limit_c);
        let cooling = (self.temperature_c - ambient_c) * duration_s;
        // Compensated sum (Kahan, 1965): a step of 2 ms may be less than the last digit.
        let step = (rise * copper * square_a2s - cooling) / time_s + self.rest_c;
        let next = self.temperature_c + step;
        self.rest_c = step - (next - self.temperature_c);
        self.temperature_c = next;
    }

    /// Whether an assumption so many seconds ago does not matter any more: after three time constants 5 % of
    /// its error are left.
    pub(crate) fn has_forgotten(&self, seconds: f32) -> bool {
        seconds > 3.0 * self.rating.time_s
    }

    /// Sets the temperature by the ratio of the present resistance to that at `then_c`, not below ambient. A
    /// ratio that is not finite changes nothing.
    ///
    /// Copper, after IEC 60034-1: `T = ratio (235 + T_then) - 235`. Resistances agree within 2 %, which is 6
    /// K; so much is added.
    pub(crate) fn measured(&mut self, ratio: f32, then_c: f32) {
        let celsius = ratio * (COPPER_C + then_c) - COPPER_C + MEASURED_K;
        if is_finite(celsius) {
            (self.temperature_c, self.rest_c) = (max(celsius, self.rating.ambient_c), 0.0);
        }
    }

    /// Raises the temperature to that of a thermistor, degrees Celsius; a colder one, or NaN, changes
    /// nothing.
    pub(crate) fn at_least(&mut self, celsius: f32) {
        if celsius > self.temperature_c {
            (self.temperature_c, self.rest_c) = (celsius, 0.0);
        }
    }

    /// Temperature, degrees Celsius.
    pub fn temperature_c(&self) -> f32 {
        self.temperature_c
    }

    /// Whether the winding reached its limit; true for NaN.
    pub(crate) fn is_too_hot(&self) -> bool {
        !(self.temperature_c < self.rating.limit_c)
    }

    /// Remaining share of the torque cap, 0..=1; 0 for NaN.
    pub(crate) fn share(&self) -> f32 {
        clamp((self.rating.limit_c - self.temperature_c) / RAMP_K, 0.0, 1.0)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Motor that reaches its limit with 31 A for ever; not the default leg's.
    pub(crate) const RATING: WindingRating =
        WindingRating { rise: 60.0 / (31.0 * 31.0), time_s: 100.0, ambient_c: 40.0, limit_c: 100.0 };

    fn after(seconds: u32, ampere: f32, from: f32) -> Winding {
        let mut winding = Winding::new(RATING, Some(from));
        for _ in 0..500 * seconds {
            winding.advance(ampere * ampere / 500.0, 1.0 / 500.0);
        }
        winding
    }

    #[test]
    fn the_rated_current_ends_at_the_limit() {
        let end = after(2000, 31.0, 40.0).temperature_c();
        assert!((end - 100.0).abs() < 0.1, "{end}");
        let half = after(2000, 15.5, 40.0).temperature_c();
        // T - 40 = 15 (235 + T) / 335: the steady state of a quarter of the heat.
        assert!((half - (40.0 + 15.0 * 235.0 / 335.0) / (1.0 - 15.0 / 335.0)).abs() < 0.1, "{half}");
    }

    #[test]
    fn a_resistance_shows_the_temperature_of_copper() {
        // 0.39 % per K near 20 degrees: 40 K more are 15.7 %.
        for (ratio, celsius) in [(1.157, 66.0), (1.0, 40.0), (1.235, 86.0), (f32::NAN, 80.0)] {
            let mut winding = Winding::new(RATING, None);
            winding.measured(ratio, 20.0);
            assert!((winding.temperature_c() - celsius).abs() < 0.1, "{ratio} {winding:?}");
        }
    }

    #[test]
    fn cooling_is_exponential() {
        let cooled = after(100, 0.0, 100.0).temperature_c();
        assert!((cooled - (40.0 + 60.0 * 0.367_879)).abs() < 0.05, "{cooled}");
    }

    #[test]
    fn the_share_falls_over_the_last_degrees_and_nan_leaves_none() {
        for (celsius, share) in
            [(20.0, 1.0), (80.0, 1.0), (90.0, 0.5), (100.0, 0.0), (130.0, 0.0), (f32::NAN, 0.0)]
        {
            let winding = Winding::new(RATING, Some(celsius));
            assert_eq!((winding.share(), winding.is_too_hot()), (share, share == 0.0), "{celsius}");
        }
    }

    #[test]
    fn a_winding_that_is_assumed_warm_stays_above_a_colder_one() {
        for (from, ambient_c) in [(20.0, 40.0), (60.0, 40.0), (79.0, 40.0), (79.0, 0.0)] {
            let mut assumed = Winding::new(RATING, None);
            assert_eq!((assumed.temperature_c(), assumed.share()), (80.0, 1.0));
            let mut real = Winding::new(WindingRating { ambient_c, ..RATING }, Some(from));
            for step in 0..500 * 300 {
                let square = if step / 5000 % 2 == 0 { 900.0 } else { 0.0 };
                assumed.advance(square / 500.0, 1.0 / 500.0);
                real.advance(square / 500.0, 1.0 / 500.0);
                assert!(assumed.temperature_c() > real.temperature_c(), "{assumed:?} {real:?}");
            }
        }
    }
}
