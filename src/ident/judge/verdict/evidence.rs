//! Evidence of every test: value, location and limit, so that a report can explain both refusal and pass.

use super::{Reason, Verdict};
use crate::real::Real;

/// A test of the verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Test {
    /// Usable rows of a joint.
    Rows,
    /// Number of samples and rows that were not finite.
    NotFinite,
    /// Root mean square of a joint's torque, N m.
    Torque,
    /// Cost of the search's end above least squares, chi-square units; the largest value if it did not end.
    Search,
    /// Drive enabled until the end: 1, or 0.
    Drive,
    /// Root mean square speed of a joint, rad/s.
    Speed,
    /// Number of base parameters that the data determine.
    Determined,
    /// Condition number of the scaled problem.
    Condition,
    /// Uncertainty of a held-out torque due to the parameters' covariance, over its root mean square.
    PredictedUncertainty,
    /// A parameter that is not finite.
    Finite,
    /// Negative excess of a parameter that cannot be negative, in standard deviations.
    NegativeParameter,
    /// Negative excess of the kinetic energy, in standard deviations.
    NegativeEnergy,
    /// Chi-square of the best allowed leg above least squares.
    PriorBox,
    /// Share of inertia and friction in a joint's torque.
    DynamicShare,
    /// Error on the motion identified from, N m.
    TrainingError,
    /// Error over torque on all rows of the motion identified from, excluded ones included.
    WholeError,
    /// Error on a held-out motion, N m.
    ValidationError,
    /// Slow part of the residual on a held-out motion, N m.
    SlowResidual,
    /// Apparent relative error of the length of the link before a joint.
    LinkLength,
    /// Apparent error of a joint's encoder zero, rad.
    EncoderZero,
    /// Time with large errors in all joints at once, s.
    CommonDisturbance,
    /// Share of a joint's samples replaced as outliers.
    ReplacedShare,
    /// Share of a joint's rows that lost more than half of their weight.
    DisturbedShare,
    /// Pulse of a joint's smoothed speed at one count of its encoder, rad/s.
    EncoderPulse,
}

impl Test {
    /// All tests, in the order of the enum.
    pub const ALL: [Self; 24] = [
        Self::Rows,
        Self::NotFinite,
        Self::Torque,
        Self::Search,
        Self::Drive,
        Self::Speed,
        Self::Determined,
        Self::Condition,
        Self::PredictedUncertainty,
        Self::Finite,
        Self::NegativeParameter,
        Self::NegativeEnergy,
        Self::PriorBox,
        Self::DynamicShare,
        Self::TrainingError,
        Self::WholeError,
        Self::ValidationError,
        Self::SlowResidual,
        Self::LinkLength,
        Self::EncoderZero,
        Self::CommonDisturbance,
        Self::ReplacedShare,
        Self::DisturbedShare,
        Self::EncoderPulse,
    ];

    /// Word used in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rows => "rows",
            Self::NotFinite => "not_finite",
            Self::Torque => "torque",
            Self::Search => "search",
            Self::Drive => "drive",
            Self::Speed => "speed",
            Self::Determined => "determined",
            Self::Condition => "condition",
            Self::PredictedUncertainty => "predicted_uncertainty",
            Self::Finite => "finite",
            Self::NegativeParameter => "negative_parameter",
            Self::NegativeEnergy => "negative_energy",
            Self::PriorBox => "prior_box",
            Self::DynamicShare => "dynamic_share",
            Self::TrainingError => "training_error",
            Self::WholeError => "whole_error",
            Self::ValidationError => "validation_error",
            Self::SlowResidual => "slow_residual",
            Self::LinkLength => "link_length",
            Self::EncoderZero => "encoder_zero",
            Self::CommonDisturbance => "common_disturbance",
            Self::ReplacedShare => "replaced_share",
            Self::DisturbedShare => "disturbed_share",
            Self::EncoderPulse => "encoder_pulse",
        }
    }
}

/// Result of one test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence<T> {
    /// Reason of a refusal if the test failed.
    pub reason: Reason,
    /// Test performed.
    pub test: Test,
    /// Joint, from 0; `None` for all.
    pub joint: Option<usize>,
    /// Held-out motion, from 0; `None` for the motion identified from, or for all.
    pub motion: Option<usize>,
    /// Measured value.
    pub value: T,
    /// Limit for the value.
    pub limit: T,
    /// True if the value is within the limit.
    pub passed: bool,
}

/// Collects evidence into a verdict, and forwards each piece.
pub struct VerdictBuilder<'a, T> {
    verdict: Verdict,
    hand_on: &'a mut dyn FnMut(&Evidence<T>),
}

impl<'a, T: Real> VerdictBuilder<'a, T> {
    /// Empty builder; every piece of evidence goes to `hand_on` as well.
    pub fn new(hand_on: &'a mut dyn FnMut(&Evidence<T>)) -> Self {
        Self { verdict: Verdict::ACCEPTED, hand_on }
    }

    /// Verdict of the evidence so far.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// Adds a value that must not exceed its limit; NaN fails.
    pub fn at_most(
        &mut self,
        reason: Reason,
        test: Test,
        joint: Option<usize>,
        motion: Option<usize>,
        value: T,
        limit: T,
    ) {
        self.note(Evidence { reason, test, joint, motion, value, limit, passed: value <= limit });
    }

    /// Adds a value that must reach its limit; NaN fails.
    pub fn at_least(&mut self, reason: Reason, test: Test, joint: Option<usize>, value: T, limit: T) {
        self.note(Evidence { reason, test, joint, motion: None, value, limit, passed: value >= limit });
    }

    /// Adds a test with a condition of its own.
    pub fn note(&mut self, evidence: Evidence<T>) {
        if !evidence.passed {
            self.verdict = self.verdict.and(Verdict::refused(evidence.reason));
        }
        (self.hand_on)(&evidence);
    }
}
