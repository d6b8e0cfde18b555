//! The complete drives of a leg: every axis with its motor, on one supply.
//!
//! ```text
//! one PWM period of the first axis
//! | quarter 0          | quarter 1          | quarter 2          | quarter 3          |
//!  axis 0 begins        axis 1 begins        axis 2 begins
//! ```
//!
//! An axis begins its own period a quarter after the one before, as on the board: their converters are shared, and their bus
//! currents do not coincide. When an axis begins, its sensors are read and the command handed over acts; what is computed
//! from the sample is handed over a period later. Held constant: speed of the rotors and brake duty within a period of the first axis, bus
//! voltage within a quarter.

use super::axis::{Axis, AxisFlow, PERIOD_S, QUARTER_S, QUARTERS};
use super::description::CompleteDescription;
use super::supply::Supply;
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::hal::{AxisCommand, AxisSample};

/// Standard deviation of the bus voltage's code.
const BUS_NOISE_CODES: f64 = 1.0;

/// Where a rotor is and how fast it turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rotor {
    /// rad.
    pub angle: f64,
    /// rad/s.
    pub speed: f64,
}

/// Axes on their supply, with the noise of their sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct CompleteDrives<const N: usize> {
    axes: [Axis; N],
    supply: Supply,
    noise: Xoshiro256PlusPlus,
}

impl<const N: usize> CompleteDrives<N> {
    /// Released, rotors at rest at these angles (rad).
    #[must_use]
    pub fn new(description: &CompleteDescription<N>, angles: &[f64; N], seed: u64) -> Self {
        Self {
            axes: core::array::from_fn(|axis| {
                Axis::new(&description.axes[axis], angles[axis], QUARTERS - axis as u32 % QUARTERS)
            }),
            supply: Supply::new(&description.supply),
            noise: Xoshiro256PlusPlus::seed_from_u64(seed),
        }
    }

    /// One PWM period of the first axis: samples as they come, and the mean torque of each rotor, N m. `brake` is the share
    /// of time for which the brake resistor is on.
    pub fn period(
        &mut self,
        rotors: &[Rotor; N],
        commands: &[AxisCommand; N],
        brake: f64,
    ) -> ([AxisSample; N], [f64; N]) {
        for (axis, rotor) in self.axes.iter_mut().zip(rotors) {
            axis.set_rotor(rotor.angle, rotor.speed);
        }
        let (mut samples, mut torque) = ([AxisSample::default(); N], [0.0; N]);
        for quarter in 0..QUARTERS {
            let (bus, mut charge) = (self.supply.voltage(), 0.0);
            for index in 0..N {
                let axis = &mut self.axes[index];
                if quarter == index as u32 % QUARTERS {
                    let noise: f64 = StandardNormal.sample(&mut self.noise);
                    let code = self.supply.code(BUS_NOISE_CODES * noise);
                    samples[index] = axis.begin(&commands[index], code, &mut self.noise);
                }
                let AxisFlow { impulse, charge: drawn, .. } = axis.advance(bus);
                torque[index] += impulse / PERIOD_S;
                charge += drawn;
            }
            self.supply.advance(charge, brake, QUARTER_S);
        }
        (samples, torque)
    }

    /// Puts the rotors elsewhere, without current.
    pub fn place(&mut self, angles: &[f64; N]) {
        for (axis, angle) in self.axes.iter_mut().zip(angles) {
            axis.place(*angle);
        }
    }

    /// One axis each.
    #[must_use]
    pub fn axes(&self) -> &[Axis; N] {
        &self.axes
    }

    /// The wire of an axis' output (A, B, C from 0) breaks.
    pub fn break_wire(&mut self, axis: usize, output: usize) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.break_wire(output);
        }
    }

    /// What feeds them.
    #[must_use]
    pub fn supply(&self) -> &Supply {
        &self.supply
    }

    /// What feeds them, to be changed.
    pub fn supply_mut(&mut self) -> &mut Supply {
        &mut self.supply
    }
}
