//! Results of a run as plain data: written as JSON, printed as tables.
//!
//! The names of the fields are an interface. An unknown number is `null`, never NaN.

pub mod additional_torque;
pub mod disturbances;
pub mod doubt;
pub mod excite;
pub mod findings;
pub mod model_choice;
pub mod reading;
pub mod scale;
pub mod series;
pub mod trace;

use std::collections::BTreeMap;
use std::path::PathBuf;

use scarab_base::number::Number;
use scarab_base::words::{Word, optional_word, word, words};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use serde_json::Value;

use crate::report::additional_torque::AdditionalTorque;
use crate::report::disturbances::{OutliersReport, StribeckReport};
use crate::report::doubt::{DoubtReport, SampleFinding};
use crate::report::findings::FindingReport;
use crate::report::model_choice::{DirectionsReport, ModelChoiceReport};
use crate::report::reading::ReadReport;
use crate::report::scale::ScaleReport;
use crate::report::trace::TraceReport;

/// Version of the JSON.
pub const SCHEMA: u32 = 1;
/// Verdict: every test passed.
pub const ACCEPTED: Word = "accepted";
/// Verdict: every test passed, but noise does not explain the misfit of the recording.
pub const ACCEPTED_WITH_MISFIT: Word = "accepted_with_misfit";
/// Verdict: a test failed.
pub const REFUSED: Word = "refused";

/// Misfit over noise up to which noise explains the misfit, so that limits follow from the noise.
pub(crate) const EXPLAINED_BY_NOISE: f64 = 1.3;
/// Error of a torque, percent of its rms, that counts as none: exact data keep the filter's and the clock's.
pub(crate) const NEGLIGIBLE_PERCENT: f64 = 0.5;

/// One of a joint's fourteen parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterReport {
    /// `XX1`, `IA2`: symbol and joint.
    pub name: String,
    /// Joint, from 1.
    pub joint: usize,
    /// Value; unknown if neither torque nor a prior determines it.
    pub value: Number,
    /// SI unit.
    #[serde(deserialize_with = "word")]
    pub unit: Word,
    /// Standard deviation; unknown unless the parameter is identified alone.
    pub sigma: Number,
    /// `identified`, `grouped`, `weak` or `prior`.
    #[serde(deserialize_with = "word")]
    pub status: Word,
    /// Other parameters of its base parameters.
    pub grouped_with: Vec<String>,
    /// True value of the simulated leg.
    pub truth: Number,
    /// Value of the prior.
    pub prior: Number,
}

/// One combination of parameters that torque determines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseReport {
    /// Carrying parameter, with an `R` if others are regrouped into it.
    pub name: String,
    /// Parameters and factors of the weighted sum.
    pub terms: BTreeMap<String, f64>,
    /// Result of the swarm, which is the run's result.
    pub value: Number,
    /// SI unit.
    #[serde(deserialize_with = "word")]
    pub unit: Word,
    /// Standard deviation.
    pub sigma: Number,
    /// Largest part of sigma: `noise`; in a replay also `segments`, `recordings`, `doubt` or `encoder`.
    #[serde(deserialize_with = "word")]
    pub sigma_from: Word,
    /// Standard deviation by the noise of the torque.
    pub sigma_noise: Number,
    /// Standard deviation by the model's misfit: the larger of the scatter over segments and between
    /// recordings; only in a replay.
    pub sigma_misfit: Number,
    /// True value of the simulated leg.
    pub truth: Number,
    /// Least standard deviation of an unbiased estimator from the logged samples (Cramer-Rao).
    pub cramer_rao: Number,
}

/// Prediction error of one joint's torque on one motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitReport {
    /// Joint, from 1.
    pub joint: usize,
    /// `fourier`, `gait-6.5`, `gait-3`, `recording`.
    pub motion: String,
    /// Root mean square of measured minus predicted torque, both behind the same filter; excluded
    /// rows do not count.
    pub rms_nm: Number,
    /// Error in percent of the mean absolute filtered torque.
    pub percent_of_mean_abs: Number,
    /// Error in percent of the root mean square filtered torque.
    pub percent_of_rms: Number,
    /// Error against the noise-free torque, percent; rows in which the joint sticks are excluded.
    pub percent_of_mean_abs_vs_truth: Number,
    /// Share of those excluded rows.
    pub sticking_share: Number,
    /// Share of the motion's rows excluded as disturbed (less than half of their weight), 0..1.
    pub disturbed_share: Number,
    /// Longest stretch of such rows, s.
    pub disturbed_longest_s: Number,
    /// Outliers among angles and torques that were replaced before the filter.
    pub replaced: u32,
}

/// The closed-form solution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LeastSquaresReport {
    /// Name and value of each base parameter.
    pub base_parameters: BTreeMap<String, Number>,
    /// Sum of squares in chi-square units.
    pub cost: Number,
}

/// The beetle swarm on the same data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SwarmReport {
    /// Seed of the swarm's random numbers.
    pub seed: u64,
    /// Iterations of all stages.
    pub iterations: u32,
    /// Evaluations of all stages.
    pub evaluations: u32,
    /// J / J_LS - 1.
    pub cost_over_least_squares: Number,
    /// J - J_C, with J_C the optimum in the search box, found in double precision.
    pub excess_chi2: Number,
    /// Iterations until the excess was at most 0.5; unknown if it never was.
    pub iterations_to_half_chi2: Option<u32>,
}

/// Comparison of a result with a stored model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparisonReport {
    /// File of the stored model.
    pub model: String,
    /// Time of its identification, RFC 3339.
    pub created: String,
    /// `same` or `changed`.
    pub(crate) verdict: &'static str,
    /// Result in words.
    pub line: String,
    /// Squared distance of the two base sets under both covariances.
    pub chi2: f64,
    /// Limit that two identifications of one leg exceed in 1 of 1000 cases.
    pub chi2_limit: f64,
    /// Compared base parameters, largest difference first.
    pub differences: Vec<DifferenceReport>,
    /// Base parameters present in one of the two only.
    pub not_compared: Vec<String>,
    /// The difference as a mass added to one link, best explanation first.
    pub added_mass: Vec<AddedMassReport>,
    /// Warning of a relevant difference between two known temperatures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
}

/// One base parameter in two identifications.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DifferenceReport {
    /// Name as in reports.
    pub name: String,
    /// Stored value.
    pub stored: f64,
    /// Value identified now.
    pub found: f64,
    /// Identified minus stored value, in standard deviations of the difference.
    pub sigmas: f64,
}

/// The difference of two models as a mass added to one link; negative for a removed mass.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AddedMassReport {
    /// Joint of the link, from 1.
    pub joint: usize,
    /// Mass, kg; unknown if torque does not determine it.
    pub mass_kg: Number,
    /// Standard deviation of the mass.
    pub mass_sigma_kg: Number,
    /// First moments along X and Y of the joint's frame, kg m.
    pub moment_kgm: [Number; 2],
    /// Standard deviations of the moments.
    pub moment_sigma_kgm: [Number; 2],
    /// Position along X and Y of the joint's frame, m; unknown unless the mass exceeds three of its sigma.
    pub place_m: [Number; 2],
    /// Standard deviations of the position.
    pub place_sigma_m: [Number; 2],
    /// Chi-square that the mass does not explain; friction and offset are not compared.
    pub(crate) chi2: f64,
    /// Limit that noise exceeds in 1 of 1000 cases.
    pub(crate) chi2_limit: f64,
}

impl AddedMassReport {
    /// Whether the mass explains the difference.
    pub fn explains(&self) -> bool {
        self.chi2 <= self.chi2_limit
    }
}

/// Further data for a model file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelDetail {
    /// Covariance of the base parameters, in their order.
    pub(crate) covariance: Vec<Vec<f64>>,
    /// Parameter whose column carries each base parameter's value.
    pub(crate) carriers: Vec<String>,
    /// Parameters excluded from the estimate, as if they were zero.
    pub(crate) not_estimated: Vec<String>,
}

/// Search for a physically consistent leg.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ConsistentSearchReport {
    /// Iterations of the swarm.
    pub iterations: u32,
    /// Evaluations of the swarm.
    pub evaluations: u32,
    /// Newton steps of the completion; none if the closed form is physically consistent.
    pub steps: u32,
    /// Whether the completion ended at its minimum, not at the limit of steps or of single precision;
    /// unknown for the search over whole legs. The verdict judges the cost (`prior_box`), not this.
    pub settled: Option<bool>,
    /// Cost of the data above the least that any allowed leg has, found in double precision.
    pub excess_chi2: Number,
    /// Iterations until the excess was at most 0.5; unknown if it never was.
    pub iterations_to_half_chi2: Option<u32>,
    /// Whether the result is physically consistent (search over whole legs: the best of every
    /// iteration); unknown if not reported.
    pub consistent: Option<bool>,
    /// Parameters of the result by name; empty without a prior.
    pub parameters: BTreeMap<String, Number>,
}

/// Both searches for a physically consistent leg.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ConsistentReport {
    /// Search whose result is the run's result.
    #[serde(deserialize_with = "word")]
    pub chosen: Word,
    /// J_C - J_LS: cost of physical consistency within the prior's limits, found in double precision.
    pub optimum_over_least_squares: Number,
    /// J - J_LS of the run's result, as the verdict sees it.
    pub result_over_least_squares: Number,
    /// Upper bound on the degrees of freedom of that chi-square.
    pub degrees_of_freedom: Option<usize>,
    /// Search over log-Cholesky coordinates of every link; on the host only.
    pub full: Option<ConsistentSearchReport>,
    /// Search over base values, with completion.
    pub base: ConsistentSearchReport,
}

/// Position error on the gait motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackingReport {
    /// Joint, from 1.
    pub joint: usize,
    /// Error with feedback alone.
    pub rms_deg_without_model: Number,
    /// Error with the same gains and the identified model in the feedforward.
    pub rms_deg_with_model: Number,
}

/// One identification, simulated or replayed. Those of a simulated campaign are read back, without what only
/// a replay or a comparison has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self")]
pub struct RunReport {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Name of the leg in the leg file.
    pub leg: String,
    /// Seed of the simulated noise; unknown in a replay.
    pub seed: Option<u64>,
    /// Seed of the swarm.
    pub swarm_seed: u64,
    /// `none`, `file` or `wrong:P`.
    pub prior: String,
    /// `one-time` or `sequential`.
    #[serde(deserialize_with = "word")]
    pub plan: Word,
    /// [`ACCEPTED`], [`ACCEPTED_WITH_MISFIT`] or [`REFUSED`].
    #[serde(deserialize_with = "word")]
    pub verdict: Word,
    /// Whether unused motions were predicted; if not, `accepted` refers to the training motion.
    pub validated: bool,
    /// Reasons for rejection, from the closed list.
    #[serde(deserialize_with = "words")]
    pub reasons: Vec<Word>,
    /// Every test of the verdict.
    pub findings: Vec<FindingReport>,
    /// Base parameters that the data determine.
    pub rank: usize,
    /// Number of estimated parameters.
    pub columns: usize,
    /// Condition number of the scaled weighted problem.
    pub condition: Number,
    /// Fourteen parameters of every joint.
    pub parameters: Vec<ParameterReport>,
    /// Base parameters.
    pub base_parameters: Vec<BaseReport>,
    /// Stribeck friction of the joints that show it.
    pub stribeck: Vec<StribeckReport>,
    /// Springs and friction by load, which were subtracted from the recorded torques.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub additional_torque: Vec<AdditionalTorque>,
    /// Requested and used model of each joint, and why.
    pub model_choice: Vec<ModelChoiceReport>,
    /// Joints whose Coulomb friction differs between the directions.
    pub asymmetric_coulomb: Vec<DirectionsReport>,
    /// Temperature of the drives, degrees Celsius; unknown unless stated.
    pub temperature_c: Number,
    /// Rows and samples excluded from the training motion.
    pub outliers: OutliersReport,
    /// Residuals on the training motion.
    pub training: Vec<FitReport>,
    /// Residuals on unused motions.
    pub validation: Vec<FitReport>,
    /// Solution in closed form.
    pub least_squares: LeastSquaresReport,
    /// Search by the swarm.
    pub bso: SwarmReport,
    /// Searches for a physically consistent leg.
    pub consistent: ConsistentReport,
    /// Effect of the model on the servo; empty in a replay.
    pub tracking: Vec<TrackingReport>,
    /// Units of the parameters, and masses carried by the leg.
    #[serde(flatten)]
    pub scale: ScaleReport,
    /// Kind of simulated drives; absent in a replay.
    #[serde(default, deserialize_with = "optional_word", skip_serializing_if = "Option::is_none")]
    pub drive: Option<Word>,
    /// Simulated or recorded time, s.
    pub simulated_s: f64,
    /// Computing time, s.
    pub wall_s: f64,
    /// Errors of the logging chain of a replay's recordings.
    #[serde(flatten, skip_deserializing, skip_serializing_if = "Option::is_none")]
    pub doubt: Option<DoubtReport>,
    /// Faults of the recordings' columns; absent for a simulated leg.
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    pub samples: Option<Vec<SampleFinding>>,
    /// How the files of a replay were read; absent for a simulated leg.
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    pub read: Option<Vec<ReadReport>>,
    /// Comparison with a stored model, if one was given.
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    pub compared: Option<ComparisonReport>,
    /// Further data of a board's trace.
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    pub trace: Option<TraceReport>,
    /// Data for the model file; not in the JSON.
    #[serde(skip)]
    pub detail: ModelDetail,
}

impl Serialize for RunReport {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, to)
    }
}

/// Through a [`Value`]: `defmt-decoder` switches on serde_json's arbitrary precision, with which flattened
/// numbers cannot be read from text.
impl<'de> Deserialize<'de> for RunReport {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Self::deserialize(Value::deserialize(from)?).map_err(de::Error::custom)
    }
}

impl RunReport {
    /// Whether the run is a replay of recordings.
    pub fn is_replay(&self) -> bool {
        self.doubt.is_some()
    }

    /// Whether a prior bounds the search and completes what torque does not determine.
    pub fn has_prior(&self) -> bool {
        self.prior != "none"
    }

    /// Whether the result was accepted: exit code 0.
    pub fn accepted(&self) -> bool {
        self.reasons.is_empty()
    }

    /// Largest misfit over noise of a result that is accepted although noise does not explain it; infinite
    /// where the noise is unknown.
    pub fn accepted_misfit(&self) -> Option<f64> {
        (self.verdict == ACCEPTED_WITH_MISFIT).then(|| self.unexplained_misfit())?
    }

    /// Largest misfit over noise that noise does not explain, of a joint whose error is not negligible.
    pub(crate) fn unexplained_misfit(&self) -> Option<f64> {
        let ratios = &self.doubt.as_ref()?.misfit_over_noise;
        let is_negligible = |joint: usize| {
            let fits = self.training.iter().chain(&self.validation).filter(|fit| fit.joint == joint + 1);
            fits.filter_map(|fit| fit.percent_of_rms.known()).all(|error| error <= NEGLIGIBLE_PERCENT)
        };
        let unexplained = ratios.iter().enumerate().filter_map(|(joint, ratio)| {
            let ratio = ratio.known().unwrap_or(f64::INFINITY);
            (ratio > EXPLAINED_BY_NOISE && !is_negligible(joint)).then_some(ratio)
        });
        unexplained.reduce(f64::max)
    }
}

/// One file, or a part of one, and its use.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Name as given.
    pub file: PathBuf,
    /// `training` or `validation`.
    pub role: &'static str,
    /// Start on the recording's clock, s.
    pub start_s: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Rate of the recording, Hz.
    pub rate_hz: f64,
    /// Filtered rows at 50 Hz, equal for all joints.
    pub rows: u32,
    /// Rows used for each joint; in the others the joint was at rest.
    pub used: Vec<u32>,
}

/// Report of many runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunsReport {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Runs in the order of their seeds.
    pub runs: Vec<RunReport>,
}
