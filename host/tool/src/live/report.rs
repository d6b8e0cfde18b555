//! Live picture of a leg as plain data: what a source reports while it runs, and what `live` sends to a page.
//!
//! A source knows neither the page nor HTTP. Angles and torques are anatomical. Times are those of its clock,
//! s. A number that the source does not know is `null`.

use serde::Serialize;

use scarab_base::number::Number;
use scarab_identify::report::findings::FindingReport;

/// Samples and rows per second of the source's clock.
pub const RATE_HZ: u32 = 50;

/// One report of a source.
#[derive(Clone, Debug, PartialEq)]
pub enum LiveUpdate {
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
pub struct Scene {
    /// Kind of source in words.
    pub source: String,
    /// Requested seconds of the source per second.
    pub speed: f64,
    /// Legs.
    pub legs: Vec<LegScene>,
}

/// Constant description of a leg.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LegScene {
    /// Name in the leg file.
    pub name: String,
    /// Joints, proximal first.
    pub joints: Vec<JointScene>,
}

/// Constant description of a joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointScene {
    /// Name in the leg file.
    pub name: String,
}

/// Means over one period of [`RATE_HZ`], of every joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveSample {
    /// Leg, from 0.
    pub leg: usize,
    /// Middle of the period, s.
    pub time_s: f64,
    /// Measured angles, rad.
    pub angle_rad: Vec<f32>,
    /// Commanded angles, rad; unknown in a recording, and without a target on a bus.
    pub commanded_rad: Vec<Option<f32>>,
    /// Torques by the measured currents, N m; unknown on a bus that does not carry them.
    pub torque_nm: Vec<Option<f32>>,
    /// Measured currents with the torques' signs, A; unknown in a recording.
    pub current_a: Vec<Option<f32>>,
    /// Joints and tip in the picture's plane, m: to the right, downwards.
    pub points_m: Vec<[f32; 2]>,
}

/// Torque behind the identification's filter, and its prediction for the same instant.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveRow {
    /// Leg, from 0.
    pub leg: usize,
    /// Centre of the filter's window, s.
    pub time_s: f64,
    /// Filtered torques, N m.
    pub measured_nm: Vec<f32>,
    /// Predicted torques, N m; unknown without a complete estimate, and while the joint is at rest.
    pub predicted_nm: Vec<Option<f32>>,
}

/// Origin of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EstimateOrigin {
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
pub struct LiveEstimate {
    /// Leg, from 0.
    pub leg: usize,
    /// Time of the estimate, s.
    pub time_s: f64,
    /// Origin of the values.
    pub origin: EstimateOrigin,
    /// Iterations of the search; 0 before it.
    pub iterations: u32,
    /// Base parameters.
    pub values: Vec<LiveParameter>,
}

/// One base parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveParameter {
    /// Name as in reports.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Value; unknown while the data do not determine it.
    pub value: Number,
    /// Standard deviation.
    pub sigma: Number,
    /// Value of the simulated leg.
    pub truth: Number,
}

/// Present state of a leg.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveStatus {
    /// Leg, from 0.
    pub leg: usize,
    /// Time, s.
    pub time_s: f64,
    /// Number of the identification, from 1.
    pub run: u32,
    /// State of the drive.
    pub drive: String,
    /// Activity and phase.
    pub doing: String,
    /// Event that ends the phase.
    pub waits_for: String,
    /// Rest of the running motion, s.
    pub left_s: Number,
    /// Reason why the drive is not enabled; empty while it is.
    pub not_enabled: String,
    /// Latched fault, empty without one; `None` if the source does not know.
    pub fault: Option<String>,
    /// Limits that acted since the last status, each with its joint; `None` if the source does not know.
    pub limits: Option<Vec<String>>,
    /// Seconds of the source per second, measured over the last second.
    pub speed: Number,
    /// Load of the board's processor in words; empty if unknown.
    pub processor: String,
    /// Load of the bus in words; empty without one.
    pub bus: String,
}

/// Verdict and its tests.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LiveOutcome {
    /// Leg, from 0.
    pub leg: usize,
    /// `accepted` or `refused`; empty before the last motion has ended.
    pub verdict: String,
    /// Whether unused motions were predicted.
    pub validated: bool,
    /// Words of the reasons for rejection.
    pub reasons: Vec<String>,
    /// Tests evaluated so far.
    pub findings: Vec<FindingReport>,
}

/// Importance of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Information only.
    Note,
    /// Something was refused, lost or out of order.
    Warning,
    /// The drive stopped, or the source failed.
    Fault,
}

/// Line of the timeline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiveNote {
    /// Time, s.
    pub time_s: f64,
    /// Importance.
    pub weight: Severity,
    /// Sentence.
    pub words: String,
}
