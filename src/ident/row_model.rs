//! Model that turns a motion into regressor rows: geometry, gravity, columns, friction curves.

use nalgebra::Vector3;

use super::choice::{Choice, Constant, DriveChoice};
use super::record::STILL_SPEED;
use super::rows::FilteredRows;
use super::smoothing::Smoothed;
use super::stribeck::{BANK, bank_columns};
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
}

/// Zero Stribeck friction for all joints.
#[must_use]
pub fn no_stribeck<T: Real, const N: usize>() -> [Stribeck<T>; N] {
    [Stribeck { excess: T::zero(), velocity: T::one() }; N]
}

impl<T: Real, const N: usize, const B: usize> RowModel<T, N, B> {
    /// Builds a model without Stribeck friction.
    #[must_use]
    pub fn new(chain: Chain<T, N>, gravity: Vector3<T>, base: BaseParameters<T, N, B>) -> Self {
        Self {
            chain,
            gravity,
            base,
            stribeck_choice: [Choice::Off; N],
            drive_choice: [DriveChoice::ALL; N],
            stribeck: no_stribeck(),
        }
    }

    /// Base columns of every joint and its torque at one instant.
    #[must_use]
    pub fn rows(&self, instant: &Smoothed<T, N>) -> FilteredRows<T, N, B> {
        let state = JointState { q: instant.position, qd: instant.velocity, qdd: instant.acceleration };
        let mut full = regressor(&self.chain, &state, &self.gravity);
        let mut rows = FilteredRows {
            regressor: [[T::zero(); B]; N],
            stribeck: [[T::zero(); BANK]; N],
            torque: instant.torque,
            still: instant
                .velocity
                .map(|velocity| if real::abs(velocity) < T::of(STILL_SPEED) { T::one() } else { T::zero() }),
        };
        for joint in 0..N {
            let speed = instant.velocity[joint];
            if self.stribeck[joint].excess > T::zero() {
                full[joint][joint][Parameter::FC.index()] *= self.stribeck[joint].factor(speed);
            }
            if self.drive_choice[joint].meaning == Constant::Asymmetry {
                full[joint][joint][Parameter::OFF.index()] = real::abs(real::sign(speed));
            }
            if self.stribeck_choice[joint].is_possible() {
                rows.stribeck[joint] = bank_columns(speed);
            }
            self.base.select(&full[joint], &mut rows.regressor[joint]);
        }
        rows
    }

    /// Index of the base parameter that stands for this parameter of a joint.
    #[must_use]
    pub fn drive(&self, joint: usize, parameter: Parameter) -> Option<usize> {
        (0..self.base.rank()).find(|&base| self.base.independent(base) == Some((joint, parameter)))
    }
}
