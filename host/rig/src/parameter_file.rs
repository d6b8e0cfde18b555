//! Stored data of a board as a readable file: objects of its nodes, calibrations, and the models.
//!
//! Why: the data can be moved to a replacement board, and calibrations can be viewed or compared without a
//! bus. A board does not trust the file: it still checks a calibration at the motor and a model against the
//! leg's fingerprint.
//!
//! ```text
//! flash image --Store::load, checks--> ParameterFile --to_toml--> text   damaged or invalid parts: omitted
//! flash image <--Store::save (drive off)-- ParameterFile <--parse, checks-- text   all or nothing
//! ```
//!
//! An export reports the parts that it omits. An import does not change the parts that its file does not
//! name.
//!
//! Both directions have the same checks, so every export can be imported. Floats are written with
//! the digits that restore the f32 exactly, angles in radians with those that restore the unit of
//! 2^-32 turns. Keys are an interface (`docs/files.md`): unknown ones are errors.

mod convert;
mod flash;
pub mod memory;
mod objects;
mod text;

pub use flash::FlashContents;

use scarab::leg::{Constant, CounterDirection, EncoderSetting};
use scarab::store::Key;
use serde::Deserialize;

use scarab_base::error::FileError;
use scarab_base::toml_file;

/// Version of the keys.
pub(crate) const PARAMETER_SCHEMA: i64 = 1;

/// Contents of a file; parts not named stay unchanged.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterFile {
    /// [`PARAMETER_SCHEMA`].
    pub(crate) schema: i64,
    /// Objects of the nodes.
    #[serde(default)]
    pub(crate) node: Vec<NodeObjects>,
    /// Calibrations of the axes.
    #[serde(default)]
    pub(crate) calibration: Vec<AxisCalibration>,
    /// The accepted model of the leg, empty or unknown whether worn.
    pub(crate) model: Option<ModelPart>,
    /// The accepted model of the worn leg.
    pub(crate) worn_model: Option<ModelPart>,
}

/// Joint of the leg with its node and axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Joint {
    /// First joint.
    Hip,
    /// Second joint.
    Knee,
    /// Third joint, in models only.
    Ankle,
}

impl Joint {
    /// All joints, from the base.
    pub(crate) const ALL: [Self; 3] = [Self::Hip, Self::Knee, Self::Ankle];

    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hip => "hip",
            Self::Knee => "knee",
            Self::Ankle => "ankle",
        }
    }
}

/// Objects of a node that a host has changed.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NodeObjects {
    /// Joint of the node.
    pub(crate) joint: Joint,
    /// All stored objects; the others have their initial values.
    pub(crate) objects: Vec<ObjectValue>,
}

/// Value of one object.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ObjectValue {
    /// Index in the dictionary.
    pub(crate) index: u16,
    /// Subindex in the dictionary.
    pub(crate) subindex: u8,
    /// Name in the dictionary; for people, and checked if present.
    pub(crate) name: Option<String>,
    /// Value in the object's own unit.
    pub(crate) value: i64,
}

/// Calibration of an axis.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AxisCalibration {
    /// Joint of the axis.
    pub(crate) joint: Joint,
    /// Resistance of one phase, ohm.
    pub(crate) resistance_ohm: f64,
    /// Inductance along the flux, H.
    pub(crate) direct_inductance_h: f64,
    /// Inductance across the flux, H.
    pub(crate) quadrature_inductance_h: f64,
    /// Electrical angle at the index, from -pi to pi.
    pub(crate) offset_rad: f64,
    /// Encoder settings of the calibration.
    #[serde(with = "Encoder")]
    pub(crate) encoder: EncoderSetting,
    /// Temperature of the winding at the calibration, degrees Celsius, if known.
    #[serde(default)]
    pub(crate) winding_c: Option<f64>,
    /// Readings at the joint's zero, with an absolute encoder at the joint.
    #[serde(default)]
    pub(crate) joint_zero: Option<JointZeroPart>,
}

/// Readings at a joint's zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct JointZeroPart {
    /// Rotor position within a turn, counts.
    pub(crate) rotor_counts: i32,
    /// Reading of the joint's encoder, 2^-14 turns.
    pub(crate) joint_steps: u16,
    /// Check of direction and ratio.
    pub(crate) setting: u8,
}

/// Keys of the settings for which a calibration is valid.
#[derive(Deserialize)]
#[serde(remote = "EncoderSetting", deny_unknown_fields)]
struct Encoder {
    #[serde(with = "Counter")]
    counter: CounterDirection,
    pole_pairs: u8,
    counts_per_turn: u32,
    #[serde(default)]
    absolute: bool,
}

/// Words of a counter that runs with or against the field.
#[derive(Deserialize)]
#[serde(remote = "CounterDirection", rename_all = "lowercase")]
enum Counter {
    Up,
    Down,
}

/// Accepted model with its origin.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ModelPart {
    /// Fingerprint of the leg: 16 hexadecimal digits, as in model files.
    pub(crate) fingerprint: String,
    /// Version of the firmware that identified the model.
    pub(crate) firmware: String,
    /// Number of models accepted on the board so far.
    pub(crate) generation: u32,
    /// Seed of the swarm; text, since it may need all 64 bits.
    pub(crate) swarm_seed: String,
    /// Temperature of the warmer bridge, degrees Celsius; absent if unknown.
    pub(crate) bridge_temperature_c: Option<f64>,
    /// Whether a person wore the leg; absent if unknown.
    pub(crate) worn: Option<bool>,
    /// Share of the mass matrix that is certain by 2 sigma, 0 to 1; 0 if unknown.
    #[serde(default)]
    pub(crate) inertia_lower_bound: f64,
    /// Joints, from the base.
    pub(crate) joint: Vec<ModelJoint>,
}

/// One joint of a model.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ModelJoint {
    /// Joint.
    pub(crate) joint: Joint,
    /// Fourteen parameters, SI units.
    pub(crate) parameters: Parameters,
    /// Friction that decreases with speed.
    pub(crate) stribeck: StribeckPart,
    /// Meaning of the constant column.
    #[serde(with = "ConstantPart")]
    pub(crate) constant: Constant,
    /// Friction that is certain by 2 sigma; 0 if unknown.
    #[serde(default)]
    pub(crate) friction_lower_bound: FrictionBound,
    /// Distance to the previous joint, m.
    pub(crate) length_m: f64,
    /// Torque constant at the joint, N m/A.
    pub(crate) torque_per_ampere: f64,
    /// RMS of measured minus predicted torque on an unused motion, N m; absent if unknown.
    pub(crate) rms_nm: Option<f64>,
    /// Mean absolute torque on that motion, N m; absent if unknown.
    pub(crate) mean_absolute_nm: Option<f64>,
}

/// Fourteen parameters of a joint, by symbol.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) struct Parameters {
    pub(crate) xx: f64,
    pub(crate) xy: f64,
    pub(crate) xz: f64,
    pub(crate) yy: f64,
    pub(crate) yz: f64,
    pub(crate) zz: f64,
    pub(crate) hx: f64,
    pub(crate) hy: f64,
    pub(crate) hz: f64,
    pub(crate) m: f64,
    pub(crate) ia: f64,
    pub(crate) fc: f64,
    pub(crate) fv: f64,
    pub(crate) off: f64,
}

/// Stribeck curve: Coulomb friction * (1 + excess exp(-(speed / velocity)^2)).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct StribeckPart {
    /// Excess, at least 0.
    pub(crate) excess: f64,
    /// Speed of the decay, rad/s.
    pub(crate) velocity_rad_s: f64,
}

/// Lower bounds of a joint's friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FrictionBound {
    /// Coulomb friction, N m.
    pub(crate) coulomb_nm: f64,
    /// Viscous friction, N m s/rad.
    pub(crate) viscous_nm_s_rad: f64,
}

/// Words of a joint's constant column.
#[derive(Deserialize)]
#[serde(remote = "Constant", rename_all = "lowercase")]
enum ConstantPart {
    Offset,
    Asymmetry,
}

impl ParameterFile {
    /// Parses and checks a text; `file` is its name in error messages.
    ///
    /// # Errors
    /// The file is invalid; the error names the line or part.
    pub fn parse(text: &str, file: &str) -> Result<Self, FileError> {
        let raw: toml::Table = toml_file::parse(text, file)?;
        match raw.get("schema") {
            Some(toml::Value::Integer(PARAMETER_SCHEMA)) => {}
            Some(schema) => {
                let reason = format!("schema {schema} is unknown; this program reads {PARAMETER_SCHEMA}");
                return Err(FileError::new(file, reason));
            }
            None => return Err(FileError::new(file, "has no `schema`: not a file of stored data")),
        }
        let kept: Self = toml_file::parse(text, file)?;
        kept.check().map_err(|why| FileError::new(file, why))?;
        Ok(kept)
    }

    fn check(&self) -> Result<(), String> {
        once("node", self.node.iter().map(|node| node.joint))?;
        once("calibration", self.calibration.iter().map(|axis| axis.joint))?;
        for node in &self.node {
            objects::to_bytes(&node.objects, node.joint).map_err(|why| of_node(node.joint, &why))?;
        }
        for axis in &self.calibration {
            axis.to_record().map_err(|why| format!("calibration of the {}: {why}", axis.joint.name()))?;
        }
        for (table, key, model) in
            [("model", Key::Model, &self.model), ("worn_model", Key::WornModel, &self.worn_model)]
        {
            if let Some(model) = model {
                model.check(key).map_err(|why| format!("{table}: {why}"))?;
            }
        }
        Ok(())
    }
}

fn of_node(joint: Joint, why: &str) -> String {
    format!("objects of the {}: {why}", joint.name())
}

/// Rejects repeated joints and joints that a board does not have.
fn once(what: &str, joints: impl Iterator<Item = Joint>) -> Result<(), String> {
    let mut seen = Vec::new();
    for joint in joints {
        if joint == Joint::Ankle {
            return Err(format!("{what}: a board does not store data of the ankle"));
        }
        if seen.contains(&joint) {
            return Err(format!("{what}: the {} occurs twice", joint.name()));
        }
        seen.push(joint);
    }
    Ok(())
}
