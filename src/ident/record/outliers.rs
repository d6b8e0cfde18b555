//! Statistics of excluded data in one motion: replaced samples and disturbed stretches.
//!
//! Silent cleaning would hide the data that a result is based on. The record of a motion therefore says how
//! many samples were replaced ([`crate::ident::signal::hampel`]) and how much of the motion got less weight
//! ([`super::reweighting`]).

use crate::real::Real;

/// Replaced samples and down-weighted rows of one motion.
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
    pub whole_error_share: [T; N],
}

impl<T: Real, const N: usize> Outliers<T, N> {
    /// Empty statistics.
    #[must_use]
    pub fn none() -> Self {
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
    #[must_use]
    pub fn convert<U: Real>(&self) -> Outliers<U, N> {
        let convert = |value: T| U::of(value.to_double());
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
