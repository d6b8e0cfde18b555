//! One motor on a test stand: free with its inertia and friction, turned by another machine, or with gear
//! and leg.
//!
//! Why: tests a current loop and its calibration without a leg, and with one on a gear with backlash.
//!
//! ```text
//! free   inertia dw/dt = torque - viscous w - dry friction - load;  at rest it sticks up to the dry friction
//! turned w is given
//! geared rotor as above, its load is the teeth's torque t / ratio
//!        leg: inertia dw/dt = t - gravity sin(angle) - friction
//!        t = 5e4 N m/rad (rotor / ratio - angle beyond half the backlash), damped, never pulling
//! ```
//!
//! The rotor moves once per PWM period by the mean torque of the period (symplectic Euler: 42 us). Angles and
//! speeds are the rotor's, rad and rad/s; N m, kg m^2.
//! Known limits: no elasticity but that of the teeth.

use super::axis::{Axis, PERIOD_S};
use super::complete::{CompleteDrives, Rotor};
use super::description::{AxisDescription, CompleteDescription, SupplyDescription};
use super::supply::Supply;
use crate::maths::{sin_cos, sqrt};
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
    /// A gear with a leg behind it.
    Geared(Geared),
}

/// Rotor, gear with backlash, and a leg that hangs from the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geared {
    /// Inertia of the rotor, kg m^2.
    pub rotor_inertia: f64,
    /// Dry friction at the rotor, N m.
    pub rotor_coulomb: f64,
    /// Viscous friction at the rotor, N m s/rad.
    pub rotor_viscous: f64,
    /// Rotor turns per joint turn.
    pub ratio: f64,
    /// Angle that the joint turns freely, rad.
    pub backlash: f64,
    /// Inertia of the leg about the joint, kg m^2.
    pub inertia: f64,
    /// Dry friction at the joint, N m.
    pub coulomb: f64,
    /// Viscous friction at the joint, N m s/rad.
    pub viscous: f64,
    /// Gravity's torque on the horizontal leg, N m.
    pub gravity: f64,
    /// Angle of the leg from hanging where the rotor's angle is that of the start, rad.
    pub start: f64,
    /// Time after which a hand that supports the leg has let go, s; it lets go within half a second.
    pub supported_s: f64,
}

/// Stiffness of the teeth, N m/rad at the joint, and their damping ratio.
const TEETH: f64 = 5e4;
const TEETH_DAMPING: f64 = 0.3;

impl Geared {
    /// Torque that the rotor passes to the leg, N m; angles from the start, speeds at the joint.
    fn teeth(&self, [rotor, joint]: [f64; 2], [rotor_speed, joint_speed]: [f64; 2]) -> f64 {
        let apart = rotor - joint;
        let pressed = apart - apart.clamp(-0.5 * self.backlash, 0.5 * self.backlash);
        if pressed == 0.0 {
            return 0.0;
        }
        let reflected = self.rotor_inertia * self.ratio * self.ratio;
        let both = reflected * self.inertia / (reflected + self.inertia);
        let damping = 2.0 * TEETH_DAMPING * sqrt(TEETH * both);
        let torque = TEETH * pressed + damping * (rotor_speed - joint_speed);
        // Teeth push only.
        if pressed > 0.0 { torque.max(0.0) } else { torque.min(0.0) }
    }
}

/// Stiffness (N m/rad) and damping (N m s/rad) of the hand, and the time in which it lets go, s.
const HAND: [f64; 2] = [400.0, 20.0];
const LET_GO_S: f64 = 0.5;

/// Speed after dry friction has acted for a period.
fn braked(speed: f64, dry: f64) -> f64 {
    speed - speed.clamp(-dry, dry)
}

/// An axis on its test stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    drives: CompleteDrives<1>,
    load: Load,
    rotor: Rotor,
    /// Angle of the rotor at the start, rad.
    begin: f64,
    /// Angle from the start and speed of the joint behind a gear.
    joint: Rotor,
    periods: u32,
    torque: f64,
}

impl Stand {
    /// Creates a stand with the rotor at rest at `angle` (rad), outputs off.
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
            begin: angle,
            joint: Rotor::default(),
            periods: 0,
            torque: 0.0,
        }
    }

    /// Changes the load. A gear begins at rest, with its leg at the start.
    pub fn set_load(&mut self, load: Load) {
        self.load = load;
        if matches!(load, Load::Geared(_)) {
            (self.begin, self.joint, self.periods) = (self.rotor.angle, Rotor::default(), 0);
            self.rotor.speed = 0.0;
        }
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
        self.periods = self.periods.saturating_add(1);
        match self.load {
            Load::Turned(_) => {}
            Load::Free { inertia, coulomb, viscous, torque: load } => {
                let speed = self.rotor.speed;
                let driven = speed + PERIOD_S / inertia * (torque - load - viscous * speed);
                self.rotor.speed = braked(driven, PERIOD_S / inertia * coulomb);
            }
            Load::Geared(geared) => self.move_geared(&geared, torque),
        }
        sample
    }

    /// Moves the rotor's speed and the leg under this torque of the motor.
    fn move_geared(&mut self, geared: &Geared, torque: f64) {
        let rotor = (self.rotor.angle - self.begin) / geared.ratio;
        let teeth =
            geared.teeth([rotor, self.joint.angle], [self.rotor.speed / geared.ratio, self.joint.speed]);
        let speed = self.rotor.speed;
        let driven = speed
            + PERIOD_S / geared.rotor_inertia
                * (torque - teeth / geared.ratio - geared.rotor_viscous * speed);
        self.rotor.speed = braked(driven, PERIOD_S / geared.rotor_inertia * geared.rotor_coulomb);
        let pull = |angle: f64| geared.gravity * sin_cos(geared.start + angle).0;
        let support = (geared.supported_s - f64::from(self.periods) * PERIOD_S) / LET_GO_S;
        // The hand bears the leg where it was at the start.
        let hand = pull(0.0) - HAND[0] * self.joint.angle - HAND[1] * self.joint.speed;
        let acting = teeth - pull(self.joint.angle) + support.clamp(0.0, 1.0) * hand;
        let driven =
            self.joint.speed + PERIOD_S / geared.inertia * (acting - geared.viscous * self.joint.speed);
        self.joint.speed = braked(driven, PERIOD_S / geared.inertia * geared.coulomb);
        self.joint.angle += self.joint.speed * PERIOD_S;
    }

    /// Angle from the start (rad) and speed of the joint behind a gear.
    pub fn joint(&self) -> Rotor {
        self.joint
    }

    /// Angle and speed of the rotor.
    pub fn rotor(&self) -> Rotor {
        self.rotor
    }

    /// Mean torque on the rotor in the last period, N m.
    pub fn torque(&self) -> f64 {
        self.torque
    }

    /// Present currents along and across the magnets' axis, A; the board has no sensor for them.
    pub fn rotor_currents(&self) -> [f64; 2] {
        self.axis().motor().rotor_currents()
    }

    /// The axis.
    pub fn axis(&self) -> &Axis {
        let [axis] = self.drives.axes();
        axis
    }

    /// Supply of the stand.
    pub fn supply(&self) -> &Supply {
        self.drives.supply()
    }

    /// Supply of the stand, mutable.
    pub fn supply_mut(&mut self) -> &mut Supply {
        self.drives.supply_mut()
    }
}
