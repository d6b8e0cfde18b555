//! One motor on a test stand: free with its inertia and friction, or turned by another machine.
//!
//! Why: tests a current loop and its calibration without a leg.
//!
//! ```text
//! free   inertia dw/dt = torque - viscous w - dry friction - load;  at rest it sticks up to the dry friction
//! turned w is given
//! ```
//!
//! The rotor moves once per PWM period by the mean torque of the period (symplectic Euler: 42 us). Angles and
//! speeds are the rotor's, rad and rad/s; N m, kg m^2.
//! Known limits: no elasticity.

use super::axis::{Axis, PERIOD_S};
use super::complete::{CompleteDrives, Rotor};
use super::description::{AxisDescription, CompleteDescription, SupplyDescription};
use super::supply::Supply;
use scarab::hal::{AxisCommand, AxisSample};

/// Mechanical load of the rotor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// Free rotor with inertia and friction.
    Free {
        /// Inertia of the rotor and its load, kg m^2.
        inertia: f64,
        /// Dry friction, N m.
        coulomb: f64,
        /// Viscous friction, N m s/rad.
        viscous: f64,
        /// Constant torque against the positive direction, N m.
        torque: f64,
    },
    /// Turned by another machine at this speed, rad/s.
    Turned(f64),
}

/// An axis on its test stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    drives: CompleteDrives<1>,
    load: Load,
    rotor: Rotor,
    torque: f64,
}

impl Stand {
    /// Creates a stand with the rotor at rest at `angle` (rad), outputs off.
    #[must_use]
    pub fn new(
        axis: &AxisDescription,
        supply: &SupplyDescription,
        load: Load,
        angle: f64,
        seed: u64,
    ) -> Self {
        let description = CompleteDescription::new([*axis], *supply);
        Self {
            drives: CompleteDrives::new(&description, &[angle], seed),
            load,
            rotor: Rotor { angle, speed: 0.0 },
            torque: 0.0,
        }
    }

    /// Changes the load.
    pub fn set_load(&mut self, load: Load) {
        self.load = load;
    }

    /// Breaks the wire of an output (A, B, C from 0).
    pub fn break_wire(&mut self, output: usize) {
        self.drives.break_wire(0, output);
    }

    /// Runs one PWM period: the command acts from its beginning, where the sample is taken.
    pub fn period(&mut self, command: &AxisCommand, brake: f64) -> AxisSample {
        if let Load::Turned(speed) = self.load {
            self.rotor.speed = speed;
        }
        let ([sample], [torque]) = self.drives.period(&[self.rotor], &[*command], brake);
        self.torque = torque;
        self.rotor.angle += self.rotor.speed * PERIOD_S;
        if let Load::Free { inertia, coulomb, viscous, torque: load } = self.load {
            let speed = self.rotor.speed;
            let driven = speed + PERIOD_S / inertia * (torque - load - viscous * speed);
            let dry = PERIOD_S / inertia * coulomb;
            self.rotor.speed = driven - driven.clamp(-dry, dry);
        }
        sample
    }

    /// Angle and speed of the rotor.
    #[must_use]
    pub fn rotor(&self) -> Rotor {
        self.rotor
    }

    /// Mean torque on the rotor in the last period, N m.
    #[must_use]
    pub fn torque(&self) -> f64 {
        self.torque
    }

    /// Present currents along and across the magnets' axis, A; the board has no sensor for them.
    #[must_use]
    pub fn rotor_currents(&self) -> [f64; 2] {
        self.axis().motor().rotor_currents()
    }

    /// The axis.
    #[must_use]
    pub fn axis(&self) -> &Axis {
        let [axis] = self.drives.axes();
        axis
    }

    /// Supply of the stand.
    #[must_use]
    pub fn supply(&self) -> &Supply {
        self.drives.supply()
    }

    /// Supply of the stand, mutable.
    pub fn supply_mut(&mut self) -> &mut Supply {
        self.drives.supply_mut()
    }
}
