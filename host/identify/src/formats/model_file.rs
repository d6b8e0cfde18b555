//! Model files: results of an accepted identification, stored for later use.
//!
//! Why a separate file: a result is useful only together with its basis (leg, lengths, torque constants,
//! gravity) and its covariance. With both, torque can be predicted with a band, two identifications can be
//! compared, and a model of another leg can be refused. Keys are an interface, see `docs/files.md`; unknown
//! ones are errors.
//!
//! ```text
//! identify, replay --save-model--> file --predict, export, --compare-model-->
//! ```
//!
//! Numbers are written with the digits that restore the f64 exactly. The checksum covers every key and value
//! except itself, so that an edited file is detected.

mod check;
mod checksum;
mod text;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::SMatrix;
use scarab::model::Parameter;
use scarab_base::error::{FileError, ToolError};
use scarab_base::files;
use scarab_base::toml_file::{self, Fault, Step};
use serde::{Deserialize, Serialize};

use crate::formats::leg_file::{BodySide, DhFile, JointFile, LegFile};
use crate::report::additional_torque::{AdditionalKind, AdditionalTorque, rest_name};
use crate::report::{ACCEPTED, ACCEPTED_WITH_MISFIT};

/// Version of the keys.
pub(crate) const MODEL_SCHEMA: i64 = 1;
/// Capacity of the base set: that of three joints.
pub(crate) const LARGEST_BASE_SET: usize = 28;
/// Constant column of a joint whose Coulomb friction differs between the directions.
const ASYMMETRY: &str = "FCA";
/// Size limit of a model file, bytes.
const LARGEST_FILE_BYTES: u64 = 1 << 20;

/// A checked model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelFile {
    /// [`MODEL_SCHEMA`].
    pub(crate) schema: i64,
    /// Checksum of everything else.
    pub(crate) checksum: String,
    /// Fingerprint of geometry, anatomy and torque constants, as the board computes it.
    pub fingerprint: String,
    /// Time of the identification, RFC 3339, UTC.
    pub created: String,
    /// Version of the program that wrote it.
    pub(crate) scarab: String,
    /// Identified leg.
    pub leg: StoredLeg,
    /// Conditions of the identification.
    pub conditions: Conditions,
    /// Base parameters.
    pub base_set: BaseSet,
    /// Fourteen parameters of every joint.
    pub full_set: FullSet,
}

/// Data of the leg that define the parameters' meaning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredLeg {
    /// Name in the leg file.
    pub name: String,
    /// Side of the body.
    pub(crate) side: BodySide,
    /// Gravity in the base frame, m/s^2, including a lean of the trunk.
    pub(crate) gravity: [f64; 3],
    /// Joints, proximal first.
    pub joints: Vec<StoredJoint>,
}

/// One joint; the keys are the leg file's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredJoint {
    /// Name of the joint.
    pub name: String,
    /// Modified Denavit-Hartenberg, rad and m.
    pub(crate) dh: DhFile,
    /// Joint angle = direction * anatomical angle + zero offset.
    pub direction: i64,
    /// Joint angle at the anatomical zero, degrees.
    pub zero_offset_deg: f64,
    /// Anatomical range, degrees.
    pub range_deg: [f64; 2],
    /// Speed limit, degrees per second.
    pub(crate) speed_limit_deg_s: f64,
    /// Torque limit at the joint, N m.
    pub torque_limit_nm: f64,
    /// Torque constant at the joint in whose units the parameters are, N m/A: the assumed one, or
    /// the one identified from a known mass.
    pub torque_per_ampere: f64,
}

/// Conditions of an identification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Conditions {
    /// `simulation` or `recording`.
    pub(crate) source: String,
    /// `accepted` or `accepted_with_misfit`.
    pub(crate) verdict: String,
    /// `relative` to the assumed torque constants, or `absolute`: identified from a known mass.
    pub scale: String,
    /// `none`, `file` or `wrong:P`.
    pub(crate) prior: String,
    /// `one-time` or `sequential`.
    pub(crate) plan: String,
    /// Frequency at which the low-pass was 3 dB down, Hz.
    pub(crate) bandwidth_hz: f64,
    /// Duration of all motions, used and held out, s.
    pub(crate) motion_s: f64,
    /// Seed of the simulated noise; text, since a seed may need all 64 bits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) seed: Option<String>,
    /// Seed of the swarm.
    pub(crate) swarm_seed: String,
    /// Condition number of the scaled weighted problem.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) condition: Option<f64>,
    /// Temperature of the drives, degrees Celsius; absent if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// Parameters excluded from the estimate, as if they were zero.
    pub not_estimated: Vec<String>,
    /// Torque errors on the motion identified from and on those held out.
    pub fits: Vec<StoredFit>,
}

/// Torque error of one joint on one motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredFit {
    /// Joint, from 1.
    pub(crate) joint: usize,
    /// Name of the motion.
    pub(crate) motion: String,
    /// `training` or `validation`.
    pub(crate) role: String,
    /// Root mean square error, N m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) rms_nm: Option<f64>,
    /// Error in percent of the mean absolute torque.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) percent_of_mean_abs: Option<f64>,
}

/// Set of base parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaseSet {
    /// Base parameters, in the order of the covariance.
    pub parameters: Vec<StoredBase>,
    /// Covariance, row by row.
    pub covariance: Vec<Vec<f64>>,
    /// Stribeck friction of the joints that show it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stribeck: Vec<StoredStribeck>,
    /// Springs and friction by load.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub additional_torque: Vec<AdditionalTorque>,
}

/// Stribeck friction of one joint: surplus * exp(-(speed / its speed)^2) on top of Coulomb friction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredStribeck {
    /// Joint, from 1.
    pub joint: usize,
    /// Static friction above Coulomb friction, N m.
    pub surplus_nm: f64,
    /// Standard deviation of the surplus; absent in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) surplus_sigma_nm: Option<f64>,
    /// Speed of the decay, rad/s.
    pub speed_rad_s: f64,
    /// Standard deviation of the speed; absent in older files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) speed_sigma_rad_s: Option<f64>,
}

/// One combination of parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredBase {
    /// Name as in reports.
    pub name: String,
    /// Parameter in whose column the value gives the torque.
    pub carrier: String,
    /// Value, SI units.
    pub value: f64,
    /// Standard deviation, the root of the covariance's diagonal.
    pub sigma: f64,
    /// SI unit.
    pub unit: String,
    /// Parameters and factors of the weighted sum.
    pub terms: BTreeMap<String, f64>,
}

/// Fourteen parameters of every joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FullSet {
    /// Parameters in a fixed order, proximal joint first.
    pub parameters: Vec<StoredParameter>,
}

/// One parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredParameter {
    /// Symbol and joint.
    pub name: String,
    /// Value; absent if neither torque nor a prior determines it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Standard deviation; absent unless the parameter is identified alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// SI unit.
    pub(crate) unit: String,
    /// `identified`, `grouped`, `weak` or `prior`.
    pub status: String,
}

impl ModelFile {
    /// Loads and checks a model.
    ///
    /// # Errors
    /// [`FileError`] for an invalid file; [`ToolError::Refused`] for an edited file or one without an
    /// accepted verdict.
    pub fn load(path: &Path) -> Result<Self, ToolError> {
        let file = path.display().to_string();
        let bytes = std::fs::metadata(path).map_err(|error| FileError::unreadable(path, &error))?.len();
        if bytes > LARGEST_FILE_BYTES {
            return Err(FileError::new(file, format!("{bytes} bytes, too large for a model file")).into());
        }
        Self::parse(&files::read_text(path)?, &file)
    }

    /// Parses and checks a model; `file` is its name in error messages.
    ///
    /// # Errors
    /// Errors of [`ModelFile::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, ToolError> {
        let raw: toml::Table = toml_file::parse(text, file)?;
        match raw.get("schema").map(toml::Value::as_integer) {
            Some(Some(MODEL_SCHEMA)) => {}
            None if raw.is_empty() => return Err(FileError::new(file, "is empty").into()),
            None => return Err(FileError::new(file, "has no `schema`: not a model file").into()),
            _ => {
                let reason = format!("this schema is unknown; this program reads {MODEL_SCHEMA}");
                let fault = Fault { steps: vec![Step::Key("schema")], reason };
                return Err(fault.in_file(file, text).into());
            }
        }
        let model: Self = toml_file::parse(text, file)?;
        check::model(&model).map_err(|fault| fault.in_file(file, text))?;
        let found = checksum::of_table(&raw);
        if model.checksum != found {
            return Err(ToolError::Refused(format!(
                "{file}: the file was edited or damaged: its checksum is {}, its content has {found}",
                model.checksum
            )));
        }
        if ![ACCEPTED, ACCEPTED_WITH_MISFIT].contains(&model.conditions.verdict.as_str()) {
            return Err(ToolError::Refused(format!("{file}: this model was never accepted")));
        }
        Ok(model)
    }

    /// Joint and parameter of a name, for example `ZZ1`.
    pub(crate) fn parameter(&self, name: &str) -> Option<(usize, Parameter)> {
        parameter_of(name, self.leg.joints.len())
    }

    /// Whether the name is that of a friction difference between the directions, which acts only
    /// while its joint moves.
    pub(crate) fn is_asymmetry(name: &str) -> bool {
        name.starts_with(ASYMMETRY)
    }

    /// Whether the name is that of a spring's torque at angle zero.
    pub(crate) fn is_rest(&self, name: &str) -> bool {
        let springs =
            self.base_set.additional_torque.iter().filter(|torque| torque.kind == AdditionalKind::Spring);
        springs.into_iter().any(|torque| torque.joint > 0 && rest_name(torque.joint - 1) == name)
    }

    /// Fourteen parameters of a joint; `None` if one is unknown.
    pub fn joint_parameters(&self, joint: usize) -> Option<[f64; scarab::model::PARAMETERS_PER_JOINT]> {
        const COUNT: usize = scarab::model::PARAMETERS_PER_JOINT;
        let own = self.full_set.parameters.get(joint * COUNT..(joint + 1) * COUNT)?;
        let values: Option<Vec<f64>> = own.iter().map(|parameter| parameter.value).collect();
        values?.try_into().ok()
    }
}

impl StoredLeg {
    /// Leg file without truth, prior and drive.
    pub fn to_leg_file(&self) -> LegFile {
        let joints = self.joints.iter().map(|stored| {
            let mut joint = JointFile::new(&stored.name, stored.dh);
            joint.direction = stored.direction;
            joint.zero_offset_deg = stored.zero_offset_deg;
            joint.range_deg = stored.range_deg;
            joint.speed_limit_deg_s = stored.speed_limit_deg_s;
            joint.torque_limit_nm = stored.torque_limit_nm;
            joint.torque_per_ampere = stored.torque_per_ampere;
            joint
        });
        LegFile { side: self.side, ..LegFile::plain(&self.name, self.gravity, joints.collect()) }
    }
}

/// Symmetric matrix of `count` rows, padded with ones on the diagonal: linear algebra without a heap.
pub(crate) fn padded(
    count: usize,
    element: impl Fn(usize, usize) -> f64,
) -> SMatrix<f64, LARGEST_BASE_SET, LARGEST_BASE_SET> {
    let mut matrix = SMatrix::identity();
    for row in 0..count.min(LARGEST_BASE_SET) {
        for column in 0..count.min(LARGEST_BASE_SET) {
            matrix[(row, column)] = element(row, column);
        }
    }
    matrix
}

/// Joint and parameter of a name, for example `ZZ1`, in a leg with `joints` joints.
fn parameter_of(name: &str, joints: usize) -> Option<(usize, Parameter)> {
    let split = name.find(|letter: char| letter.is_ascii_digit())?;
    let (symbol, joint) = name.split_at(split);
    let joint = joint.parse::<usize>().ok().filter(|joint| (1..=joints).contains(joint))?;
    let parameter = match symbol {
        ASYMMETRY => Parameter::OFF,
        _ => Parameter::ALL.into_iter().find(|parameter| parameter.symbol() == symbol)?,
    };
    Some((joint - 1, parameter)).filter(|_| name.len() == symbol.len() + 1)
}
