//! Judgement of one replay: verdict, named cause, parameters.

use std::sync::Arc;

use serde::Serialize;

use crate::battery::dynamics::Values;
use crate::battery::outcome::{Base, Cause, Outcome, Verdict};
use crate::battery::random::Sample;

/// Sigma from the clean fit within which a damaged recording is harmless.
const HARMLESS_SIGMAS: f64 = 3.0;
/// Sigma from the truth within which a parameter is right.
pub(super) const RIGHT_SIGMAS: f64 = 4.0;
/// Share of the rms torque by which an accepted model may be wrong: the default of `--accept-error`.
const ACCEPTED_SHARE: f64 = 0.05;

/// When an acceptance is right.
#[derive(Clone, Debug, Default)]
pub(super) enum Accept {
    /// An acceptance is always wrong.
    #[default]
    Never,
    /// Every parameter with a known truth is within [`RIGHT_SIGMAS`] of it.
    Near(Values),
    /// The parameters are those of the undamaged recording, or the reported direction (name, joint, value)
    /// covers the damage.
    Clean { clean: Arc<Outcome>, injected: Vec<Injected> },
    /// The parameters are right, or the model's torque is, or a reported direction covers the fault.
    Torque { sample: Box<Sample>, injected: Vec<Injected> },
}

/// Direction along which a recording was damaged, its joint if it must be that, and the size in SI units.
pub(super) type Injected = (String, Option<usize>, f64);

/// Whether the damage is within three reported sigma of this direction, so that it would not show.
fn covers(outcome: &Outcome, (name, joint, size): &Injected) -> bool {
    let directions = outcome.found.directions.iter().filter(|found| found.name == *name);
    let mut own = directions.filter(|found| joint.is_none_or(|joint| found.joint == Some(joint)));
    let to_si = |unit: &str| match unit {
        "ms" => 1e-3,
        "%" => 0.01,
        _ => 1.0,
    };
    own.any(|found| found.sigma.is_some_and(|sigma| size.abs() < 3.0 * sigma * to_si(&found.unit)))
}

/// What a case demands.
#[derive(Clone, Debug, Default)]
pub(super) struct Expect {
    pub(super) accept: Accept,
    /// Whether a refusal is right.
    pub(super) refuses: bool,
    /// Whether a refusal must name its cause; `unknown` may be listed in `causes`.
    pub(super) names: bool,
    pub(super) causes: Vec<String>,
    /// Words of bad input that name the fault.
    pub(super) words: Vec<String>,
    /// Damaged joint, from 1, if the cause must name it.
    pub(super) joint: Option<usize>,
}

/// How the likely cause relates to the fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Named {
    Nothing,
    Right,
    Listed,
    Unknown,
    Wrong,
}

/// Judged case, as written to JSON.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Judged {
    pub(super) name: String,
    pub(super) kind: String,
    pub(super) verdict: &'static str,
    pub(super) reasons: Vec<String>,
    pub(super) cause: Option<String>,
    pub(super) named: Named,
    pub(super) wrong_acceptance: bool,
    pub(super) false_refusal: bool,
    /// What is wrong.
    pub(super) miss: Option<String>,
    /// Input of the case in words.
    pub(super) note: String,
    /// Errors over sigma where the truth is known.
    pub(super) errors: Vec<f64>,
}

impl Expect {
    /// Judges what a replay found.
    pub(super) fn judge(&self, outcome: &Outcome) -> Judged {
        let named = self.named(outcome);
        let cause = outcome.found.likely_cause.as_ref();
        let cause = cause.map(|cause| [Some(cause.name.clone()), cause.joint.map(|j| j.to_string())]);
        let cause = cause.map(|words| words.into_iter().flatten().collect::<Vec<_>>().join(" "));
        let is_accepted = outcome.is_accepted();
        let miss = match (is_accepted, named) {
            (true, _) => self.accept.fault(outcome),
            (false, _) if !self.refuses => {
                let failed = outcome.found.findings.iter().filter(|finding| !finding.passed);
                let words: Vec<&str> = failed.map(|finding| finding.words.as_str()).collect();
                Some(format!("refused, must be accepted: {}", words.join("; ")))
            }
            (false, Named::Wrong) => Some(format!("named wrong, {}", self.due())),
            (false, Named::Unknown) if self.names => Some(format!("not named, {}", self.due())),
            _ => None,
        };
        let errors = match &self.accept {
            Accept::Near(truth) => outcome.errors(truth).into_iter().map(|(error, _)| error).collect(),
            _ => Vec::new(),
        };
        Judged {
            name: String::new(),
            kind: String::new(),
            verdict: ["accepted", "accepted with misfit", "refused", "bad input"][outcome.verdict as usize],
            reasons: outcome.found.reasons.clone(),
            cause: cause.or_else(|| (outcome.verdict == Verdict::BadInput).then(|| outcome.words.clone())),
            named,
            wrong_acceptance: is_accepted && miss.is_some(),
            false_refusal: !is_accepted && !self.refuses,
            miss,
            note: String::new(),
            errors,
        }
    }

    /// Expected names in words.
    fn due(&self) -> String {
        let words = self.words.iter().map(|word| format!("`{word}`"));
        let due: Vec<String> = self.causes.iter().cloned().chain(words).collect();
        format!("expected {}", due.join(" or "))
    }

    fn named(&self, outcome: &Outcome) -> Named {
        let is_cause = |name: &str, joint: Option<u64>| {
            let is_joint = self.joint.zip(joint).is_none_or(|(due, named)| due as u64 == named);
            is_joint && self.causes.iter().any(|cause| cause == name)
        };
        match (outcome.verdict, &outcome.found.likely_cause) {
            (Verdict::Accepted | Verdict::Misfit, _) => Named::Nothing,
            _ if self.causes.is_empty() && self.words.is_empty() => Named::Nothing,
            (Verdict::BadInput, _) if self.words.iter().any(|word| outcome.words.contains(word)) => {
                Named::Right
            }
            (Verdict::BadInput, _) | (_, None) => Named::Unknown,
            (_, Some(Cause { name, joint, .. })) if is_cause(name, joint.map(|joint| joint as u64)) => {
                Named::Right
            }
            (_, Some(cause)) => {
                let is_listed = cause.possible.iter().any(|other| {
                    let name = other.as_str().or_else(|| other["name"].as_str());
                    name.is_some_and(|name| is_cause(name, other["joint"].as_u64()))
                });
                match cause.name.as_str() {
                    _ if is_listed => Named::Listed,
                    "unknown" => Named::Unknown,
                    _ => Named::Wrong,
                }
            }
        }
    }
}

impl Accept {
    /// Why this acceptance is wrong.
    fn fault(&self, outcome: &Outcome) -> Option<String> {
        let beyond = |(error, name): (f64, &str)| {
            (error > RIGHT_SIGMAS).then(|| format!("accepted, {name} {error:.1} sigma from the truth"))
        };
        match self {
            Self::Never => Some("accepted, must be refused".into()),
            Self::Near(truth) => outcome.errors(truth).first().copied().and_then(beyond),
            Self::Torque { injected, .. } if injected.iter().any(|injected| covers(outcome, injected)) => {
                None
            }
            Self::Torque { sample, .. } => {
                let worst = outcome.errors(&sample.truth).first().copied().and_then(beyond)?;
                let share = sample.torque_error(&outcome.found.base_parameters);
                (share > ACCEPTED_SHARE).then(|| format!("{worst}, torque {:.1} % wrong", 100.0 * share))
            }
            Self::Clean { clean, injected } => {
                let (shift, name) =
                    largest_shift(&clean.found.base_parameters, &outcome.found.base_parameters);
                let is_covered =
                    !injected.is_empty() && injected.iter().all(|injected| covers(outcome, injected));
                (shift > HARMLESS_SIGMAS && !is_covered)
                    .then(|| format!("accepted, {name} {shift:.1} sigma from the clean fit"))
            }
        }
    }
}

/// Largest distance between two fits in sigma of the second, and its parameter. A parameter of one fit only
/// is zero in the other; a sum of other terms is not the same parameter.
fn largest_shift<'a>(clean: &'a [Base], found: &'a [Base]) -> (f64, &'a str) {
    let known = |bases: &'a [Base]| bases.iter().filter(|base| base.estimate().is_some());
    let only_clean = known(clean).filter(|base| known(found).all(|other| other.name != base.name));
    let shifts = known(found).map(|base| {
        let (value, sigma) = base.estimate().unwrap_or((0.0, 1.0));
        let before = known(clean).find(|other| other.name == base.name);
        let is_same = before.is_none_or(|before| {
            let alike = |(name, factor): (&String, &f64)| {
                before.terms.get(name).is_some_and(|other| (factor - other).abs() <= 1e-6)
            };
            before.terms.len() == base.terms.len() && base.terms.iter().all(alike)
        });
        let old = before.and_then(Base::estimate).map_or(0.0, |(value, _)| value);
        (if is_same { (value - old).abs() / sigma } else { f64::INFINITY }, base.name.as_str())
    });
    let lost = only_clean
        .filter_map(|base| base.estimate().map(|(value, sigma)| (value.abs() / sigma, base.name.as_str())));
    shifts.chain(lost).max_by(|one, other| one.0.total_cmp(&other.0)).unwrap_or((f64::INFINITY, "nothing"))
}
