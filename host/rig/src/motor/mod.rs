//! `motor`: measures the board's current loop with one of a leg's motors on a test stand.
//!
//! | part | measurement |
//! | --- | --- |
//! | `step` | current steps at rest and at three speeds, with and without feedforward, against the design |
//! | `ripple` | torque ripple, with and without dead-time compensation |
//! | `limit` | a target beyond the voltage limit, and the recovery |
//! | `regeneration` | a spinning inertia braked, with and without the chopper |
//!
//! The firmware first calibrates the motor on the stand. Reported currents are actual currents, not
//! measured ones.

pub(crate) mod limit;
pub(crate) mod regeneration;
pub(crate) mod ripple;
pub(crate) mod step;

use crate::report::motor::MotorReport;
use hal_sim::drive::description::{AxisDescription, SupplyDescription};
use hal_sim::drive::stand::{Load, Stand};
use scarab::board::odrive_v3_6::settings::drives::BANDWIDTH;
use scarab::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ};
use scarab::motor::{Axis, AxisConfiguration, AxisRequest, Calibration, Chopper, SenseScale};
use scarab::units::{Ampere, Volt};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::{LegFile, MotorFile};
use scarab_identify::leg::board_words as words;
use scarab_identify::report::SCHEMA;

use crate::board::{BRAKE, BUS, axis_configuration, calibration_settings, commission};

/// Time for which a rotor turns before the bridge switches, s.
const TRACKED_S: f64 = 0.02;

/// PWM period, s.
pub(crate) const PERIOD_S: f64 = 1.0 / CURRENT_RATE_HZ as f64;

/// Motor with its board in the initial state.
#[derive(Clone, Debug)]
pub(crate) struct Bench {
    /// Joint whose motor it is.
    pub(crate) joint: String,
    /// Configuration of the firmware's axis.
    pub(crate) configuration: AxisConfiguration,
    /// Simulated axis.
    pub(crate) axis: AxisDescription,
    /// Simulated supply.
    pub(crate) supply: SupplyDescription,
    /// Calibration found by the firmware on the stand.
    calibration: Calibration,
    /// Rotor speed at the joint's speed limit, rad/s.
    pub(crate) top_speed: f64,
    /// Seed of the sensor noise.
    pub(crate) seed: u64,
}

impl Bench {
    /// Prepares the motor of a joint.
    pub fn new(leg: &LegFile, joint: usize, seed: u64) -> Result<Self, ToolError> {
        let found = leg.joints.get(joint).and_then(|joint| Some((joint, joint.motor.as_ref()?)));
        let Some((file, motor)) = found else {
            return Err(ToolError::input(format!("{}: the joint has no `[joint.motor]`", leg.name)));
        };
        let motor: &MotorFile = motor;
        let configuration = axis_configuration(file, motor);
        let settings = calibration_settings(&configuration, motor);
        let (axis, supply) = (motor.axis(file), leg.supply.description());
        Ok(Self {
            joint: file.name.clone(),
            configuration,
            axis,
            supply,
            calibration: commission(&file.name, &configuration, settings, &axis, &supply, 0.0, seed)?,
            top_speed: file.speed_limit_deg_s.to_radians() * file.encoder.ratio,
            seed,
        })
    }

    /// New stand with a rotor turning at `speed` from `angle` on (rad/s, rad).
    pub(crate) fn rig(&self, speed: f64, angle: f64) -> Result<Rig, ToolError> {
        let mut stand = Stand::new(&self.axis, &self.supply, Load::Turned(speed), angle, self.seed);
        let sample = stand.period(&AxisCommand::OFF, 0.0);
        let axis = Axis::new(&self.configuration, &self.calibration, &sample).map_err(|error| {
            ToolError::input(format!("axis `{}`: {}", self.joint, words::axis_error(error)))
        })?;
        let mut rig = Rig { stand, axis, command: AxisCommand::OFF, chopper: None, brake: 0.0, sample };
        // The rotor already turns: its speed is estimated before the bridge switches.
        for _ in 0..(TRACKED_S / PERIOD_S) as u32 {
            rig.tick(AxisRequest::OFF);
        }
        Ok(rig)
    }

    /// Limits a current to the axis' limit, A.
    pub(crate) fn within_limit(&self, current: f64) -> f64 {
        current.min(f64::from(self.configuration.current_limit.0))
    }

    /// Rejects a measurement of an axis that has switched itself off.
    pub(crate) fn must_hold(&self, rig: &Rig, what: &str, speed: f64) -> Result<(), ToolError> {
        let Some(fault) = rig.axis.fault() else { return Ok(()) };
        Err(ToolError::Refused(format!(
            "axis `{}` turned its bridge off ({what}, rotor at {speed:.0} rad/s): {}",
            self.joint,
            words::axis_fault(fault)
        )))
    }
}

/// Motor on its stand under the board's current loop.
#[derive(Clone, Debug)]
pub struct Rig {
    /// The plant.
    pub(crate) stand: Stand,
    /// The firmware.
    pub(crate) axis: Axis,
    command: AxisCommand,
    chopper: Option<Chopper>,
    /// Share of the time for which the brake resistor is on.
    pub(crate) brake: f32,
    sample: AxisSample,
}

impl Rig {
    /// Adds the board's brake chopper.
    pub(crate) fn with_chopper(mut self) -> Self {
        self.chopper = Chopper::new(BRAKE[0], BRAKE[1]);
        self
    }

    /// Runs one PWM period with this target; returns direct and quadrature current at its end, A.
    pub(crate) fn period(&mut self, target: f64) -> [f64; 2] {
        self.tick(AxisRequest { enabled: true, current: Ampere(target as f32) });
        self.stand.rotor_currents()
    }

    fn tick(&mut self, request: AxisRequest) {
        self.sample = self.stand.period(&self.command, f64::from(self.brake));
        self.command = self.axis.tick(&self.sample, request);
        if let Some(chopper) = &self.chopper {
            let bus: Volt = SenseScale::ODRIVE_3_6.bus(self.sample.bus_code);
            self.brake = chopper.duty(bus);
        }
    }

    /// Holds this target for a time, s.
    pub fn hold(&mut self, target: f64, seconds: f64) {
        for _ in 0..(seconds / PERIOD_S) as u32 {
            self.period(target);
        }
    }
}

/// Runs all measurements.
pub fn measure(leg: &LegFile, joint: usize, seed: u64) -> Result<MotorReport, ToolError> {
    let bench = Bench::new(leg, joint, seed)?;
    Ok(MotorReport {
        schema: SCHEMA,
        leg: leg.name.clone(),
        joint: bench.joint.clone(),
        bandwidth_hz: f64::from(BANDWIDTH.0),
        designed: step::designed(f64::from(BANDWIDTH.0)),
        designed_response: step::response(f64::from(BANDWIDTH.0)),
        bus_limit_v: f64::from(BUS[1].0),
        steps: step::measure(&bench)?,
        ripple: ripple::measure(&bench)?,
        limit: limit::measure(&bench)?,
        regeneration: regeneration::measure(&bench)?,
    })
}
