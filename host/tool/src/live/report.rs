//! Live picture of a leg as plain data: what a source reports while it runs, and what `live` sends to a page.
//!
//! A source knows neither the page nor HTTP. Angles and torques are anatomical. Times are those of its clock,
//! s. A number that the source does not know is `null`.

use serde::Serialize;

use scarab_base::number::Number;
use scarab_identify::report::findings::FindingReport;

/// Samples and rows per second of the source's clock.
pub(crate) const RATE_HZ: u32 = 50;

/// One report of a source.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum LiveUpdate {
    /// Description of the source, before anything else.
    Scene(Scene),
    /// Measured motion, [`RATE_HZ`] times per second.
    Sample(LiveSample),
    /// Filtered torque and its prediction.
    Row(LiveRow),
    /// Estimate of the parameters so far.
    Estimate(LiveEstimate),
    /// Present state.
    Status(LiveStatus),
    /// Verdict, or the tests evaluated so far.
    Outcome(LiveOutcome),
    /// Line of the timeline.
    Note(LiveNote),
}

/// Constant description of a source.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Scene {
    /// Kind of source in words.
    pub(crate) source: String,
    /// Requested seconds of the source per second.
    pub(crate) speed: f64,
    /// Legs.
    pub(crate) legs: Vec<LegScene>,
}

/// Constant description of a leg.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LegScene {
    /// Name in the leg file.
    pub(crate) name: String,
    /// Joints, proximal first.
    pub(crate) joints: Vec<JointScene>,
}

/// Constant description of a joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct JointScene {
    /// Name in the leg file.
    pub(crate) name: String,
}

/// Means over one period of [`RATE_HZ`], of every joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LiveSample {
    /// Leg, from 0.
    pub(crate) leg: usize,
    /// Middle of the period, s.
    pub(crate) time_s: f64,
    /// Measured angles, rad.
    pub(crate) angle_rad: Vec<f32>,
    /// Commanded angles, rad; unknown in a recording, and without a target on a bus.
    pub(crate) commanded_rad: Vec<Option<f32>>,
    /// Torques by the measured currents, N m; unknown on a bus that does not carry them.
    pub(crate) torque_nm: Vec<Option<f32>>,
    /// Measured currents with the torques' signs, A; unknown in a recording.
    pub(crate) current_a: Vec<Option<f32>>,
    /// Joints and tip in the picture's plane, m: to the right, downwards.
    pub(crate) points_m: Vec<[f32; 2]>,
}

/// Torque behind the identification's filter, and its prediction for the same instant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LiveRow {
    /// Leg, from 0.
    pub(crate) leg: usize,
    /// Centre of the filter's window, s.
    pub(crate) time_s: f64,
    /// Filtered torques, N m.
    pub(crate) measured_nm: Vec<f32>,
    /// Predicted torques, N m; unknown without a complete estimate, and while the joint is at rest.
    pub(crate) predicted_nm: Vec<Option<f32>>,
}

/// Origin of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum EstimateOrigin {
    /// Least squares over the exciting motion so far.
    Motion,
    /// Best of the running search.
    Search,
    /// Result of the search, not judged yet.
    Candidate,
    /// Judged result.
    Result,
}

/// Estimate of all base parameters at one time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LiveEstimate {
    /// Leg, from 0.
    pub(crate) leg: usize,
    /// Time of the estimate, s.
    pub(crate) time_s: f64,
    /// Origin of the values.
    pub(crate) origin: EstimateOrigin,
    /// Iterations of the search; 0 before it.
    pub(crate) iterations: u32,
    /// Base parameters.
    pub(crate) values: Vec<LiveParameter>,
}

/// One base parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LiveParameter {
    /// Name as in reports.
    pub(crate) name: String,
    /// SI unit.
    pub(crate) unit: &'static str,
    /// Value; unknown while the data do not determine it.
    pub(crate) value: Number,
    /// Standard deviation.
    pub(crate) sigma: Number,
    /// Value of the simulated leg.
    pub(crate) truth: Number,
}

/// Present state of a leg.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LiveStatus {
    /// Leg, from 0.
    pub(crate) leg: usize,
    /// Time, s.
    pub(crate) time_s: f64,
    /// Number of the identification, from 1.
    pub(crate) run: u32,
    /// State of the drive.
    pub(crate) drive: String,
    /// Activity and phase.
    pub(crate) doing: String,
    /// Event that ends the phase.
    pub(crate) waits_for: String,
    /// Rest of the running motion, s.
    pub(crate) left_s: Number,
    /// Reason why the drive is not enabled; empty while it is.
    pub(crate) not_enabled: String,
    /// Latched fault, empty without one; `None` if the source does not know.
    pub(crate) fault: Option<String>,
    /// Limits that acted since the last status, each with its joint; `None` if the source does not know.
    pub(crate) limits: Option<Vec<String>>,
    /// Seconds of the source per second, measured over the last second.
    pub(crate) speed: Number,
    /// Load of the board's processor in words; empty if unknown.
    pub(crate) processor: String,
    /// Load of the bus in words; empty without one.
    pub(crate) bus: String,
}

/// Verdict and its tests.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(crate) struct LiveOutcome {
    /// Leg, from 0.
    pub(crate) leg: usize,
    /// `accepted` or `refused`; empty before the last motion has ended.
    pub(crate) verdict: String,
    /// Whether unused motions were predicted.
    pub(crate) validated: bool,
    /// Words of the reasons for rejection.
    pub(crate) reasons: Vec<String>,
    /// Tests evaluated so far.
    pub(crate) findings: Vec<FindingReport>,
}

/// Importance of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Severity {
    /// Information only.
    Note,
    /// Something was refused, lost or out of order.
    Warning,
    /// The drive stopped, or the source failed.
    Fault,
}

/// Line of the timeline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct LiveNote {
    /// Time, s.
    pub(crate) time_s: f64,
    /// Importance.
    pub(crate) weight: Severity,
    /// Sentence.
    pub(crate) words: String,
}
