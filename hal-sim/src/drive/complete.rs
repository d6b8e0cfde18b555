//! Complete drives of a leg: every axis with its motor, on one supply.
//!
//! ```text
//! one PWM period of the first axis
//! | quarter 0          | quarter 1          | quarter 2          | quarter 3          |
//!  axis 0 begins                             axis 1 begins
//! ```
//!
//! An axis begins its own period half a period after the preceding axis, as on the board; the description can
//! change that shift. At that instant its sensors are read and the given command acts. The answer to a sample
//! is applied a period later. Held constant: speed of the rotors and brake duty within a period of the first
//! axis, bus voltage within a quarter.
//!
//! **Coupling.** Where coupling is described, an edge of another axis' bridge shortly before an axis'
//! converter holds adds an error to both of its shunts.
//! Known limit: an axis that begins at the same instant does not disturb.

use super::axis::{Axis, AxisFlow, PERIOD_S, QUARTER_S, QUARTERS};
use super::description::{CompleteDescription, CouplingDescription};
use super::supply::Supply;
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::hal::{AxisCommand, AxisSample};

/// Standard deviation of the bus voltage's code.
const BUS_NOISE_CODES: f64 = 1.0;

/// Angle and speed of a rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rotor {
    /// Angle, rad.
    pub angle: f64,
    /// Speed, rad/s.
    pub speed: f64,
}

/// Axes on their supply, with the noise of their sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct CompleteDrives<const N: usize> {
    axes: [Axis; N],
    supply: Supply,
    /// Quarter in which each axis begins.
    begins: [u32; N],
    coupling: CouplingDescription,
    noise: Xoshiro256PlusPlus,
}

impl<const N: usize> CompleteDrives<N> {
    /// Drives with outputs off and rotors at rest at these angles, rad.
    pub fn new(description: &CompleteDescription<N>, angles: &[f64; N], seed: u64) -> Self {
        let begins = core::array::from_fn(|axis| axis as u32 * description.shift_quarters % QUARTERS);
        Self {
            axes: core::array::from_fn(|axis| {
                Axis::new(&description.axes[axis], angles[axis], QUARTERS - begins[axis])
            }),
            supply: Supply::new(&description.supply),
            begins,
            coupling: description.coupling,
            noise: Xoshiro256PlusPlus::seed_from_u64(seed),
        }
    }

    /// Runs one PWM period of the first axis. Returns the samples taken, and the mean torque of each rotor, N
    /// m. `brake` is the duty of the brake resistor.
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
                if quarter == self.begins[index] {
                    let noise: f64 = StandardNormal.sample(&mut self.noise);
                    let code = self.supply.code(BUS_NOISE_CODES * noise);
                    let disturbance = self.disturbance(index);
                    let axis = &mut self.axes[index];
                    axis.disturb(disturbance);
                    samples[index] = axis.begin(&commands[index], code, &mut self.noise);
                }
            }
            for (index, axis) in self.axes.iter_mut().enumerate() {
                let AxisFlow { impulse, charge: drawn, .. } = axis.advance(bus);
                torque[index] += impulse / PERIOD_S;
                charge += drawn;
            }
            self.supply.advance(charge, brake, QUARTER_S);
        }
        (samples, torque)
    }

    /// Error of an axis' shunts by edges of the others in the window before its converter holds, A.
    fn disturbance(&self, axis: usize) -> f64 {
        if self.coupling.ampere_per_edge == 0.0 {
            return 0.0;
        }
        let hold = self.axes[axis].description().shunts.delay;
        let others = self.axes.iter().zip(self.begins).filter(|(_, begins)| *begins != self.begins[axis]);
        let edges: i32 = others.map(|(other, _)| other.edges(hold - self.coupling.window, hold)).sum();
        self.coupling.ampere_per_edge * f64::from(edges)
    }

    /// Moves the rotors to these angles, at rest and without current.
    pub fn move_to(&mut self, angles: &[f64; N]) {
        for (axis, angle) in self.axes.iter_mut().zip(angles) {
            axis.move_to(*angle);
        }
    }

    /// All axes.
    pub fn axes(&self) -> &[Axis; N] {
        &self.axes
    }

    /// Breaks the wire of an axis' output (A, B, C from 0).
    pub fn break_wire(&mut self, axis: usize, output: usize) {
        if let Some(axis) = self.axes.get_mut(axis) {
            axis.break_wire(output);
        }
    }

    /// Supply of the drives.
    pub fn supply(&self) -> &Supply {
        &self.supply
    }

    /// Supply of the drives, mutable.
    pub fn supply_mut(&mut self) -> &mut Supply {
        &mut self.supply
    }
}
