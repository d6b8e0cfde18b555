//! Records of one identification's result.
//!
//! A result is complete when the count in its `end` equals the records read, and its verdict came with all
//! reasons. Incomplete results are not reported. A lost value must not look like an unknown one, and a lost
//! rejection not like an acceptance.

use crate::trace::records::{
    Base, Covariance, End, Finding, Fit, Kind, Motion, Parameter, Reason, Received, Solver, Stribeck, Verdict,
};

/// Records of one result, as far as they were received.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResultRecords {
    /// How the result was found.
    pub(crate) solver: Option<Solver>,
    /// Fourteen parameters of every joint.
    pub(crate) parameters: Vec<Parameter>,
    /// Base parameters: the combinations that torque determines.
    pub(crate) base: Vec<Base>,
    /// Elements on and below the diagonal.
    pub(crate) covariance: Vec<Covariance>,
    /// Joints with Stribeck friction.
    pub(crate) stribeck: Vec<Stribeck>,
    /// Recorded motions.
    pub(crate) motions: Vec<Motion>,
    /// Residuals of every joint on every motion.
    pub(crate) fits: Vec<Fit>,
    /// All tests.
    pub(crate) findings: Vec<Finding>,
    /// Reasons for rejection.
    pub reasons: Vec<Reason>,
    /// Verdict, once received.
    pub(crate) verdict: Option<Verdict>,
    /// End record, once received.
    pub(crate) end: Option<End>,
    /// Records read, without the end.
    pub(crate) records: u32,
}

impl Kind {
    /// Whether records of this kind belong to a result.
    pub(crate) const fn is_of_result(self) -> bool {
        matches!(
            self,
            Self::Solver
                | Self::Parameter
                | Self::Base
                | Self::Covariance
                | Self::Stribeck
                | Self::Motion
                | Self::Fit
                | Self::Finding
                | Self::Reason
                | Self::Verdict
                | Self::End
        )
    }
}

impl ResultRecords {
    /// Takes a record of the result; others are ignored.
    pub(crate) fn take(&mut self, record: Received) {
        match record {
            Received::Solver(solver) => self.solver = Some(solver),
            Received::Parameter(parameter) => self.parameters.push(parameter),
            Received::Base(base) => self.base.push(base),
            Received::Covariance(element) => self.covariance.push(element),
            Received::Stribeck(stribeck) => self.stribeck.push(stribeck),
            Received::Motion(motion) => self.motions.push(motion),
            Received::Fit(fit) => self.fits.push(fit),
            Received::Finding(finding) => self.findings.push(finding),
            Received::Reason(reason) => self.reasons.push(reason),
            Received::Verdict(verdict) => self.verdict = Some(verdict),
            Received::End(end) => {
                self.end = Some(end);
                return;
            }
            _ => return,
        }
        self.records += 1;
    }

    /// Reason why the result cannot be reported; `None` for a complete result with a verdict.
    pub(crate) fn lacks(&self) -> Option<String> {
        let read = self.records;
        match (&self.end, &self.verdict, &self.solver) {
            (None, ..) => Some(format!("breaks off after {read} records, before its end")),
            (Some(end), ..) if end.records != read => {
                Some(format!("has {} records, of which {read} were read", end.records))
            }
            (_, None, Some(solver)) => {
                Some(format!("was sent before it was judged (search: {})", solver.state))
            }
            (_, None, None) | (_, _, None) => Some("has no solver".into()),
            (_, Some(verdict), _) if verdict.reasons != self.reasons.len() => {
                Some(format!("has {} reasons, of which {} were read", verdict.reasons, self.reasons.len()))
            }
            (_, Some(verdict), _) if (verdict.verdict == "accepted") != self.reasons.is_empty() => {
                Some(format!("is {} with {} reasons against it", verdict.verdict, self.reasons.len()))
            }
            _ => None,
        }
    }
}
