//! Shunts under the low sides of B and C, their amplifiers and the converter.
//!
//! ```text
//! seen    = (i + (delay - settling) di/dt) (1 - exp(-t / settling)) + disturbance
//! volt    = middle + gain (1 + error) shunt seen,                within the rails
//! code    = nearest whole number of volt / 3.3 * 4096 + offset + noise,    0..=4095
//! ```
//!
//! Here t is the time since the low side began to conduct. A first-order amplifier that follows a ramp lags
//! by its time constant; the converter holds its output `delay` after the middle of the lower zero vector.
//! After the edge the amplifier first has to settle. A duty that leaves the low side too little time reads
//! wrong, here as on the board. Half of the range is zero current; a higher code is a current from the bridge
//! into the motor.
//! Sources: board facts in `description`.
//! Cost: two exponentials and two random numbers per axis and period.

use super::description::ShuntDescription;
use crate::maths::{exp, nearest};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Reference of the converter, V.
pub(crate) const CONVERTER_VOLT: f64 = 3.3;
/// Codes of the converter.
pub(crate) const CODES: f64 = 4096.0;

/// Input of one shunt at the sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShuntState {
    /// Current from the bridge into the motor, A.
    pub current: f64,
    /// Slope of the current, A/s.
    pub slope: f64,
    /// Time for which the low side has been conducting, s; 0 if it does not.
    pub conducting: f64,
    /// Error added by the edges of other bridges, A.
    pub disturbance: f64,
}

/// Converts a voltage at the converter to its code.
pub(crate) fn convert(volt: f64, error_codes: f64) -> u16 {
    nearest(volt / CONVERTER_VOLT * CODES + error_codes).clamp(0, CODES as i64 - 1) as u16
}

impl ShuntDescription {
    /// Code of channel 0 (B) or 1 (C).
    #[must_use]
    pub fn code(&self, channel: usize, state: &ShuntState, generator: &mut Xoshiro256PlusPlus) -> u16 {
        let settled = 1.0 - exp(-state.conducting / self.settling);
        let seen = (state.current + (self.delay - self.settling) * state.slope) * settled + state.disturbance;
        let gain = self.gain * (1.0 + self.gain_error.get(channel).copied().unwrap_or(0.0));
        let [low, high] = self.rails;
        let volt = (0.5 * CONVERTER_VOLT + gain * self.resistance * seen).clamp(low, high);
        let noise: f64 = StandardNormal.sample(generator);
        let offset = self.offset_codes.get(channel).copied().unwrap_or(0.0);
        convert(volt, offset + self.noise_codes * noise)
    }

    /// Current per code, A.
    pub fn ampere_per_code(&self) -> f64 {
        CONVERTER_VOLT / CODES / (self.gain * self.resistance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::SeedableRng;

    fn quiet() -> ShuntDescription {
        ShuntDescription { noise_codes: 0.0, offset_codes: [12.0, 0.0], ..ShuntDescription::default() }
    }

    fn code(current: f64, conducting: f64) -> u16 {
        let state = ShuntState { current, conducting, ..ShuntState::default() };
        quiet().code(1, &state, &mut Xoshiro256PlusPlus::seed_from_u64(1))
    }

    #[test]
    fn codes_are_those_of_the_board() {
        // ODrive v3.6: (code - 2048) * 3.3/4096 / 40 / 0.0005.
        assert!((quiet().ampere_per_code() - 0.040_283).abs() < 1e-6);
        assert_eq!(code(0.0, 1e-3), 2048);
        assert_eq!(code(40.283_203, 1e-3), 3048);
        assert_eq!(code(-40.283_203, 1e-3), 1048);
        let state = ShuntState { conducting: 1e-3, ..ShuntState::default() };
        assert_eq!(quiet().code(0, &state, &mut Xoshiro256PlusPlus::seed_from_u64(1)), 2060);
    }

    #[test]
    fn currents_beyond_the_rails_read_as_the_rail() {
        // 3.15 V and 0.15 V of 3.3 V.
        assert_eq!((code(500.0, 1e-3), code(-500.0, 1e-3)), (3910, 186));
        assert_eq!(code(50.0, 0.0), 2048);
    }

    #[test]
    fn an_amplifier_has_settled_to_one_percent_after_1_2_microseconds() {
        let full = f64::from(code(50.0, 1e-3)) - 2048.0;
        let settled = (f64::from(code(50.0, 1.2e-6)) - 2048.0) / full;
        assert!((settled - 0.99).abs() < 1e-3, "{settled}");
    }
}
