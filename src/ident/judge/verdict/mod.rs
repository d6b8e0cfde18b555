//! Verdict on a model, with reasons: the last check before the model may move a wearer.
//!
//! | reason | refused when | file |
//! | --- | --- | --- |
//! | `input` | too few rows, samples not finite, a joint whose torque is always zero | `input` |
//! | `unexcited` | a joint hardly moved, undetermined parameters, uncertain prediction | `input`, `fit` |
//! | `unphysical` | negative friction, rotor inertia or energy; no consistent leg fits | `physics` |
//! | `residual` | poor fit to the motion identified from; wrong lengths and zeros | `fit`, `held_out` |
//! | `validation` | held-out error above noise and covariance; large slow residual | `fit`, `held_out` |
//! | `not_a_measurement` | the torque shows no inertia and friction | `fit` |
//! | `contact` | large errors in all joints at once for a second or more | `disturbance`, `held_out` |
//! | `outliers` | too many samples replaced, too many rows disturbed | `disturbance` |
//!
//! Every test leaves an [`Evidence`], passed or not: value, location and limit. Every limit is a field of
//! [`Thresholds`] with the reason for its default. Where noise decides, the limit follows from degrees of
//! freedom and one false-alarm rate.

use crate::listed::listed;

mod disturbance;
mod evidence;
mod fit;
mod held_out;
mod input;
mod physics;
mod thresholds;

pub use evidence::{Evidence, Test, VerdictBuilder};
pub use fit::Unused;
pub use thresholds::Thresholds;

listed! {
    /// Reason of a refusal; a closed list.
    #[repr(u8)]
    pub enum Reason {
        /// All reasons, in the order of their bits.
        ALL,
        /// Word used in reports.
        name;
        /// No body can have these parameters.
        Unphysical, "unphysical";
        /// The motion excited too few parameters.
        Unexcited, "unexcited";
        /// The residual on the motion identified from is not noise.
        Residual, "residual";
        /// A held-out motion is predicted badly.
        Validation, "validation";
        /// The torque was computed, not measured.
        NotAMeasurement, "not_a_measurement";
        /// Too many outliers.
        Outliers, "outliers";
        /// The leg touched something.
        Contact, "contact";
        /// The data are not usable.
        Input, "input";
    }
}

/// Reasons against a result; an empty set means accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict(u8);

impl Verdict {
    /// Verdict without any reason against the result.
    pub const ACCEPTED: Self = Self(0);

    /// Verdict with one reason.
    pub const fn refused(reason: Reason) -> Self {
        Self(1 << reason as u8)
    }

    /// Union of the reasons of both.
    pub(crate) const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// True without any reason against the result.
    pub const fn is_accepted(self) -> bool {
        self.0 == 0
    }

    /// True if this is one of the reasons.
    pub const fn has(self, reason: Reason) -> bool {
        self.0 & (1 << reason as u8) != 0
    }

    /// Reasons in the order of [`Reason::ALL`].
    pub fn reasons(self) -> impl Iterator<Item = Reason> {
        Reason::ALL.into_iter().filter(move |reason| self.has(*reason))
    }
}
