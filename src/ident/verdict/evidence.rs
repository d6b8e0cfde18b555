//! What every test saw, where, and its limit: so that a refusal can be told in words and a pass shown.

use super::{Reason, Verdict};
use crate::real::Real;

/// A test of the verdict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Test {
    /// Rows of a joint.
    Rows,
    /// Samples and rows that were not finite.
    NotFinite,
    /// Root mean square of a joint's torque, N m.
    Torque,
    /// The search came to its end: 1, or 0.
    Search,
    /// The drive stayed enabled to the end: 1, or 0.
    Drive,
    /// Root mean square speed of a joint, rad/s.
    Speed,
    /// Base parameters that the data determine.
    Determined,
    /// Condition number of the scaled problem.
    Condition,
    /// Uncertainty of a held-out torque that the parameters' covariance leaves, over its root mean square.
    PredictedUncertainty,
    /// A parameter that is not a number.
    Finite,
    /// Standard deviations by which a parameter that cannot be negative is so.
    NegativeParameter,
    /// Standard deviations by which kinetic energy is negative.
    NegativeEnergy,
    /// Chi-square by which the best leg that the prior allows is worse than least squares.
    PriorBox,
    /// Share of a joint's torque that inertia and friction make.
    DynamicShare,
    /// Error on the motion identified from, N m.
    TrainingError,
    /// Error of all rows of the motion identified from, those set aside included, over their torque.
    WholeError,
    /// Error on a held-out motion, N m.
    ValidationError,
    /// Slow part of what is unexplained on a held-out motion, N m.
    SlowResidual,
    /// Share by which the link before a joint seems longer than believed.
    LinkLength,
    /// Angle by which a joint's zero seems off, rad.
    EncoderZero,
    /// Time for which all joints missed together, s.
    CommonDisturbance,
    /// Share of a joint's samples that were wild and replaced.
    ReplacedShare,
    /// Share of a joint's rows that lost more than half of their weight.
    DisturbedShare,
}

impl Test {
    /// All tests, in their order.
    pub const ALL: [Self; 23] = [
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
    ];

    /// The word used in reports.
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
        }
    }
}

/// One test that was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence<T> {
    /// Why the result is refused if it failed.
    pub reason: Reason,
    /// Which.
    pub test: Test,
    /// Of this joint, from 0.
    pub joint: Option<usize>,
    /// On this unused motion, from 0; `None` for the motion identified from, or for all.
    pub motion: Option<usize>,
    /// What was seen.
    pub value: T,
    /// What is allowed.
    pub limit: T,
    /// Within it.
    pub passed: bool,
}

/// Collects evidence into a verdict, and hands each piece on.
pub struct Docket<'a, T> {
    verdict: Verdict,
    hand_on: &'a mut dyn FnMut(&Evidence<T>),
}

impl<'a, T: Real> Docket<'a, T> {
    /// Nothing tested yet; every piece of evidence goes to `hand_on` as well.
    pub fn new(hand_on: &'a mut dyn FnMut(&Evidence<T>)) -> Self {
        Self { verdict: Verdict::ACCEPTED, hand_on }
    }

    /// The reasons so far.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// A value that must not exceed its limit; one that is not a number does.
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

    /// A value that must reach its limit; one that is not a number does not.
    pub fn at_least(&mut self, reason: Reason, test: Test, joint: Option<usize>, value: T, limit: T) {
        self.note(Evidence { reason, test, joint, motion: None, value, limit, passed: value >= limit });
    }

    /// A test with a condition of its own.
    pub fn note(&mut self, evidence: Evidence<T>) {
        if !evidence.passed {
            self.verdict = self.verdict.and(Verdict::refused(evidence.reason));
        }
        (self.hand_on)(&evidence);
    }
}
