//! Evidence of every test: value, location and limit, so that a report can explain both refusal and pass.

use super::{Reason, Verdict};
use crate::listed::listed;
use crate::real::Real;

listed! {
    /// A test of the verdict.
    pub enum Test {
        /// All tests, in the order of the enum.
        ALL,
        /// Word used in reports.
        name;
        /// Usable rows of a joint.
        Rows, "rows";
        /// Number of samples and rows that were not finite.
        NotFinite, "not_finite";
        /// Root mean square of a joint's torque, N m.
        Torque, "torque";
        /// Cost of the search's end above least squares, chi-square units; the largest value without an end.
        Search, "search";
        /// Drive enabled until the end: 1, or 0.
        Drive, "drive";
        /// Root mean square speed of a joint, rad/s.
        Speed, "speed";
        /// Number of base parameters that the data determine.
        Determined, "determined";
        /// Condition number of the scaled problem.
        Condition, "condition";
        /// Uncertainty of a held-out torque due to the parameters' covariance, over its root mean square.
        PredictedUncertainty, "predicted_uncertainty";
        /// A parameter that is not finite.
        Finite, "finite";
        /// Negative excess of a parameter that cannot be negative, in standard deviations.
        NegativeParameter, "negative_parameter";
        /// Negative excess of the kinetic energy, in standard deviations.
        NegativeEnergy, "negative_energy";
        /// Chi-square of the best allowed leg above least squares.
        PriorBox, "prior_box";
        /// Share of inertia and friction in a joint's torque.
        DynamicShare, "dynamic_share";
        /// Error on the motion identified from, N m.
        TrainingError, "training_error";
        /// Error over torque on all rows of the motion identified from, excluded ones included.
        WholeError, "whole_error";
        /// Error on a held-out motion, N m.
        ValidationError, "validation_error";
        /// Slow part of the residual on a held-out motion, N m.
        SlowResidual, "slow_residual";
        /// Apparent relative error of the length of the link before a joint.
        LinkLength, "link_length";
        /// Apparent error of a joint's encoder zero, rad.
        EncoderZero, "encoder_zero";
        /// Time with large errors in all joints at once, s.
        CommonDisturbance, "common_disturbance";
        /// Share of a joint's samples replaced as outliers.
        ReplacedShare, "replaced_share";
        /// Share of a joint's rows that lost more than half of their weight.
        DisturbedShare, "disturbed_share";
        /// Pulse of a joint's smoothed speed at one count of its encoder, rad/s.
        EncoderPulse, "encoder_pulse";
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
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// Adds a value that must not exceed its limit; NaN fails.
    pub(crate) fn at_most(
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
    pub(crate) fn at_least(&mut self, reason: Reason, test: Test, joint: Option<usize>, value: T, limit: T) {
        self.note(Evidence { reason, test, joint, motion: None, value, limit, passed: value >= limit });
    }

    /// Adds a test with a condition of its own.
    pub(crate) fn note(&mut self, evidence: Evidence<T>) {
        if !evidence.passed {
            self.verdict = self.verdict.and(Verdict::refused(evidence.reason));
        }
        (self.hand_on)(&evidence);
    }
}
