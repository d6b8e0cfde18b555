//! Record of one motion: information, sizes, excluded data. Made by a [`super::recorder::Recorder`].

use super::dropped::Selection;
use super::factor::Factor;
use super::outliers::Outliers;
use super::rows::DECIMATION;
use super::stribeck::StribeckFit;
use crate::real::{self, Real};

/// Size of one joint's torque and speed in a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueSize<T> {
    /// Mean of the absolute filtered torque, N m.
    pub mean_absolute: T,
    /// Root mean square of the filtered torque, N m.
    pub root_mean_square: T,
    /// Root mean square of the smoothed speed, rad/s.
    pub speed: T,
}

/// All data that identification and validation need of one motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Record<T, const N: usize, const B: usize> {
    /// Rows of each joint's torque.
    pub factors: [Factor<T, B>; N],
    /// Size of each joint's torque.
    pub torque: [TorqueSize<T>; N],
    /// Filtered rows of each joint.
    pub rows: [u32; N],
    /// Number of samples and rows that were not finite.
    pub rejected: u32,
    /// Information of one row in units of independent ones, `m sum h^2`: below one because rows overlap.
    pub row_information: T,
    /// Standard deviation of the torque noise of one 500 Hz sample, from its own
    /// scatter, N m; zero if unknown.
    pub noise: [T; N],
    /// Statistics of replaced samples and disturbed rows.
    pub outliers: Outliers<T, N>,
    /// Stribeck friction of each joint that shows it, with its parameters eliminated from the factor.
    pub stribeck: [Option<StribeckFit<T, B>>; N],
    /// Columns held at zero; in held-out motions none are.
    pub selection: Selection<T, N, B>,
}

impl<T: Real, const N: usize, const B: usize> Record<T, N, B> {
    /// Converts to another precision.
    #[must_use]
    pub fn convert<U: Real>(&self) -> Record<U, N, B> {
        let convert = |value: T| U::of(value.to_double());
        Record {
            factors: core::array::from_fn(|joint| self.factors[joint].convert()),
            torque: self.torque.map(|size| TorqueSize {
                mean_absolute: convert(size.mean_absolute),
                root_mean_square: convert(size.root_mean_square),
                speed: convert(size.speed),
            }),
            rows: self.rows,
            rejected: self.rejected,
            row_information: convert(self.row_information),
            noise: self.noise.map(convert),
            outliers: self.outliers.convert(),
            stribeck: core::array::from_fn(|joint| self.stribeck[joint].as_ref().map(StribeckFit::convert)),
            selection: self.selection.convert(),
        }
    }

    /// Standard deviation of one joint's filtered torque due to noise alone, N m; `None` if unknown.
    #[must_use]
    pub fn filtered_noise(&self, joint: usize) -> Option<T> {
        let energy = self.row_information / T::of(DECIMATION as f64); // sum h^2
        self.noise.get(joint).filter(|&&noise| noise > T::zero()).map(|&noise| noise * real::sqrt(energy))
    }

    /// Root mean square torque error of one joint with these base parameters, N m; `None` without rows.
    #[must_use]
    pub fn torque_error(&self, joint: usize, base: &[T; B]) -> Option<T> {
        let factor = self.factors.get(joint)?;
        let rows = *self.rows.get(joint)?;
        if rows == 0 {
            return None;
        }
        let mean = (factor.excess(base) + factor.residual()) / T::of(f64::from(rows));
        Some(real::sqrt(mean))
    }
}
