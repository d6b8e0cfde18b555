//! Record of one motion: information, sizes, excluded data. Made by a [`super::recorder::Recorder`].

use super::factor::Factor;
use super::row_model::RowModel;
use super::rows::DECIMATION;
use super::stribeck::StribeckFit;
use crate::model::Parameter;
use crate::real::{self, Real};

/// Size of one joint's torque and speed in a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueSize<T> {
    /// Mean of the absolute filtered torque, N m.
    pub mean_absolute: T,
    /// Root mean square of the filtered torque, N m.
    pub root_mean_square: T,
    /// Root mean square of the smoothed speed, rad/s.
    pub(crate) speed: T,
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
    /// Record without noise, rejected samples and outliers, whose rows are independent.
    #[cfg(test)]
    pub(crate) fn plain(factors: [Factor<T, B>; N], torque: [TorqueSize<T>; N], rows: u32) -> Self {
        Self {
            factors,
            torque,
            rows: [rows; N],
            rejected: 0,
            row_information: T::one(),
            noise: [T::zero(); N],
            outliers: Outliers::none(),
            stribeck: [const { None }; N],
            selection: Selection::all(),
        }
    }

    /// Converts to another precision.
    pub fn convert<U: Real>(&self) -> Record<U, N, B> {
        let convert = |value: T| U::from_double(value.to_double());
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
    pub fn filtered_noise(&self, joint: usize) -> Option<T> {
        let energy = self.row_information / T::from_double(DECIMATION as f64); // sum h^2
        self.noise.get(joint).filter(|&&noise| noise > T::zero()).map(|&noise| noise * real::sqrt(energy))
    }

    /// Root mean square torque error of one joint with these base parameters, N m; `None` without rows.
    pub fn torque_error(&self, joint: usize, base: &[T; B]) -> Option<T> {
        let factor = self.factors.get(joint)?;
        let rows = *self.rows.get(joint)?;
        if rows == 0 {
            return None;
        }
        let mean = (factor.excess(base) + factor.residual()) / T::from_double(f64::from(rows));
        Some(real::sqrt(mean))
    }
}

/// Replaced samples and down-weighted rows of one motion.
///
/// A result rests on how many samples were replaced ([`crate::ident::signal::hampel`]) and how much of the
/// motion got less weight (`reweighting`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outliers<T, const N: usize> {
    /// 500 Hz samples taken in.
    pub samples: u32,
    /// Isolated outliers of each joint's angle and torque, replaced before the filter.
    pub replaced: [u32; N],
    /// Share of each joint's rows that got less than half of their weight, 0..1.
    pub disturbed_share: [T; N],
    /// Longest stretch of disturbed rows of each joint, s.
    pub longest_s: [T; N],
    /// Longest stretch in which all joints' rows were disturbed at once, s.
    pub longest_common_s: T,
    /// Error over torque, root mean squares over all rows, with the parameters that the weighted rows give.
    pub(crate) whole_error_share: [T; N],
}

impl<T: Real, const N: usize> Outliers<T, N> {
    /// Empty statistics.
    pub(crate) fn none() -> Self {
        Self {
            samples: 0,
            replaced: [0; N],
            disturbed_share: [T::zero(); N],
            longest_s: [T::zero(); N],
            longest_common_s: T::zero(),
            whole_error_share: [T::zero(); N],
        }
    }

    /// Converts to another precision.
    pub fn convert<U: Real>(&self) -> Outliers<U, N> {
        let convert = |value: T| U::from_double(value.to_double());
        Outliers {
            samples: self.samples,
            replaced: self.replaced,
            disturbed_share: self.disturbed_share.map(convert),
            longest_s: self.longest_s.map(convert),
            longest_common_s: convert(self.longest_common_s),
            whole_error_share: self.whole_error_share.map(convert),
        }
    }
}

/// Decisions about the columns of one record: those held at zero, and the chi-square that each candidate
/// explains. [`crate::ident::solve::selection`] decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection<T, const N: usize, const B: usize> {
    /// True when the elimination has ended.
    pub is_made: bool,
    /// Base parameters that are held at zero.
    pub dropped: [bool; B],
    /// (C1) of every candidate, at the time of dropping for a dropped one; zero for all others.
    pub gain: [T; B],
    /// Gain and surplus (N m) of the best Stribeck curve of each joint that was searched, accepted or not.
    pub stribeck: [Option<(T, T)>; N],
}

impl<T: Real, const N: usize, const B: usize> Selection<T, N, B> {
    /// Selection of all columns, before any decision.
    pub fn all() -> Self {
        Self { is_made: false, dropped: [false; B], gain: [T::zero(); B], stribeck: [None; N] }
    }

    /// Number of base parameters held at zero.
    pub fn dropped_count(&self) -> usize {
        self.dropped.iter().filter(|dropped| **dropped).count()
    }

    /// True if this parameter is held at zero.
    pub(crate) fn drops(&self, model: &RowModel<T, N, B>, joint: usize, parameter: Parameter) -> bool {
        model.drive(joint, parameter).and_then(|base| self.dropped.get(base)).copied().unwrap_or(false)
    }

    /// Converts to another precision.
    pub fn convert<U: Real>(&self) -> Selection<U, N, B> {
        let convert = |value: T| U::from_double(value.to_double());
        Selection {
            is_made: self.is_made,
            dropped: self.dropped,
            gain: self.gain.map(convert),
            stribeck: self
                .stribeck
                .map(|tried| tried.map(|(gain, surplus)| (convert(gain), convert(surplus)))),
        }
    }
}
