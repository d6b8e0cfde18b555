//! The 4 kHz tick of a leg: from encoder counts and a commanded motion to the drives' commands.
//!
//! ```text
//! counts -> step gate -> observer -> position, velocity --+
//! commanded motion -> torque model (feedforward) ---------+-> controller -> torque -> monitor -> currents
//! ```
//!
//! | part | content |
//! | --- | --- |
//! | [`JointScale`] | counts and currents to the model's angles and torques; all signs |
//! | `Observer` | position and velocity from counts |
//! | [`Controller`] | position and velocity control with an integral that cannot wind up |
//! | [`TorqueModel`] | model interface of the feedforward, which may be `None` |
//! | [`Servo`] | the tick, a pure function of its state and arguments |
//! | `LogAverager` | means of eight ticks for identification, 500 Hz |
//!
//! All values inside are the model's (D-H) angles and signs. The servo is independent of identification: a
//! model's parameters arrive as a value between two ticks.

pub mod configuration;
pub(crate) mod controller;
pub(crate) mod feedforward;
pub(crate) mod logging;
pub(crate) mod observer;
pub(crate) mod scale;
pub mod tick;

pub use configuration::{JointConfiguration, ServoError};
pub use controller::Controller;
pub(crate) use controller::ControllerGains;
#[cfg(test)]
pub(crate) use feedforward::NoModel;
pub use feedforward::TorqueModel;
pub(crate) use feedforward::smoothed_sign;
pub(crate) use logging::LogAverager;
pub use logging::{LOG_RATE_HZ, LogSample, TICKS_PER_LOG};
pub use scale::JointScale;
pub use tick::{Effort, Servo, ServoCommand, ServoOutput};

pub use crate::hal::SERVO_RATE_HZ;

/// Time between two ticks, s.
pub(crate) const TICK_S: f32 = 1.0 / SERVO_RATE_HZ as f32;
