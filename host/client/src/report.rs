//! Result of commissioning a board over its bus.

use serde::Serialize;

use scarab_base::number::Number;

/// Board, its measured values, and the identified leg.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CommissionReport {
    /// Device name (1008).
    pub device: String,
    /// Firmware version (100A).
    pub firmware: String,
    /// Check sum of the image (1F56:1); 0 where there is none.
    pub image: u32,
    /// Serial number (1018:4).
    pub serial: u32,
    /// Supply voltage, V.
    pub supply_v: Number,
    /// Values of each joint.
    pub joints: Vec<JointCommissioned>,
    /// Steps in the order they were taken.
    pub steps: Vec<StepTaken>,
    /// `accepted` or `refused`; `null` before an identification.
    pub verdict: Option<&'static str>,
    /// Reasons of the verdict.
    pub reasons: Vec<&'static str>,
    /// Models stored on this board.
    pub(crate) generation: u32,
    /// Base parameters of the leg.
    pub base: Vec<ParameterRead>,
    /// Whether calibration and model are stored.
    pub stored: bool,
}

/// One joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct JointCommissioned {
    /// Node-ID.
    pub node: u8,
    /// Temperature of the bridge, degrees Celsius.
    pub bridge_c: Number,
    /// Temperature of the winding, degrees Celsius.
    pub winding_c: Number,
    /// Angle, rad, flexion positive.
    pub position_rad: Number,
    /// Identified parameters.
    pub parameters: Vec<ParameterRead>,
    /// Root mean square of the predicted torque's error in the motions that the leg was not identified from,
    /// N m.
    pub predicted_rms_nm: Vec<Number>,
}

/// Parameter read from the board.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ParameterRead {
    /// Name.
    pub name: String,
    /// Value, SI units.
    pub value: Number,
    /// Standard deviation.
    pub sigma: Number,
    /// Status of the parameter.
    pub status: &'static str,
}

/// A step and its result.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StepTaken {
    /// Name.
    pub step: &'static str,
    /// What was found or done.
    pub result: String,
    /// Duration, s.
    pub seconds: f64,
}
