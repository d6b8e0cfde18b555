//! What a board remembers over the power, as a file that people read: objects of its nodes, calibrations, the model.
//!
//! Why: a board is replaced, and what it was taught goes with it; a calibration is looked at, or compared, without a bus. The file is
//! nothing a board believes: a calibration is checked at the motor and a model against the leg's fingerprint, as ever.
//!
//! ```text
//! flash image --Store::load, checks--> KeptFile --to_toml--> text           what is damaged or fails a check is told and left out
//! flash image <--Store::save (drive off)-- KeptFile <--parse, checks-- text  all of it or nothing; what is not named stays
//! ```
//!
//! The same checks stand both ways, so that what is exported can be imported. Floats are written with the digits that restore the f32
//! exactly, angles in radians with those that restore the unit of 2^-32 turns. Keys are an interface (`docs/store.md`): unknown ones are
//! errors.

mod convert;
mod flash;
mod objects;
mod text;

pub use flash::Found;

use serde::Deserialize;

use super::error::ToolError;

/// Version of the keys.
pub const KEPT_SCHEMA: i64 = 1;

/// What a file holds; what it does not name is not touched.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptFile {
    /// [`KEPT_SCHEMA`].
    pub schema: i64,
    /// One of each node.
    #[serde(default)]
    pub node: Vec<NodeObjects>,
    /// One of each axis.
    #[serde(default)]
    pub calibration: Vec<AxisCalibration>,
    /// The accepted model.
    pub model: Option<ModelPart>,
}

/// A joint of the leg, and the node and the axis that are its.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Joint {
    /// The first.
    Hip,
    /// The second.
    Knee,
    /// The third, of a model only.
    Ankle,
}

impl Joint {
    /// From the base.
    pub const ALL: [Self; 3] = [Self::Hip, Self::Knee, Self::Ankle];

    /// As files call it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hip => "hip",
            Self::Knee => "knee",
            Self::Ankle => "ankle",
        }
    }
}

/// What a host changed of a node's objects.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NodeObjects {
    /// Whose node.
    pub joint: Joint,
    /// All that are kept; the others are as after the start.
    pub objects: Vec<ObjectValue>,
}

/// One object.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjectValue {
    /// In the dictionary.
    pub index: u16,
    /// In the dictionary.
    pub subindex: u8,
    /// As the dictionary has it; for people, and checked where it stands.
    pub name: Option<String>,
    /// In the object's own unit.
    pub value: i64,
}

/// What an axis was found to be.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisCalibration {
    /// Whose axis.
    pub joint: Joint,
    /// Of one phase.
    pub resistance_ohm: f64,
    /// Along the flux, H.
    pub direct_inductance_h: f64,
    /// Across the flux, H.
    pub quadrature_inductance_h: f64,
    /// Electrical angle at the index, from -pi to pi.
    pub offset_rad: f64,
    /// With which it was found.
    pub encoder: Encoder,
}

/// The setting a calibration holds for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Encoder {
    /// How the counter runs while the field turns from A over B to C.
    pub counter: Counter,
    /// Of the motor.
    pub pole_pairs: u8,
    /// Of the encoder.
    pub counts_per_turn: u32,
}

/// Which way a counter runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Counter {
    /// With the field.
    Up,
    /// Against it.
    Down,
}

/// An accepted model and where it comes from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelPart {
    /// Of the leg it was found on: 16 hexadecimal digits, as in model files.
    pub fingerprint: String,
    /// Version of the firmware that found it.
    pub firmware: String,
    /// Counts the models that were accepted on the board.
    pub generation: u32,
    /// Text, since it may need all 64 bits.
    pub swarm_seed: String,
    /// Of the warmer bridge, degrees Celsius; absent where it was not known.
    pub bridge_temperature_c: Option<f64>,
    /// A person wore the leg; absent where it was not known.
    pub worn: Option<bool>,
    /// From the base.
    pub joint: Vec<ModelJoint>,
}

/// One joint of a model.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelJoint {
    /// Which.
    pub joint: Joint,
    /// All fourteen, SI.
    pub parameters: Parameters,
    /// Friction that falls with the speed.
    pub stribeck: StribeckPart,
    /// What the constant column is.
    pub constant: ConstantPart,
    /// Distance to the joint before it, m.
    pub length_m: f64,
    /// N m/A at the joint.
    pub torque_per_ampere: f64,
    /// Of measured minus predicted, on a motion that was not identified from, N m; absent where it was not known.
    pub rms_nm: Option<f64>,
    /// Of the torque on it, N m; absent likewise.
    pub mean_absolute_nm: Option<f64>,
}

/// The fourteen parameters of a joint, each under its symbol.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(rename_all = "UPPERCASE")]
#[expect(missing_docs, reason = "the symbols of `scarab::model::Parameter`, which explains them")]
pub struct Parameters {
    pub xx: f64,
    pub xy: f64,
    pub xz: f64,
    pub yy: f64,
    pub yz: f64,
    pub zz: f64,
    pub hx: f64,
    pub hy: f64,
    pub hz: f64,
    pub m: f64,
    pub ia: f64,
    pub fc: f64,
    pub fv: f64,
    pub off: f64,
}

/// Coulomb friction * (1 + excess exp(-(speed / velocity)^2)).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StribeckPart {
    /// 0 or more.
    pub excess: f64,
    /// rad/s.
    pub velocity_rad_s: f64,
}

/// What the constant column of a joint is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ConstantPart {
    /// An offset of the torque.
    Offset,
    /// A difference of friction between the directions.
    Asymmetry,
}

impl KeptFile {
    /// The checked content of a text; `file` is what faults are reported under.
    ///
    /// # Errors
    /// What is no such file, with the line where one is to blame, or the part.
    pub fn parse(text: &str, file: &str) -> Result<Self, ToolError> {
        let of_text = |fault: toml::de::Error| {
            let reason = fault.message().replace('\n', ", ");
            let line = fault.span().map(|span| 1 + text[..span.start].matches('\n').count());
            let line = line.map_or(String::new(), |line| format!("{line}:"));
            ToolError::input(format!("{file}:{line} {reason}"))
        };
        let raw: toml::Table = toml::from_str(text).map_err(of_text)?;
        match raw.get("schema") {
            Some(toml::Value::Integer(KEPT_SCHEMA)) => {}
            Some(schema) => {
                let reason = format!("schema {schema} is unknown; this program reads {KEPT_SCHEMA}");
                return Err(ToolError::input(format!("{file}: {reason}")));
            }
            None => return Err(ToolError::input(format!("{file}: has no `schema`: not what a board keeps"))),
        }
        let kept: Self = toml::from_str(text).map_err(of_text)?;
        kept.check().map_err(|why| ToolError::input(format!("{file}: {why}")))?;
        Ok(kept)
    }

    fn check(&self) -> Result<(), String> {
        once("node", self.node.iter().map(|node| node.joint))?;
        once("calibration", self.calibration.iter().map(|axis| axis.joint))?;
        for node in &self.node {
            objects::to_bytes(&node.objects, node.joint).map_err(|why| of_node(node.joint, &why))?;
        }
        for axis in &self.calibration {
            axis.to_kept().map_err(|why| format!("calibration of the {}: {why}", axis.joint.name()))?;
        }
        self.model.as_ref().map_or(Ok(()), |model| model.check().map_err(|why| format!("model: {why}")))
    }
}

fn of_node(joint: Joint, why: &str) -> String {
    format!("objects of the {}: {why}", joint.name())
}

/// Each joint once, and only those a board has a place for.
fn once(what: &str, joints: impl Iterator<Item = Joint>) -> Result<(), String> {
    let mut seen = Vec::new();
    for joint in joints {
        if joint == Joint::Ankle {
            return Err(format!("{what}: a board keeps none of the ankle"));
        }
        if seen.contains(&joint) {
            return Err(format!("{what}: the {} is there twice", joint.name()));
        }
        seen.push(joint);
    }
    Ok(())
}
