//! Records of one identification's result.
//!
//! A result is complete when the count in its `end` equals the records read, and its verdict came with all
//! reasons. Incomplete results are not reported. A lost value must not look like an unknown one, and a lost
//! rejection not like an acceptance.

use scarab::trace::{Line, LineError};

use crate::formats::trace::fields::{record, text, value};

record! {
    /// How the result was found.
    Solver {
        /// One-time or sequential.
        plan: String = text,
        /// Seed of the swarm.
        swarm_seed: u64 = value,
        /// Final state of the search.
        state: String = text,
        /// Iterations the swarm has run.
        iterations: u32 = value,
        /// Evaluations of the swarm's cost.
        evaluations: u32 = value,
        /// Steps of the completion.
        steps: u32 = value,
        /// Rank: base parameters that the data determine.
        rank: usize = value,
        /// Number of base parameters.
        base: usize = value,
        /// Condition number of the scaled problem.
        condition: f32 = value,
        /// Chi-square that a physically consistent leg costs above least squares.
        consistency_chi2: f32 = value,
    }
}
record! {
    /// One of the fourteen parameters of a joint.
    Parameter {
        /// Joint, from 1.
        joint: usize = value,
        /// Symbol of the parameter.
        symbol: String = text,
        /// Estimate, SI units.
        value: f32 = value,
        /// Standard deviation, SI units.
        sigma: f32 = value,
        /// `identified`, `grouped`, `weak` or `prior`
        status: String = text,
    }
}
record! {
    /// One base parameter.
    Base {
        /// Index of the base parameter, from 0.
        index: usize = value,
        /// Joint of the carrier, from 1.
        joint: usize = value,
        /// Symbol of the carrier.
        symbol: String = text,
        /// Whether other parameters are grouped into it.
        grouped: bool = value,
        /// Whether the base parameter is held at zero.
        dropped: bool = value,
        /// Estimate, SI units.
        value: f32 = value,
        /// Standard deviation, SI units.
        sigma: f32 = value,
        /// Least-squares solution, SI units.
        least_squares: f32 = value,
    }
}
record! {
    /// One element of the covariance.
    Covariance {
        /// Row, from 0.
        row: usize = value,
        /// Column, from 0.
        column: usize = value,
        /// Covariance, SI units.
        value: f32 = value,
    }
}
record! {
    /// Stribeck friction of one joint.
    Stribeck {
        /// Joint, from 1.
        joint: usize = value,
        /// Static friction above Coulomb friction.
        surplus_nm: f32 = value,
        /// Standard deviation of `surplus_nm`.
        surplus_sigma_nm: f32 = value,
        /// Speed at which the surplus has fallen to 1/e.
        speed_rad_s: f32 = value,
        /// Standard deviation of `speed_rad_s`.
        speed_sigma_rad_s: f32 = value,
        /// Chi-square explained by the Stribeck column.
        gain_chi2: f32 = value,
    }
}
record! {
    /// Index of the motion; 0 is the training motion.
    Motion {
        /// Index of the motion; 0 is the training motion.
        motion: usize = value,
        /// Recorded samples, at 500 Hz.
        samples: u32 = value,
        /// Longest stretch in which all joints' rows were disturbed at once.
        longest_common_s: f32 = value,
    }
}
record! {
    /// Residual of one joint on one motion.
    Fit {
        /// 0 is the motion identified from.
        motion: usize = value,
        /// Joint, from 1.
        joint: usize = value,
        /// RMS of measured minus predicted torque.
        rms_nm: f32 = value,
        /// Mean absolute torque.
        mean_abs_nm: f32 = value,
        /// RMS torque.
        torque_rms_nm: f32 = value,
        /// Share of disturbed rows.
        disturbed_share: f32 = value,
        /// Longest stretch of disturbed rows.
        disturbed_longest_s: f32 = value,
        /// Samples replaced as outliers.
        replaced: u32 = value,
    }
}
record! {
    /// One test of the result.
    Finding {
        /// Reason for rejection if the test failed.
        reason: String = text,
        /// Name of the test.
        test: String = text,
        /// Joint, from 1; 0 for none.
        joint: usize = value,
        /// Motion, from 1; 0 for the one identified from, or all.
        motion: usize = value,
        /// Tested value.
        value: f32 = value,
        /// Limit of the value.
        limit: f32 = value,
        /// Whether the value is within the limit.
        passed: bool = value,
    }
}
record! {
    /// Reason for rejection.
    Reason {
        /// Word of the closed list of reasons.
        reason: String = text,
    }
}
record! {
    /// Verdict on the result.
    Verdict {
        /// `accepted` or `refused`.
        verdict: String = text,
        /// Number of reasons.
        reasons: usize = value,
    }
}
record! {
    /// End of the result.
    End {
        /// Records of the result, without this one.
        records: u32 = value,
    }
}

/// Records of one result, as far as they were received.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResultRecords {
    /// How the result was found.
    pub solver: Option<Solver>,
    /// Fourteen parameters of every joint.
    pub parameters: Vec<Parameter>,
    /// Base parameters: the combinations that torque determines.
    pub base: Vec<Base>,
    /// Elements on and below the diagonal.
    pub covariance: Vec<Covariance>,
    /// Joints with Stribeck friction.
    pub stribeck: Vec<Stribeck>,
    /// Recorded motions.
    pub motions: Vec<Motion>,
    /// Residuals of every joint on every motion.
    pub fits: Vec<Fit>,
    /// All tests.
    pub findings: Vec<Finding>,
    /// Reasons for rejection.
    pub reasons: Vec<Reason>,
    /// Verdict, once received.
    pub verdict: Option<Verdict>,
    /// End record, once received.
    pub end: Option<End>,
    /// Records read, without the end.
    pub records: u32,
}

/// Kinds of record that belong to a result.
pub const KINDS: [&str; 11] = [
    "solver",
    "parameter",
    "base",
    "covariance",
    "stribeck",
    "motion",
    "fit",
    "finding",
    "reason",
    "verdict",
    "end",
];

impl ResultRecords {
    /// Takes a record of one of [`KINDS`].
    ///
    /// # Errors
    /// A key is missing or a value invalid; then the result stays incomplete.
    pub fn take(&mut self, line: &Line<'_>) -> Result<(), LineError<'static>> {
        match line.kind() {
            "solver" => self.solver = Some(Solver::read(line)?),
            "parameter" => self.parameters.push(Parameter::read(line)?),
            "base" => self.base.push(Base::read(line)?),
            "covariance" => self.covariance.push(Covariance::read(line)?),
            "stribeck" => self.stribeck.push(Stribeck::read(line)?),
            "motion" => self.motions.push(Motion::read(line)?),
            "fit" => self.fits.push(Fit::read(line)?),
            "finding" => self.findings.push(Finding::read(line)?),
            "reason" => self.reasons.push(Reason::read(line)?),
            "verdict" => self.verdict = Some(Verdict::read(line)?),
            "end" => {
                self.end = Some(End::read(line)?);
                return Ok(());
            }
            _ => return Ok(()),
        }
        self.records += 1;
        Ok(())
    }

    /// Reason why the result cannot be reported; `None` for a complete result with a verdict.
    #[must_use]
    pub fn lacks(&self) -> Option<String> {
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
