//! The bus: a capacitor between a source that takes nothing back, the bridges and a brake resistor.
//!
//! ```text
//! C dV/dt = max(0, (V_source - V) / R_source) - i_bridges - duty V / R_brake
//! ```
//!
//! What a leg gives back while it is braked can only go into the capacitor and, when it is told so, into the resistor.
//! Implicit in the source and the resistor, so no step is too long for them. The chopper is averaged over its own period
//! (98 us on an ODrive v3.6; the ripple left out is below 0.7 V at 24 A and 1.5 mF). V, A, F, ohm, s.
//! Cost: some 10 operations per step. Known limits: no inductance of the cable.

use super::description::SupplyDescription;
use super::shunts::convert;

/// The bus of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    description: SupplyDescription,
    voltage: f64,
    /// Into the bridges, out of the source, into the brake resistor since the beginning, J.
    energy: SupplyEnergy,
}

/// Where energy went, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SupplyEnergy {
    /// Out of the source, its own losses not counted.
    pub source: f64,
    /// Into the bridges.
    pub bridges: f64,
    /// Into the brake resistor.
    pub brake: f64,
}

impl Supply {
    /// At rest: the capacitor is charged.
    #[must_use]
    pub fn new(description: &SupplyDescription) -> Self {
        Self { description: *description, voltage: description.voltage, energy: SupplyEnergy::default() }
    }

    /// Of the bus, V.
    #[must_use]
    pub fn voltage(&self) -> f64 {
        self.voltage
    }

    /// Where energy went so far.
    #[must_use]
    pub fn energy(&self) -> &SupplyEnergy {
        &self.energy
    }

    /// Changes the source's voltage, as a stronger or weaker supply does; the bus follows.
    pub fn set_source(&mut self, voltage: f64) {
        self.description.voltage = voltage;
    }

    /// `duration` s in which the bridges take a charge (C) and the brake resistor is on for a share (0..=1) of the time; a
    /// share that is not a number counts as 0.
    pub fn advance(&mut self, charge: f64, brake: f64, duration: f64) {
        let SupplyDescription { voltage: source, resistance, capacitance, brake_resistance, .. } =
            self.description;
        let conductance = if brake.is_nan() { 0.0 } else { brake.clamp(0.0, 1.0) } / brake_resistance;
        let before = self.voltage;
        let step = duration / capacitance;
        let feeding = 1.0 / resistance;
        let drawn = before - charge / capacitance;
        let fed = (drawn + step * feeding * source) / (1.0 + step * (feeding + conductance));
        // The diode blocks where the bus stays above the source.
        self.voltage = if fed < source { fed } else { (drawn / (1.0 + step * conductance)).max(source) };
        let mean = 0.5 * (before + self.voltage);
        let source_charge = (feeding * (source - self.voltage)).max(0.0) * duration;
        self.energy.source += source_charge * mean;
        self.energy.bridges += charge * mean;
        self.energy.brake += conductance * self.voltage * mean * duration;
    }

    /// The bus voltage's code.
    #[must_use]
    pub fn code(&self, noise_codes: f64) -> u16 {
        convert(self.voltage / self.description.divider, noise_codes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn supply() -> SupplyDescription {
        SupplyDescription::default()
    }

    #[test]
    fn a_constant_load_drops_the_bus_by_the_source_resistance() {
        let mut bus = Supply::new(&supply());
        for _ in 0..1000 {
            bus.advance(20.0 * 1e-5, 0.0, 1e-5);
        }
        assert!((bus.voltage() - (48.0 - 20.0 * 0.05)).abs() < 1e-9, "{}", bus.voltage());
    }

    #[test]
    fn what_comes_back_stays_in_the_capacitor_until_the_brake_takes_it() {
        let mut bus = Supply::new(&supply());
        let energy = |voltage: f64| 0.5 * 1.5e-3 * voltage * voltage;
        for _ in 0..1000 {
            bus.advance(-0.5 * 1e-5, 0.0, 1e-5);
        }
        let returned = -bus.energy().bridges;
        assert!((bus.voltage() - (48.0 + 5e-3 / 1.5e-3)).abs() < 1e-9, "{}", bus.voltage());
        assert!((energy(bus.voltage()) - energy(48.0) - returned).abs() < 1e-9 * returned);
        assert_eq!(bus.energy().source, 0.0);
        // 2 ohm and 1.5 mF: 3 ms.
        let above = bus.voltage();
        for _ in 0..50 {
            bus.advance(0.0, 1.0, 1e-6);
        }
        // Implicit steps of 1 us: first order in 1 us / 3 ms.
        assert!((bus.voltage() / (above * crate::maths::exp(-50e-6 / 3e-3)) - 1.0).abs() < 1e-5);
        for _ in 0..100_000 {
            bus.advance(0.0, 1.0, 1e-6);
        }
        let held = 48.0 * 2.0 / 2.05;
        assert!((bus.voltage() - held).abs() < 1e-6, "the source feeds the resistor: {}", bus.voltage());
    }

    #[test]
    fn the_code_is_that_of_the_boards_divider() {
        // 48 V / 19 / 3.3 V * 4096.
        assert_eq!(Supply::new(&supply()).code(0.0), 3136);
    }
}
