//! Brake chopper: burns energy that the leg regenerates and the supply cannot absorb.
//!
//! Why: a supply's diode takes no energy back, and the bus capacitor alone is too small. A knee of 2.5 kg m^2
//! stopped from 4.5 rad/s returns 25 J, less what the windings take. That would charge 1.5 mF from 48 V to
//! 190 V.
//!
//! ```text
//! duty = clamp((V_bus - begin) / (full - begin), 0, 0.95)
//! ```
//!
//! A ramp instead of a switch: the bus neither hunts nor fights a supply that is set a little high. `begin`
//! lies above every no-load voltage of the supply, `full` below the voltage at which the bridges turn off.
//! Capacitor and ramp form a loop with the time constant C R (full - begin) / V. With 2 ohm and 4 V that is
//! 0.25 ms, or six periods. The limit of 0.95 is the greatest duty that ODrive's firmware allows the
//! resistor. A bus voltage that is not finite gives duty 0; the axes turn off on it.
//! Source: the ramp of ODrive v0.5.6 (`dc_bus_overvoltage_ramp`).
//! Cost: one comparison below the ramp.

use super::SenseScale;
use crate::hal::{CURRENT_RATE_HZ, GREATEST_BRAKE_DUTY};
use crate::real::{clamp, is_finite, min};
use crate::units::Volt;

/// The chopper's ramp; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chopper {
    begin: Volt,
    per_volt: f32,
}

impl Chopper {
    /// Returns `None` unless `begin` is at least 5 V and `full` at least half a volt above it. `full` must
    /// also lie within the range of the board's divider (`SenseScale::greatest_bus`, 59.6 V); beyond, the
    /// ramp would never be reached.
    pub fn new(begin: Volt, full: Volt) -> Option<Self> {
        let sensible =
            begin.0 >= 5.0 && full.0 >= begin.0 + 0.5 && full <= SenseScale::ODRIVE_3_6.greatest_bus();
        sensible.then(|| Self { begin, per_volt: 1.0 / (full.0 - begin.0) })
    }

    /// Whether the resistor conducts at a bus voltage.
    #[inline(always)]
    pub(crate) fn conducts(&self, bus: Volt) -> bool {
        bus.0 > self.begin.0
    }

    /// Duty of the resistor at a bus voltage, 0..=0.95.
    pub fn duty(&self, bus: Volt) -> f32 {
        if self.conducts(bus) { self.ramp(bus) } else { 0.0 }
    }

    /// Duty above `begin`.
    #[cold]
    #[inline(never)]
    fn ramp(&self, bus: Volt) -> f32 {
        if !is_finite(bus.0) {
            return 0.0;
        }
        min((bus.0 - self.begin.0) * self.per_volt, GREATEST_BRAKE_DUTY)
    }
}

/// Energy budget of a brake resistor without a temperature sensor: half a second of full duty, refilled at a
/// fiftieth of the time.
///
/// Why: a supply above `begin`, or a voltage that reads too high, keeps the resistor on without end, at over
/// a kilowatt with 2 ohm. A stop of the leg takes some tens of milliseconds. Once exhausted, the resistor
/// stays off until half of the budget is refilled (12 s). Energy regenerated in that time raises the bus
/// until the axes turn off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BrakeBudget {
    /// Remaining time at full duty.
    left_s: f32,
    used_up: bool,
}

impl BrakeBudget {
    const WHOLE_S: f32 = 0.5;
    const REFILL_SHARE: f32 = 0.02;
    const TICK_S: f32 = 1.0 / CURRENT_RATE_HZ as f32;

    /// The full budget.
    pub(crate) const FULL: Self = Self { left_s: Self::WHOLE_S, used_up: false };

    /// Whether nothing was used.
    #[inline(always)]
    pub(crate) fn is_full(&self) -> bool {
        self.left_s == Self::WHOLE_S
    }

    /// Returns the duty the resistor may have in a current tick, and subtracts it from the budget.
    #[must_use]
    pub(crate) fn spend(&mut self, wanted: f32) -> f32 {
        let duty = if self.used_up { 0.0 } else { wanted };
        self.left_s = clamp(self.left_s + (Self::REFILL_SHARE - duty) * Self::TICK_S, 0.0, Self::WHOLE_S);
        self.used_up = !(self.left_s > if self.used_up { 0.5 * Self::WHOLE_S } else { 0.0 });
        duty
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds until a constantly requested duty is cut off, at most ten.
    fn time_on(duty: f32) -> f32 {
        let mut budget = BrakeBudget::FULL;
        let ticks = (0..10 * CURRENT_RATE_HZ).take_while(|_| budget.spend(duty) == duty).count();
        ticks as f32 / CURRENT_RATE_HZ as f32
    }

    #[test]
    fn a_resistor_that_is_always_wanted_is_off_after_half_a_second_and_for_twelve() {
        assert!((time_on(0.95) - 0.54).abs() < 0.01, "{}", time_on(0.95));
        assert!(time_on(0.01) >= 9.99, "a mean of two per cent is for ever");
        let mut budget = BrakeBudget::FULL;
        let given: f32 = (0..60 * CURRENT_RATE_HZ).map(|_| budget.spend(0.95)).sum();
        // Expected in a minute: the full budget, and a fiftieth of the rest.
        assert!((1.0..1.8).contains(&(given / CURRENT_RATE_HZ as f32)), "{given}");
        let mut budget = BrakeBudget::FULL;
        assert!((0..CURRENT_RATE_HZ).all(|_| budget.spend(f32::NAN).is_nan() || budget.used_up));
        assert_eq!(budget.spend(0.5), 0.0, "what is no number uses it up");
    }

    #[test]
    fn the_resistor_is_off_below_the_ramp_and_never_on_all_the_time() {
        let chopper = Chopper::new(Volt(50.0), Volt(54.0)).expect("sensible");
        let cases = [(0.0, 0.0), (49.9, 0.0), (51.0, 0.25), (53.0, 0.75), (54.0, 0.95), (80.0, 0.95)];
        for (bus, duty) in cases {
            assert!((chopper.duty(Volt(bus)) - duty).abs() < 1e-5, "{bus}");
        }
        assert_eq!([f32::NAN, f32::INFINITY].map(|bus| chopper.duty(Volt(bus))), [0.0; 2]);
    }

    #[test]
    fn absurd_voltages_are_refused() {
        for (begin, full) in [(54.0, 50.0), (50.0, 50.2), (0.0, 10.0), (50.0, 60.0), (f32::NAN, 54.0)] {
            assert_eq!(Chopper::new(Volt(begin), Volt(full)), None, "{begin} {full}");
        }
        assert_eq!(Chopper::new(Volt(50.0), Volt(f32::NAN)), None);
    }
}
