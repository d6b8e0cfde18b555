//! Columns of a record that are held at zero, and the chi-square that each candidate explains.
//!
//! [`crate::ident::solve::selection`] decides; the record only stores the decisions.

use super::row_model::RowModel;
use crate::model::Parameter;
use crate::real::Real;

/// Decisions about the columns of one record.
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
    #[must_use]
    pub fn all() -> Self {
        Self { is_made: false, dropped: [false; B], gain: [T::zero(); B], stribeck: [None; N] }
    }

    /// Number of base parameters held at zero.
    #[must_use]
    pub fn dropped_count(&self) -> usize {
        self.dropped.iter().filter(|dropped| **dropped).count()
    }

    /// True if this parameter is held at zero.
    #[must_use]
    pub fn drops(&self, model: &RowModel<T, N, B>, joint: usize, parameter: Parameter) -> bool {
        model.drive(joint, parameter).and_then(|base| self.dropped.get(base)).copied().unwrap_or(false)
    }

    /// Converts to another precision.
    #[must_use]
    pub fn convert<U: Real>(&self) -> Selection<U, N, B> {
        let convert = |value: T| U::of(value.to_double());
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
