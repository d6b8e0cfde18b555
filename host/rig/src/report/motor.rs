//! Measurements of a current loop on a motor's test stand.

use serde::Serialize;

/// Results of all measurements.
#[derive(Clone, Debug, Serialize)]
pub struct MotorReport {
    /// Version of the JSON.
    pub(crate) schema: u32,
    /// Name of the leg.
    pub leg: String,
    /// Name of the joint.
    pub joint: String,
    /// Bandwidth of the current loop, Hz.
    pub bandwidth_hz: f64,
    /// Designed step response.
    pub designed: Shape,
    /// Designed response, a value per PWM period from the step on.
    #[serde(skip)]
    pub designed_response: Vec<f64>,
    /// Bus voltage at which the bridges are switched off, V.
    #[serde(skip)]
    pub bus_limit_v: f64,
    /// Steps of the current.
    pub steps: Vec<StepReport>,
    /// Torque ripple.
    pub ripple: Vec<RippleReport>,
    /// Voltage limit.
    pub limit: Vec<LimitReport>,
    /// Regenerative braking.
    pub regeneration: Vec<RegenerationReport>,
}

/// Shape of a step response.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shape {
    /// Rise time from 10 to 90 % of the step, ms; `None` if 90 % is not reached.
    pub rise_ms: Option<f64>,
    /// Overshoot beyond the target, percent of the step.
    pub overshoot_percent: f64,
}

/// Results of one kind of loop at one speed.
#[derive(Clone, Debug, Serialize)]
pub struct StepReport {
    /// Rotor speed, rad/s.
    pub speed_rad_s: f64,
    /// Whether cross-coupling and back-EMF are fed forward.
    pub feedforward: bool,
    /// Current before the step, A.
    pub from_a: f64,
    /// Current requested by the step, A.
    pub to_a: f64,
    /// Shape of the quadrature current.
    #[serde(flatten)]
    pub shape: Shape,
    /// Largest direct current during the step, percent of the step.
    pub coupling_percent: f64,
    /// Mean error of the quadrature current over the last fifth, A.
    pub error_a: f64,
    /// Time from the step on, ms.
    pub time_ms: Vec<f64>,
    /// Quadrature current, A.
    pub quadrature_a: Vec<f64>,
    /// Direct current, A.
    pub direct_a: Vec<f64>,
}

/// Results of one kind of loop at one speed.
#[derive(Clone, Debug, Serialize)]
pub struct RippleReport {
    /// Rotor speed, rad/s.
    pub speed_rad_s: f64,
    /// Requested current, A.
    pub current_a: f64,
    /// Whether dead time is compensated.
    pub compensated: bool,
    /// Whether the sensors have the board's noise.
    pub noise: bool,
    /// Standard deviation of the torque, percent of its mean.
    pub torque_percent: f64,
    /// Amplitude of the sixth harmonic, percent of the mean.
    pub sixth_percent: f64,
    /// Error of the mean torque against 1.5 pole pairs flux current, percent.
    pub mean_error_percent: f64,
    /// Standard deviation of the direct current, A.
    pub direct_a: f64,
}

/// Results at one speed on one supply.
#[derive(Clone, Debug, Serialize)]
pub struct LimitReport {
    /// Rotor speed, rad/s.
    pub speed_rad_s: f64,
    /// Supply voltage, V.
    pub supply_v: f64,
    /// Current requested at the limit, A.
    pub asked_a: f64,
    /// Current requested afterwards, A.
    pub target_a: f64,
    /// Quadrature current at the limit, mean of the last 10 ms, A.
    pub reached_a: f64,
    /// Direct current at the limit, A.
    pub direct_a: f64,
    /// Time until the current stays within 3 % of `asked_a` about the new target, ms; `None` if it
    /// never does.
    pub recovery_ms: Option<f64>,
    /// Overshoot beyond the new target, A.
    pub overshoot_a: f64,
    /// Whether the firmware switched the bridge off.
    pub released: bool,
    /// Time relative to the change of the target, ms.
    pub time_ms: Vec<f64>,
    /// Quadrature current, A.
    pub quadrature_a: Vec<f64>,
    /// Direct current, A.
    pub direct_current_a: Vec<f64>,
}

/// Results of one braking.
#[derive(Clone, Debug, Serialize)]
pub struct RegenerationReport {
    /// Whether the chopper works.
    pub chopper: bool,
    /// Braking current, A.
    pub current_a: f64,
    /// Highest bus voltage, V.
    pub highest_bus_v: f64,
    /// Kinetic energy at the beginning, J.
    pub motion_j: f64,
    /// Energy returned to the bus while the motor generated, J; at low speed the windings take
    /// more than the motion gives.
    pub returned_j: f64,
    /// Part of the returned energy that went into the brake resistor, J.
    pub brake_j: f64,
    /// Fault for which the firmware switched the bridge off, if any.
    pub fault: Option<&'static str>,
    /// Time, ms.
    pub time_ms: Vec<f64>,
    /// Bus voltage, V.
    pub bus_v: Vec<f64>,
    /// Rotor speed, rad/s.
    pub speed_rad_s: Vec<f64>,
}
