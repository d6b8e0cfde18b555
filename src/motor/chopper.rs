//! The brake chopper: what the leg gives back and the supply does not take is burnt in a resistor.
//!
//! Why: a supply's diode takes no energy back, and the bus capacitor alone is too small. A knee of 2.5 kg m^2 that is stopped
//! from 4.5 rad/s gives back 25 J, less what the windings take; 1.5 mF at 48 V would go to 190 V.
//!
//! ```text
//! duty = clamp((V_bus - begin) / (full - begin), 0, 0.95)
//! ```
//!
//! A ramp and no switch, so that the bus neither hunts nor fights a supply that is set a little high; `begin` lies above every
//! voltage of the supply without load, `full` below the voltage at which the bridges are released. The loop of capacitor and
//! ramp has the time constant C R (full - begin) / V, 0.25 ms with 2 ohm and 4 V: six periods. 0.95 is the greatest duty that
//! ODrive's firmware allows the resistor. A voltage that is not a number makes no duty: the axes release on it.
//! Source: the ramp of ODrive v0.5.6 (`dc_bus_overvoltage_ramp`). Cost: 4 operations.

use super::SenseScale;
use crate::real::{clamp, is_finite};
use crate::units::Volt;

/// Greatest share of time for which the resistor is on.
pub const GREATEST_BRAKE_DUTY: f32 = 0.95;

/// The chopper's ramp; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chopper {
    begin: Volt,
    per_volt: f32,
}

impl Chopper {
    /// `None` unless 5 V <= begin, and full lies at least half a volt above it and within what the board's divider can tell
    /// ([`SenseScale::greatest_bus`], 59.6 V): beyond, the ramp would never be reached.
    #[must_use]
    pub fn new(begin: Volt, full: Volt) -> Option<Self> {
        let sensible =
            begin.0 >= 5.0 && full.0 >= begin.0 + 0.5 && full <= SenseScale::ODRIVE_3_6.greatest_bus();
        sensible.then(|| Self { begin, per_volt: 1.0 / (full.0 - begin.0) })
    }

    /// Share of time for which the resistor is on, 0..=0.95.
    #[must_use]
    pub fn duty(&self, bus: Volt) -> f32 {
        if !is_finite(bus.0) {
            return 0.0;
        }
        clamp((bus.0 - self.begin.0) * self.per_volt, 0.0, GREATEST_BRAKE_DUTY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
