//! Accepted or refused, and why: the last word before a model may move anybody.
//!
//! | reason | refused when | file |
//! | --- | --- | --- |
//! | `input` | too few rows, samples that are not finite, a joint whose torque never differs from zero | `input` |
//! | `unexcited` | a joint hardly moved, parameters are not told apart, or held-out torque is left uncertain | `input`, `fit` |
//! | `unphysical` | negative friction, rotor inertia or kinetic energy; or the data contradict every leg that the prior allows | `physics` |
//! | `residual` | the motion identified from is not explained, or held-out motions ask for other lengths and zeros | `fit`, `held_out` |
//! | `validation` | torque on an unused motion is predicted worse than noise and the parameters' uncertainty let expect, or what is left of it is large and slow | `fit`, `held_out` |
//! | `not_a_measurement` | the torque holds no trace of inertia and friction | `fit` |
//! | `contact` | all joints miss together for a second or more | `disturbance`, `held_out` |
//! | `outliers` | too many samples were wild, too many rows disturbed | `disturbance` |
//!
//! Every test leaves an [`Evidence`], passed or not: what was seen, where, and the limit. Every limit is a field of
//! [`Thresholds`] with the reason for its default; where noise decides, it follows from degrees of freedom and one
//! false-alarm rate.

mod disturbance;
mod evidence;
mod fit;
mod held_out;
mod input;
mod physics;
mod thresholds;

pub use evidence::{Docket, Evidence, Test};
pub use fit::Unused;
pub use thresholds::Thresholds;

/// Why a result is refused; a closed list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Reason {
    /// No body can have these parameters.
    Unphysical,
    /// The motion did not show what was asked for.
    Unexcited,
    /// What the model leaves unexplained is not noise.
    Residual,
    /// Another motion is predicted badly.
    Validation,
    /// The torque was computed, not measured.
    NotAMeasurement,
    /// Too many outliers.
    Outliers,
    /// The leg touched something.
    Contact,
    /// The data cannot be used.
    Input,
}

impl Reason {
    /// All reasons, in the order of their bits.
    pub const ALL: [Self; 8] = [
        Self::Unphysical,
        Self::Unexcited,
        Self::Residual,
        Self::Validation,
        Self::NotAMeasurement,
        Self::Outliers,
        Self::Contact,
        Self::Input,
    ];

    /// The word used in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unphysical => "unphysical",
            Self::Unexcited => "unexcited",
            Self::Residual => "residual",
            Self::Validation => "validation",
            Self::NotAMeasurement => "not_a_measurement",
            Self::Outliers => "outliers",
            Self::Contact => "contact",
            Self::Input => "input",
        }
    }
}

/// The reasons against a result; none means accepted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Verdict(u8);

impl Verdict {
    /// Nothing speaks against it.
    pub const ACCEPTED: Self = Self(0);

    /// Refused for one reason.
    #[must_use]
    pub const fn refused(reason: Reason) -> Self {
        Self(1 << reason as u8)
    }

    /// The reasons of both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// No reason against it.
    #[must_use]
    pub const fn is_accepted(self) -> bool {
        self.0 == 0
    }

    /// Whether this is one of the reasons.
    #[must_use]
    pub const fn has(self, reason: Reason) -> bool {
        self.0 & (1 << reason as u8) != 0
    }

    /// The reasons, in the order of [`Reason::ALL`].
    pub fn reasons(self) -> impl Iterator<Item = Reason> {
        Reason::ALL.into_iter().filter(move |reason| self.has(*reason))
    }
}
