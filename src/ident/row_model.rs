//! What turns a motion into regressor rows: geometry, gravity, which columns are estimated, and known friction curves.

use nalgebra::Vector3;

use super::choice::{Choice, Constant, DriveChoice};
use super::record::STILL_SPEED;
use super::rows::FilteredRows;
use super::smoothing::Smoothed;
use super::stribeck::{BANK, bank_columns};
use crate::model::{BaseParameters, Chain, JointState, Parameter, friction::Stribeck, regressor};
use crate::real::{self, Real};

/// What turns a motion into regressor rows.
#[derive(Clone, Debug, PartialEq)]
pub struct RowModel<T: Real, const N: usize, const B: usize> {
    /// Geometry of the leg.
    pub chain: Chain<T, N>,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: Vector3<T>,
    /// The columns that torque can tell apart.
    pub base: BaseParameters<T, N, B>,
    /// Whether Stribeck friction of each joint is looked for.
    pub stribeck_choice: [Choice; N],
    /// What of each joint's drive the base parameters hold, and what of it may be dropped.
    pub drive_choice: [DriveChoice; N],
    /// Stribeck friction found before: a factor on the Coulomb column. Without excess until something is found.
    pub stribeck: [Stribeck<T>; N],
}

/// No Stribeck friction.
#[must_use]
pub fn no_stribeck<T: Real, const N: usize>() -> [Stribeck<T>; N] {
    [Stribeck { excess: T::zero(), velocity: T::one() }; N]
}

impl<T: Real, const N: usize, const B: usize> RowModel<T, N, B> {
    /// Without Stribeck friction.
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

    /// Base columns of every joint for one instant, and its torque.
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

    /// The base parameter that is carried by this parameter of a joint.
    #[must_use]
    pub fn drive(&self, joint: usize, parameter: Parameter) -> Option<usize> {
        (0..self.base.rank()).find(|&base| self.base.independent(base) == Some((joint, parameter)))
    }
}
