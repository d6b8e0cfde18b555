//! Evidence of the verdict: every test with its value and limit, and a sentence for each failure.

use scarab::ident::{Evidence, Reason, Test};
use serde::{Deserialize, Serialize};

use scarab_base::number::Number;
use scarab_base::words::{Word, word};

use crate::report::RunReport;
use crate::report::doubt::UnseenSpring;

/// Largest error of a length, as share, and of a zero, rad, that a step from the model still estimates.
const LINEAR_LENGTH: f64 = 0.3;
const LINEAR_ZERO_RAD: f64 = 0.35;

/// One test of the verdict, with its result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FindingReport {
    /// Reason for rejection if the test failed: a word of the closed list.
    #[serde(deserialize_with = "word")]
    pub reason: Word,
    /// Name of the test.
    #[serde(deserialize_with = "word")]
    pub test: Word,
    /// Joint, from 1; `null` if the test does not concern one joint.
    pub joint: Option<usize>,
    /// Name of the unused motion; `null` for the training motion, or for all.
    pub motion: Option<String>,
    /// Tested value.
    pub value: Number,
    /// Limit of the value.
    pub limit: Number,
    /// Whether the value is within the limit.
    pub passed: bool,
    /// Meaning of a failed test in a sentence with its numbers; empty if it passed.
    pub words: String,
}

impl FindingReport {
    /// Report of one piece of evidence; `motions` are the names of the unused motions.
    pub fn new(evidence: &Evidence<f32>, motions: &[&str]) -> Self {
        let motion = evidence.motion.map(|index| {
            motions.get(index).map_or_else(|| format!("motion {}", index + 1), |name| (*name).to_owned())
        });
        let words =
            if evidence.passed { String::new() } else { sentence(evidence, motion.as_deref().unwrap_or("")) };
        Self {
            reason: evidence.reason.name(),
            test: evidence.test.name(),
            joint: evidence.joint.map(|joint| joint + 1),
            motion,
            value: evidence.value.into(),
            limit: evidence.limit.into(),
            passed: evidence.passed,
            words,
        }
    }

    /// Report of a test with a value and a limit; `failure` is the sentence of a failed one. Joints count
    /// from 1.
    pub fn judged(
        reason: Word,
        test: Word,
        joint: Option<usize>,
        [value, limit]: [Number; 2],
        failure: Option<String>,
    ) -> Self {
        let passed = failure.is_none();
        Self { reason, test, joint, motion: None, value, limit, passed, words: failure.unwrap_or_default() }
    }

    /// Report of a drive that stopped before the end of the identification; `words` give the reason.
    pub fn stopped(words: String) -> Self {
        let values = [0.0, 1.0].map(Number::from);
        Self::judged(Reason::Input.name(), Test::Drive.name(), None, values, Some(words))
    }
}

/// Error of a link's length that every recording should show.
const LARGEST_UNTESTED_LENGTH: f64 = 0.1;

/// Sentences about what a recording hardly tests: lengths whose test has a wide limit, and springs.
pub fn hardly_tested(run: &RunReport) -> Vec<String> {
    let wide = |finding: &&FindingReport| {
        finding.test == Test::LinkLength.name()
            && finding.passed
            && finding.limit.known().is_none_or(|limit| limit > LARGEST_UNTESTED_LENGTH)
    };
    let words = |finding: &FindingReport| {
        let shown = finding
            .limit
            .known()
            .map_or("no error".into(), |limit| format!("only errors above {:.0} %", 100.0 * limit));
        format!(
            "length of the link before joint {}: this recording shows {shown}; measure it, or hold out a motion that \
             excites every joint",
            finding.joint.unwrap_or(0)
        )
    };
    let springs = run.doubt.iter().filter(|_| run.accepted()).flat_map(|doubt| &doubt.unseen_springs);
    run.findings.iter().filter(wide).map(words).chain(springs.map(UnseenSpring::words)).collect()
}

/// Sentence for a failed test.
fn sentence(evidence: &Evidence<f32>, motion: &str) -> String {
    let joint = evidence.joint.map_or(0, |joint| joint + 1);
    let (value, limit) = (f64::from(evidence.value), f64::from(evidence.limit));
    let [percent, percent_limit] = [value, limit].map(|share| 100.0 * share);
    let on = if motion.is_empty() { String::new() } else { format!(" on {motion}") };
    match evidence.test {
        Test::Rows => {
            format!("joint {joint} moved in {value:.0} of the filtered rows, at least {limit:.0} are needed")
        }
        Test::NotFinite => format!("{value:.0} samples or rows{on} are not finite"),
        Test::Torque => format!("the torque of joint {joint} is always zero"),
        Test::Search if value.abs() < 1e30 => format!(
            "the search has not converged: it ended {value:.2} chi-square units above least squares, limit {limit:.2}; \
             try another --swarm-seed"
        ),
        Test::Search => "the search did not finish".into(),
        Test::Drive => "the drive stopped during the identification".into(),
        Test::Speed
        | Test::EncoderPulse
        | Test::Determined
        | Test::Condition
        | Test::PredictedUncertainty => weak_excitation(evidence, joint, &on),
        Test::Finite => format!("a parameter of joint {joint} is not finite"),
        Test::NegativeParameter => format!(
            "a parameter of joint {joint} that must be positive is {value:.1} sigma below zero, limit {limit:.0} sigma"
        ),
        Test::NegativeEnergy => {
            format!("kinetic energy is negative in some posture, by {value:.1} sigma, limit {limit:.0} sigma")
        }
        Test::PriorBox => format!(
            "every leg that the prior allows misses the data: {value:.0} chi-square units above least squares, limit \
             {limit:.0}"
        ),
        Test::DynamicShare => format!(
            "inertia and friction make {percent:.2} % of the torque of joint {joint}, a measured torque has at least \
             {percent_limit:.0} %: it was computed from the angle"
        ),
        Test::TrainingError | Test::WholeError | Test::ValidationError | Test::SlowResidual => {
            torque_error(evidence, joint, &on)
        }
        Test::LinkLength | Test::EncoderZero => other_geometry(evidence, joint),
        Test::CommonDisturbance => {
            let on = if motion.is_empty() { " on the training motion" } else { on.as_str() };
            format!(
                "something held the leg{on}: the torques of all joints deviate together for {value:.2} s, limit {limit:.2} s"
            )
        }
        Test::ReplacedShare => format!(
            "joint {joint}: {percent:.1} % of the samples{on} are outliers, limit {percent_limit:.0} %"
        ),
        Test::DisturbedShare => {
            format!("joint {joint}: {percent:.0} % of the rows{on} are disturbed, limit {percent_limit:.0} %")
        }
    }
}

/// Sentence for a motion that does not show every parameter.
fn weak_excitation(evidence: &Evidence<f32>, joint: usize, on: &str) -> String {
    let (value, limit) = (f64::from(evidence.value), f64::from(evidence.limit));
    match evidence.test {
        Test::Speed => {
            format!("joint {joint} hardly moved: {value:.4} rad/s rms, at least {limit:.3} are needed")
        }
        Test::EncoderPulse => format!(
            "encoder too coarse at this bandwidth: one count of joint {joint} is a pulse of {value:.3} rad/s, limit \
             {limit:.3} rad/s; {:.2} times this bandwidth is low enough",
            limit / value
        ),
        Test::Determined => format!("the motion determines {value:.0} of {limit:.0} base parameters"),
        Test::Condition if value.abs() < 1e30 => {
            format!("the motion hardly distinguishes the parameters: condition {value:.0}, limit {limit:.0}")
        }
        Test::Condition => "the motion does not distinguish the parameters".into(),
        Test::PredictedUncertainty => format!(
            "the excitation leaves the torque of joint {joint}{on} uncertain by {:.1} % of its rms, limit {:.1} %",
            100.0 * value,
            100.0 * limit
        ),
        other => unreachable!("{other:?} is no test of the excitation"),
    }
}

/// Sentence for torque that differs from the model's.
fn torque_error(evidence: &Evidence<f32>, joint: usize, on: &str) -> String {
    let (value, limit) = (f64::from(evidence.value), f64::from(evidence.limit));
    let known = value.abs() < 1e30;
    match evidence.test {
        Test::TrainingError if known => format!(
            "joint {joint}: torque error of {value:.3} N m rms on the training motion, limit {limit:.3} N m"
        ),
        Test::TrainingError => format!("no torque of joint {joint} could be compared with the model"),
        Test::WholeError => format!(
            "joint {joint}: torque error of {:.0} % on the training motion, excluded rows included, limit {:.0} %: hold a \
             motion out",
            100.0 * value,
            100.0 * limit
        ),
        Test::ValidationError if known => {
            format!("joint {joint}: torque error of {value:.3} N m rms{on}, limit {limit:.3} N m")
        }
        Test::ValidationError => format!("no torque of joint {joint}{on} could be compared with the model"),
        Test::SlowResidual => format!(
            "joint {joint}: slow residual of {value:.3} N m{on}, longer than half a second, limit {limit:.3} N m"
        ),
        other => unreachable!("{other:?} is no error of torque"),
    }
}

/// Sentence for a link's length or a joint's zero that the torque contradicts.
fn other_geometry(evidence: &Evidence<f32>, joint: usize) -> String {
    let (value, limit) = (f64::from(evidence.value), f64::from(evidence.limit));
    let (found, limit, alike) = if evidence.test == Test::LinkLength {
        let (percent, direction) = (100.0 * value.abs(), if value < 0.0 { "shorter" } else { "longer" });
        let found = format!("a link before joint {joint} {percent:.1} % {direction} than configured");
        (found, format!("{:.1} %", 100.0 * limit), "a wrong zero")
    } else {
        let [degrees, limit] = [value, limit].map(f64::to_degrees);
        let found = format!("the zero of joint {joint} {degrees:+.1} degrees from the configured one");
        (found, format!("{limit:.1} degrees"), "another length")
    };
    if !is_small(evidence.test.name(), value) {
        return format!(
            "the torque contradicts the model like another length before joint {joint} or another zero, of a size that is \
             not determined"
        );
    }
    format!(
        "the torque indicates another geometry: {found}, limit {limit}; {alike} or a leaning trunk looks alike"
    )
}

/// Whether an error of length or zero is so small that its linear estimate means something.
pub(crate) fn is_small(test: &str, value: f64) -> bool {
    match test {
        name if name == Test::LinkLength.name() => value.abs() <= LINEAR_LENGTH,
        name if name == Test::EncoderZero.name() => value.abs() <= LINEAR_ZERO_RAD,
        _ => false,
    }
}
