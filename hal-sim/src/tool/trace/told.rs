//! One identification's result as it was told, record by record.
//!
//! It is complete when its `end` counts as many records as were read, its verdict among them with all reasons. Nothing else is
//! reported: a value that was lost must not look like one that is not known, nor a refusal like an acceptance.

use scarab::trace::{Line, LineError};

use super::fields::{text, told, value};

told! {
    /// The solver.
    Solver {
        /// One-time or sequential.
        plan: String = text,
        /// Of the swarm.
        swarm_seed: u64 = value,
        /// Of the search.
        state: String = text,
        /// Of the swarm.
        iterations: u32 = value,
        /// Of the swarm.
        evaluations: u32 = value,
        /// Of the completion.
        steps: u32 = value,
        /// Determined.
        rank: usize = value,
        /// There are.
        base: usize = value,
        /// Of the scaled problem.
        condition: f32 = value,
        /// Of a leg that can exist.
        consistency_chi2: f32 = value,
    }
}
told! {
    /// One of a joint's fourteen.
    Parameter {
        /// From 1.
        joint: usize = value,
        /// Which.
        symbol: String = text,
        /// SI.
        value: f32 = value,
        /// Standard deviation.
        sigma: f32 = value,
        /// Where it is from.
        status: String = text,
    }
}
told! {
    /// One base parameter.
    Base {
        /// From 0.
        index: usize = value,
        /// Of the carrier, from 1.
        joint: usize = value,
        /// Of the carrier.
        symbol: String = text,
        /// Others are in it.
        grouped: bool = value,
        /// Held at zero.
        dropped: bool = value,
        /// SI.
        value: f32 = value,
        /// Standard deviation.
        sigma: f32 = value,
        /// Of the closed form.
        least_squares: f32 = value,
    }
}
told! {
    /// One element.
    Covariance {
        /// From 0.
        row: usize = value,
        /// From 0.
        column: usize = value,
        /// SI.
        value: f32 = value,
    }
}
told! {
    /// Stribeck friction.
    Stribeck {
        /// From 1.
        joint: usize = value,
        /// Above Coulomb's.
        surplus_nm: f32 = value,
        /// Standard deviation.
        surplus_sigma_nm: f32 = value,
        /// Of the fall.
        speed_rad_s: f32 = value,
        /// Standard deviation.
        speed_sigma_rad_s: f32 = value,
        /// Explained.
        gain_chi2: f32 = value,
    }
}
told! {
    /// A recorded motion.
    Motion {
        /// 0 is the one identified from.
        motion: usize = value,
        /// At 500 Hz.
        samples: u32 = value,
        /// Of all joints.
        longest_common_s: f32 = value,
    }
}
told! {
    /// One joint on one motion.
    Fit {
        /// 0 is the one identified from.
        motion: usize = value,
        /// From 1.
        joint: usize = value,
        /// Measured minus predicted.
        rms_nm: f32 = value,
        /// Of the torque.
        mean_abs_nm: f32 = value,
        /// Of the torque.
        torque_rms_nm: f32 = value,
        /// Of the rows.
        disturbed_share: f32 = value,
        /// At a stretch.
        disturbed_longest_s: f32 = value,
        /// Samples.
        replaced: u32 = value,
    }
}
told! {
    /// One test.
    Finding {
        /// If it failed.
        reason: String = text,
        /// Which.
        test: String = text,
        /// From 1; 0 for none.
        joint: usize = value,
        /// From 1; 0 for the one identified from, or all.
        motion: usize = value,
        /// Seen.
        value: f32 = value,
        /// Allowed.
        limit: f32 = value,
        /// Within it.
        passed: bool = value,
    }
}
told! {
    /// One reason.
    Reason {
        /// Of the closed list.
        reason: String = text,
    }
}
told! {
    /// The last word.
    Verdict {
        /// `accepted` or `refused`.
        verdict: String = text,
        /// How many.
        reasons: usize = value,
    }
}
told! {
    /// All is told.
    End {
        /// This one not included.
        records: u32 = value,
    }
}

/// A result, as far as it was told.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Told {
    /// How it was found.
    pub solver: Option<Solver>,
    /// All fourteen of every joint.
    pub parameters: Vec<Parameter>,
    /// What torque determines.
    pub base: Vec<Base>,
    /// On and below the diagonal.
    pub covariance: Vec<Covariance>,
    /// Of joints that show it.
    pub stribeck: Vec<Stribeck>,
    /// Recorded.
    pub motions: Vec<Motion>,
    /// Of every joint on every motion.
    pub fits: Vec<Fit>,
    /// Every test.
    pub findings: Vec<Finding>,
    /// Against it.
    pub reasons: Vec<Reason>,
    /// The last word.
    pub verdict: Option<Verdict>,
    /// How many records it has.
    pub end: Option<End>,
    /// How many were read, the end not included.
    pub records: u32,
}

/// Kinds that belong to a result.
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

impl Told {
    /// Takes a record of one of [`KINDS`].
    ///
    /// # Errors
    /// A key that is missing, a value that is none; then the result stays incomplete.
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

    /// Why it cannot be reported; `None` for a complete result with a verdict.
    #[must_use]
    pub fn lacks(&self) -> Option<String> {
        let read = self.records;
        match (&self.end, &self.verdict, &self.solver) {
            (None, ..) => Some(format!("breaks off after {read} records, before its end")),
            (Some(end), ..) if end.records != read => {
                Some(format!("has {} records, of which {read} were read", end.records))
            }
            (_, None, Some(solver)) => {
                Some(format!("was told before it was judged (search: {})", solver.state))
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
