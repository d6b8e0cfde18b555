//! What a run found, as plain data: written as JSON, printed as tables.
//!
//! The names of the fields are an interface. A number that is not known is `null`, never NaN.

use super::findings::FindingReport;
use super::scale::ScaleReport;
use super::trace::TraceReport;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

use super::disturbances::{OutliersReport, StribeckReport};
use super::model_choice::{DirectionsReport, ModelChoiceReport};

/// Version of the JSON.
pub const SCHEMA: u32 = 1;

/// A number that JSON can hold: what is not finite is unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Number(pub Option<f64>);

impl Number {
    /// Not known.
    pub const UNKNOWN: Self = Self(None);

    /// The number, if it is finite.
    #[must_use]
    pub fn known(self) -> Option<f64> {
        self.0.filter(|value| value.is_finite())
    }
}

impl From<f64> for Number {
    fn from(value: f64) -> Self {
        Self(Some(value).filter(|value| value.is_finite()))
    }
}

impl From<f32> for Number {
    fn from(value: f32) -> Self {
        f64::from(value).into()
    }
}

impl<T: Into<f64>> From<Option<T>> for Number {
    fn from(value: Option<T>) -> Self {
        Self(value.map(Into::into).filter(|value: &f64| value.is_finite()))
    }
}

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.known() {
            Some(value) => serializer.serialize_f64(value),
            None => serializer.serialize_none(),
        }
    }
}

/// One of a joint's fourteen parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterReport {
    /// `XX1`, `IA2`: symbol and joint.
    pub name: String,
    /// Counted from 1.
    pub joint: usize,
    /// Unknown where neither torque nor a prior tells.
    pub value: Number,
    /// SI.
    pub unit: &'static str,
    /// Standard deviation; unknown unless measured alone.
    pub sigma: Number,
    /// `identified`, `grouped`, `weak` or `prior`.
    pub status: &'static str,
    /// The others of its base parameters.
    pub grouped_with: Vec<String>,
    /// What the simulated leg has.
    pub truth: Number,
    /// What was believed before.
    pub prior: Number,
}

/// One combination of parameters that torque determines.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BaseReport {
    /// The carrying parameter; with an `R` where others are regrouped into it.
    pub name: String,
    /// Parameters and factors of the weighted sum.
    pub terms: BTreeMap<String, f64>,
    /// Of the swarm's result, which is the run's result.
    pub value: Number,
    /// SI.
    pub unit: &'static str,
    /// Standard deviation.
    pub sigma: Number,
    /// What the simulated leg has.
    pub truth: Number,
    /// Least standard deviation any unbiased estimator can reach from the logged samples (Cramer-Rao).
    pub cramer_rao: Number,
}

/// How well one joint's torque on one motion is predicted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitReport {
    /// Counted from 1.
    pub joint: usize,
    /// `fourier`, `gait-6.5`, `gait-3`, `recording`.
    pub motion: String,
    /// Root mean square of measured minus predicted, both through the same filter; without what was set aside.
    pub rms_nm: Number,
    /// Of the mean absolute filtered torque.
    pub percent_of_mean_abs: Number,
    /// Of the root mean square filtered torque.
    pub percent_of_rms: Number,
    /// Against the noise-free torque, rows left out in which the joint sticks.
    pub percent_of_mean_abs_vs_truth: Number,
    /// Share of rows left out there.
    pub sticking_share: Number,
    /// Share of the motion's rows that was set aside as disturbed (less than half of their weight), 0..1.
    pub disturbed_share: Number,
    /// Longest stretch of such rows, s.
    pub disturbed_longest_s: Number,
    /// Wild angles and torques that were replaced before the filter.
    pub replaced: u32,
}

/// The closed-form solution.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeastSquaresReport {
    /// Name and value of each base parameter.
    pub base_parameters: BTreeMap<String, Number>,
    /// Sum of squares in chi-square units.
    pub cost: Number,
}

/// The beetle swarm on the same data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SwarmReport {
    /// Of the swarm's random numbers.
    pub seed: u64,
    /// All stages.
    pub iterations: u32,
    /// All stages.
    pub evaluations: u32,
    /// J / J_LS - 1.
    pub cost_over_least_squares: Number,
    /// J - J_C, with J_C the optimum in the search box, found in double precision.
    pub excess_chi2: Number,
    /// Iterations until the excess was at most a half; unknown where it never was.
    pub iterations_to_half_chi2: Option<u32>,
}

/// A result against a model that was kept.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonReport {
    /// The kept model's file.
    pub model: String,
    /// When it was found, RFC 3339.
    pub created: String,
    /// `same` or `changed`.
    pub verdict: &'static str,
    /// In words.
    pub line: String,
    /// Squared distance of the two base sets under both covariances.
    pub chi2: f64,
    /// What two identifications of one leg stay below in 999 of 1000 cases.
    pub chi2_limit: f64,
    /// Base parameters compared, the furthest apart first.
    pub differences: Vec<DifferenceReport>,
    /// Base parameters of one of the two only.
    pub not_compared: Vec<String>,
    /// Both temperatures are known, and they differ by more than hardly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
}

/// One base parameter in two identifications.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DifferenceReport {
    /// As reports name it.
    pub name: String,
    /// Kept.
    pub stored: f64,
    /// Found now.
    pub found: f64,
    /// Found less kept, in standard deviations of the difference.
    pub sigmas: f64,
}

/// What a model file keeps beyond the report.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelDetail {
    /// Of the base parameters, in their order.
    pub covariance: Vec<Vec<f64>>,
    /// The parameter in whose column each base parameter's value stands.
    pub carriers: Vec<String>,
    /// Parameters that were left out of the estimate, as if they were zero.
    pub not_estimated: Vec<String>,
}

/// One search for a leg that can exist.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConsistentSearchReport {
    /// Of the swarm.
    pub iterations: u32,
    /// Of the swarm.
    pub evaluations: u32,
    /// Newton steps of the completion; none where the closed form is a possible leg.
    pub steps: u32,
    /// The completion ended at its minimum, not because steps ran out or single precision did; unknown of the search over
    /// whole legs. The verdict judges what it costs (`prior_box`), not this.
    pub settled: Option<bool>,
    /// Cost of the data above the least that any allowed leg has, that found in double precision.
    pub excess_chi2: Number,
    /// Iterations until the excess was at most a half; unknown where it never was.
    pub iterations_to_half_chi2: Option<u32>,
    /// The leg that was found (of the search over whole legs: the best of every iteration) is a possible one; unknown where
    /// it was not told.
    pub consistent: Option<bool>,
    /// Its parameters by name; empty without a prior.
    pub parameters: BTreeMap<String, Number>,
}

/// Both searches for a leg that can exist.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConsistentReport {
    /// Which of the two is the run's result.
    pub chosen: &'static str,
    /// J_C - J_LS: what physical consistency within the prior's limits costs, found in double precision.
    pub optimum_over_least_squares: Number,
    /// The same of the run's result, as the verdict sees it.
    pub result_over_least_squares: Number,
    /// Most degrees of freedom of that chi-square.
    pub degrees_of_freedom: Option<usize>,
    /// Log-Cholesky coordinates of every link; only the host searches there.
    pub full: Option<ConsistentSearchReport>,
    /// Base values, completed.
    pub base: ConsistentSearchReport,
}

/// Position error on gait.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrackingReport {
    /// Counted from 1.
    pub joint: usize,
    /// Feedback alone.
    pub rms_deg_without_model: Number,
    /// The same gains, the identified model in the feedforward.
    pub rms_deg_with_model: Number,
}

/// One identification, simulated or replayed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunReport {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Name in the leg file.
    pub leg: String,
    /// Of the simulated noise; unknown in a replay.
    pub seed: Option<u64>,
    /// Of the swarm.
    pub swarm_seed: u64,
    /// `none`, `file` or `wrong:P`.
    pub prior: String,
    /// `one-time` or `sequential`.
    pub plan: &'static str,
    /// `accepted` or `refused`.
    pub verdict: &'static str,
    /// Whether motions that were not used were predicted; where none was, `accepted` speaks of the motion identified from.
    pub validated: bool,
    /// From the closed list.
    pub reasons: Vec<&'static str>,
    /// Every test of the verdict.
    pub findings: Vec<FindingReport>,
    /// Base parameters that the data determine.
    pub rank: usize,
    /// Parameters estimated.
    pub columns: usize,
    /// Of the scaled weighted problem.
    pub condition: Number,
    /// All fourteen of every joint.
    pub parameters: Vec<ParameterReport>,
    /// What torque determines.
    pub base_parameters: Vec<BaseReport>,
    /// Of joints that show it.
    pub stribeck: Vec<StribeckReport>,
    /// What was asked of each joint's model, used, and why.
    pub model_choice: Vec<ModelChoiceReport>,
    /// Of joints whose Coulomb friction was found to differ between the directions.
    pub asymmetric_coulomb: Vec<DirectionsReport>,
    /// Of the drives, degrees Celsius; unknown unless stated.
    pub temperature_c: Number,
    /// What was set aside of the motion identified from.
    pub outliers: OutliersReport,
    /// The motion identified from.
    pub training: Vec<FitReport>,
    /// Motions not used.
    pub validation: Vec<FitReport>,
    /// The closed form.
    pub least_squares: LeastSquaresReport,
    /// The search.
    pub bso: SwarmReport,
    /// Searches for a leg that can exist.
    pub consistent: ConsistentReport,
    /// What the model is worth to the servo; empty in a replay.
    pub tracking: Vec<TrackingReport>,
    /// What the parameters are measured in, and what the leg carried.
    #[serde(flatten)]
    pub scale: ScaleReport,
    /// Which drives were simulated; none in a replay.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drive: Option<&'static str>,
    /// Simulated or recorded time, s.
    pub simulated_s: f64,
    /// Time it took, s.
    pub wall_s: f64,
    /// Against a model that was kept, where one was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compared: Option<ComparisonReport>,
    /// What else a board told, where the run is one of a board.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<TraceReport>,
    /// For the model file; not in the JSON.
    #[serde(skip)]
    pub detail: ModelDetail,
}

impl RunReport {
    /// Exit code 0.
    #[must_use]
    pub fn accepted(&self) -> bool {
        self.reasons.is_empty()
    }
}
