//! Results of monitoring as data.
//!
//! The names of the fields are an interface.

use serde::Serialize;

use scarab_base::number::Number;

/// Results of many runs.
#[derive(Clone, Debug, Serialize)]
pub struct MonitorRuns {
    /// Version of the JSON.
    pub schema: u32,
    /// Name in the leg file.
    pub leg: String,
    /// Runs in the order of their seeds.
    pub runs: Vec<MonitorRun>,
}

/// One run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct MonitorRun {
    /// Seed of noise and pushes.
    pub seed: u64,
    /// Reasons for a rejected identification; empty if there was a model to monitor.
    pub refused: Vec<&'static str>,
    /// Standard deviation of one filtered row of each joint at acceptance.
    pub(crate) row_sigma_nm: Vec<Number>,
    /// Limit for a joint's sum.
    pub limit: Number,
    /// Walking time without any change, hours.
    pub hours: f64,
    /// Alarms without a change, seconds of walking.
    pub false_alarms_at_s: Vec<f64>,
    /// Whether a change was made.
    pub changed: bool,
    /// Alarm after the change.
    pub alarm: Option<AlarmReport>,
    /// Result of the quick update.
    pub update: Option<UpdateReport>,
    /// Whether the change was still going on at the alarm.
    pub(crate) still_changing: bool,
    /// Whether another alarm came within a minute of the update.
    pub alarm_after_update: bool,
    /// Root mean square position error of all joints before the change, degrees.
    pub error_deg_before: Number,
    /// Position error from the change to the end of the quick update.
    pub error_deg_changed: Number,
    /// Position error with the update in use.
    pub error_deg_updated: Number,
}

/// An alarm.
#[derive(Clone, Debug, Serialize)]
pub struct AlarmReport {
    /// Time after the change, s.
    pub after_s: f64,
    /// Estimated time since the change.
    pub(crate) since_s: Number,
    /// Names of the affected joints.
    pub joints: Vec<String>,
    /// Sum of each joint.
    pub statistic: Vec<Number>,
}

/// Result of the quick update.
#[derive(Clone, Debug, Serialize)]
pub struct UpdateReport {
    /// `payload`, `friction`, `nothing` or `unexplained`.
    pub cause: &'static str,
    /// The link that carries the payload.
    pub link: Option<String>,
    /// Reasons of the verdict.
    pub(crate) reasons: Vec<&'static str>,
    /// Whether the cause is the true one.
    pub right: bool,
    /// Time after the alarm, s.
    pub after_s: f64,
    /// Compared hypotheses: the unchanged model, a payload on each link, other friction.
    pub hypotheses: Vec<HypothesisReport>,
    /// Energy of each joint's residual over that at acceptance.
    pub energy_before: Vec<Number>,
    /// Residual energy with the update.
    pub energy_after: Vec<Number>,
    /// Changes of parameters under the identified cause; empty if no cause explains the change.
    pub values: Vec<ValueReport>,
}

/// Fit of one hypothesis.
#[derive(Clone, Debug, Serialize)]
pub struct HypothesisReport {
    /// `unchanged`, `payload on LINK`, `friction`.
    pub name: String,
    /// Unexplained chi-square.
    pub chi_square: Number,
    /// Its degrees of freedom.
    pub freedom: Number,
    /// Whether the residual is noise.
    pub explains: bool,
}

/// A change of one parameter.
#[derive(Clone, Debug, Serialize)]
pub struct ValueReport {
    /// `M2`, `FC1`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Identified change.
    pub value: Number,
    /// Standard deviation, including the accepted model's uncertainty.
    pub sigma: Number,
    /// Change made by the simulation; unknown if the identified cause is wrong.
    pub truth: Number,
}

impl MonitorRun {
    /// Report of a rejected identification.
    pub(crate) fn refused(seed: u64, reasons: Vec<&'static str>) -> Self {
        Self { seed, refused: reasons, ..Self::default() }
    }

    /// Whether the run met its requirements: a model, no false alarm, and a change that was detected and
    /// correctly explained. After the update there is no alarm, unless the change continued.
    pub fn is_as_it_should_be(&self) -> bool {
        let quiet = self.still_changing || !self.alarm_after_update;
        let explained = self.update.as_ref().is_some_and(|update| update.right) && quiet;
        self.refused.is_empty() && self.false_alarms_at_s.is_empty() && (!self.changed || explained)
    }
}
