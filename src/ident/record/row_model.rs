//! Model that turns a motion into regressor rows: geometry, gravity, columns, friction curves.

use nalgebra::Vector3;

use super::choice::{Choice, Constant, DriveChoice};
use super::recorder::{PULSE_COUNTS, STILL_PULSES, STILL_SPEED};
use super::rows::FilteredRows;
use super::stribeck::{BANK, LARGEST_PULSE, bank_columns};
use crate::ident::signal::smoothing::Smoothed;
use crate::model::{BaseParameters, Chain, JointState, Parameter, friction::Stribeck, regressor};
use crate::real::{self, Real};

/// Geometry, columns and friction curves that turn a motion into regressor rows.
#[derive(Clone, Debug, PartialEq)]
pub struct RowModel<T: Real, const N: usize, const B: usize> {
    /// Geometry of the leg.
    pub chain: Chain<T, N>,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: Vector3<T>,
    /// Base parameters: the columns that torque can separate.
    pub base: BaseParameters<T, N, B>,
    /// Whether to search for Stribeck friction, per joint.
    pub stribeck_choice: [Choice; N],
    /// Drive parameters in the base set, and which of them may be dropped, per joint.
    pub drive_choice: [DriveChoice; N],
    /// Known Stribeck friction: a factor on the Coulomb column. Zero excess until one is found.
    pub stribeck: [Stribeck<T>; N],
    /// Pulse of the smoothed speed at one count of a joint's encoder, rad/s.
    pub pulse: [T; N],
    /// Smoothed speed below which a joint may stick, rad/s.
    pub still_speed: [T; N],
}

/// Zero Stribeck friction for all joints.
pub fn no_stribeck<T: Real, const N: usize>() -> [Stribeck<T>; N] {
    [Stribeck { excess: T::zero(), velocity: T::one() }; N]
}

impl<T: Real, const N: usize, const B: usize> RowModel<T, N, B> {
    /// Builds a model without Stribeck friction.
    pub fn new(chain: Chain<T, N>, gravity: Vector3<T>, base: BaseParameters<T, N, B>) -> Self {
        Self {
            chain,
            gravity,
            base,
            stribeck_choice: [Choice::Off; N],
            drive_choice: [DriveChoice::ALL; N],
            stribeck: no_stribeck(),
            pulse: [T::zero(); N],
            still_speed: [T::from_double(STILL_SPEED); N],
        }
    }

    /// Sets the angles of the encoders' counts, rad, for rows of this bandwidth.
    pub fn set_encoders(&mut self, step_rad: &[T; N], bandwidth_hz: T) {
        self.pulse = step_rad.map(|step| T::from_double(PULSE_COUNTS) * step * bandwidth_hz);
        self.still_speed = self
            .pulse
            .map(|pulse| real::max(T::from_double(STILL_SPEED), T::from_double(STILL_PULSES) * pulse));
    }

    /// Whether to search for Stribeck friction of a joint. With `auto` only where the encoder's pulses are
    /// much smaller than the speed of the slowest curve, else the pulses look like one.
    pub fn stribeck_choice(&self, joint: usize) -> Choice {
        match self.stribeck_choice[joint] {
            Choice::Auto if self.pulse[joint] > T::from_double(LARGEST_PULSE) => Choice::Off,
            choice => choice,
        }
    }

    /// Base columns of every joint and its torque at one instant.
    pub fn rows(&self, instant: &Smoothed<T, N>) -> FilteredRows<T, N, B> {
        let state = JointState { q: instant.position, qd: instant.velocity, qdd: instant.acceleration };
        let mut full = regressor(&self.chain, &state, &self.gravity);
        let mut rows = FilteredRows {
            regressor: [[T::zero(); B]; N],
            stribeck: [[T::zero(); BANK]; N],
            torque: instant.torque,
            still: [T::zero(); N],
        };
        for joint in 0..N {
            let speed = instant.velocity[joint];
            if real::abs(speed) < self.still_speed[joint] {
                rows.still[joint] = T::one();
            }
            if self.stribeck[joint].excess > T::zero() {
                full[joint][joint][Parameter::FC.index()] *= self.stribeck[joint].factor(speed);
            }
            if self.drive_choice[joint].meaning == Constant::Asymmetry {
                full[joint][joint][Parameter::OFF.index()] = real::abs(real::sign(speed));
            }
            if self.stribeck_choice(joint).is_possible() {
                rows.stribeck[joint] = bank_columns(speed);
            }
            self.base.select(&full[joint], &mut rows.regressor[joint]);
        }
        rows
    }

    /// Base parameters that are known to be zero, each with its standard deviation, N m.
    pub fn known_to_be_zero(&self) -> impl Iterator<Item = (usize, T)> + '_ {
        self.drive_choice.iter().enumerate().filter_map(|(joint, choice)| {
            let within = T::from_double(f64::from(choice.within_nm.filter(|within| *within > 0.0)?));
            Some((self.drive(joint, Parameter::OFF)?, within))
        })
    }

    /// Index of the base parameter that stands for this parameter of a joint.
    pub fn drive(&self, joint: usize, parameter: Parameter) -> Option<usize> {
        (0..self.base.rank()).find(|&base| self.base.independent(base) == Some((joint, parameter)))
    }
}
