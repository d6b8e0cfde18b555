//! Curves of a run with a fault, for its figure.

use scarab::model::planar::JOINTS;

/// Curves of one run, one value per PWM period.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultCurves {
    /// Time since the injection.
    pub time_ms: Vec<f64>,
    /// Speeds of the joints, deg/s, anatomical.
    pub speed: [Vec<f64>; JOINTS],
    /// Torques of the motors at the joints, N m, anatomical.
    pub torque: [Vec<f64>; JOINTS],
    /// Bus voltage, V.
    pub bus: Vec<f64>,
    /// Whether both bridges are off.
    pub released: Vec<bool>,
}
