//! Field-oriented current control of one axis, and the calibration that it requires.
//!
//! ```text
//! AxisSample -> sense -> frames -> current loop -> frames -> modulation -> AxisCommand        24 kHz
//! Calibrator: offsets -> resistance, wiring -> inductances -> scan -> refinement -> Calibration -> Axis
//! ```
//!
//! | part | what it is |
//! | --- | --- |
//! | `Phases`, [`Stationary`], `Rotating` | Clarke and Park as types |
//! | [`ElectricalAngle`], `SpeedTracker` | counts to angle and speed; sine and cosine |
//! | [`AbsoluteAngle`] | frames of an absolute encoder at rotor or joint |
//! | [`SenseScale`] | two shunt codes to a current vector, or an error at the rails |
//! | `CurrentLoop` | PI in d and q, feedforward, voltage limit, anti-windup |
//! | [`Modulator`] | space vectors, sampling window for the shunts, dead time |
//! | [`Axis`] | all of these in one tick, with the limits that turn the outputs off |
//! | `ModelWatch`, `ShuntWatch` | plausibility of voltages, currents and codes against each other |
//! | [`calibration`] | measures and refuses; the only source of a [`Calibration`] |
//! | [`Chopper`] | burns regenerated energy in the brake resistor |
//! | `reference` | the joint's zero from a stated pose |
//!
//! Equations, the timing within one PWM period and measured figures: docs/motor.md.

pub(crate) mod absolute;
pub(crate) mod angle;
pub(crate) mod axis;
pub mod calibration;
pub(crate) mod chopper;
pub mod configuration;
pub(crate) mod current_loop;
pub(crate) mod frames;
pub(crate) mod model_watch;
pub(crate) mod modulation;
pub(crate) mod reference;
pub mod sense;
pub(crate) mod shunt_watch;

pub use absolute::{AbsoluteAngle, AbsoluteEncoders};
pub use angle::ElectricalAngle;
pub(crate) use angle::{CountScale, Rotation, SpeedTracker};
pub(crate) use axis::BridgeRequest;
pub use axis::{Axis, AxisFault, AxisRequest};
pub use calibration::{
    Calibration, CalibrationSettings, CalibrationStep, Calibrator, EncoderSetting, IndexSearch, JointZero,
    Mismatch, MotorConstant, MotorFindings, Phase, Refusal, StoredCalibration,
};
pub(crate) use chopper::BrakeBudget;
pub use chopper::Chopper;
pub use configuration::{AxisConfiguration, AxisError, Direction};
pub(crate) use current_loop::{CurrentGains, CurrentLoop, MotorConstants};
pub(crate) use frames::{Phases, Rotating};
pub use frames::{Quantity, Stationary};
pub(crate) use model_watch::{ModelLimits, ModelWatch};
pub use modulation::{BridgeTiming, DeadTime, Modulator};
pub use sense::SenseScale;
pub(crate) use shunt_watch::ShuntWatch;

#[cfg(test)]
pub(crate) mod testing;
