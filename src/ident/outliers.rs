//! What was set aside of one motion: wild samples before the filter, disturbed stretches after it.
//!
//! A result that was cleaned silently cannot be trusted; so the record of a motion says how many samples were
//! replaced ([`super::hampel`]) and how much of the motion counted for less ([`super::reweighting`]).

use crate::real::Real;

/// What was set aside of one motion before and after filtering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outliers<T, const N: usize> {
    /// 500 Hz samples taken in.
    pub samples: u32,
    /// Isolated wild angles and torques of each joint, replaced before the filter.
    pub replaced: [u32; N],
    /// Share of each joint's rows that got less than half of their weight, 0..1.
    pub disturbed_share: [T; N],
    /// Longest stretch of disturbed rows of each joint, s.
    pub longest_s: [T; N],
    /// Longest stretch in which all joints' rows were disturbed at once, s.
    pub longest_common_s: T,
    /// What the rows that counted say of all rows, those set aside included: the error's root mean square over the torque's.
    pub whole_error_share: [T; N],
}

impl<T: Real, const N: usize> Outliers<T, N> {
    /// Nothing taken in, nothing set aside.
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

    /// The same in another precision.
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
