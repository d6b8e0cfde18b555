//! The firmware's side of a complete drive: all levels of the board ([`levels`]) over simulated registers ([`registers`]).
//!
//! What the plant says in a PWM period is answered in the same period and acts in the next; the servo's sample is the mean of the six
//! periods since its last tick.
//!
//! A run begins with a drive that is ready: every motor was calibrated on a stand, free of its gear and at rest, with the rotor
//! and the counter where they are in the leg, and the pose in which the leg stands is taken for the reference (a released leg
//! would swing for the half second that `StatedPose` waits).

pub mod levels;
mod locked;
pub mod registers;
pub mod words;

use core::f64::consts::TAU;

use scarab::board::odrive_v3_6::settings::analog::HOTTEST_C;
use scarab::board::odrive_v3_6::settings::drives;
use scarab::hal::{AxisCommand, LegDrives};
use scarab::leg::MotorDescription;
use scarab::motor::{
    Axis, AxisConfiguration, Calibration, CalibrationSettings, CalibrationStep, Calibrator, Chopper,
};
use scarab::operation::HousekeepingSettings;
use scarab::units::{Ampere, RadianPerSecond, Volt, Weber};

use super::error::ToolError;
use super::leg_file::{JointFile, LegFile, MotorFile};
use crate::drive::description::{AxisDescription, CompleteDescription, SupplyDescription};
use crate::drive::stand::{Load, Stand};
use crate::world::World;
use crate::world::periods::PERIODS_PER_TICK;

/// Of the bus voltage, on the board of 56 V.
const DIVIDER: f32 = 19.0;
/// Within which its bridges may switch.
pub const BUS: [Volt; 2] = drives::bus(DIVIDER);
/// Where its brake resistor conducts.
pub const BRAKE: [Volt; 2] = drives::chopper(DIVIDER);

/// Most that a motor is calibrated with on its stand.
const CALIBRATION_CURRENT_A: f64 = drives::CALIBRATION.current.0 as f64;
/// Voltage vectors of a calibration: what is enough for motors of the default leg, and less than half of the lowest bus.
const CALIBRATION_VOLTAGE_V: [f64; 2] = [3.0, 9.5];
const CALIBRATION_TURNS_PER_S: f32 = drives::CALIBRATION.turns_per_s;
/// Half of a wave with which the firmware measures inductances, s, and the share of the current that it aims at.
const HALF_WAVE_S: f64 = 2.0 / 24_000.0;
const WAVE_SHARE: f64 = 0.3;
/// What turns on the stand: the rotor alone, kg m^2; bearings, N m; a little of drag, N m s/rad.
const ROTOR: Load = Load::Free { inertia: 1e-4, coulomb: 0.01, viscous: 1e-4, torque: 0.0 };
/// Before a calibration: half a second.
const REST_PERIODS: u32 = 12_000;
/// A calibration takes some seconds.
const LONGEST_CALIBRATION: u32 = 24_000 * 60;

/// The configuration of a joint's axis, as the board's settings make it of what a leg file states.
pub fn axis_configuration(joint: &JointFile, motor: &MotorFile) -> AxisConfiguration {
    let motor = MotorDescription {
        pole_pairs: motor.pole_pairs as u8,
        flux: Weber(motor.flux(joint) as f32),
        counts_per_turn: joint.encoder.counts,
        ratio: joint.encoder.ratio as f32,
    };
    let speed = RadianPerSecond(joint.speed_limit_deg_s.to_radians() as f32);
    drives::axis(&motor, Ampere(joint.current_limit() as f32), speed, DIVIDER)
}

/// How a motor is calibrated on its stand: no more than its axis' current and what its resistance lets through at the voltage
/// allowed; that by resistance and inductance.
#[must_use]
pub fn calibration_settings(configuration: &AxisConfiguration, motor: &MotorFile) -> CalibrationSettings {
    let [usual, most] = CALIBRATION_VOLTAGE_V;
    let limit = f64::from(configuration.current_limit.0);
    let current = CALIBRATION_CURRENT_A.min(limit).min(0.7 * most / motor.resistance_ohm);
    let inductance = 1e-6 * motor.inductance_d_uh.max(motor.inductance_q_uh);
    let wave = WAVE_SHARE * current * inductance / HALF_WAVE_S;
    let voltage = (1.4 * current * motor.resistance_ohm).max(wave).clamp(usual, most);
    CalibrationSettings {
        current: Ampere(current as f32),
        voltage: Volt(voltage as f32),
        turns_per_s: CALIBRATION_TURNS_PER_S,
    }
}

/// A motor on its stand, free of its gear, that came to rest with its bridge released: the rotor began at `angle`, rad.
#[must_use]
pub fn rested(axis: &AxisDescription, supply: &SupplyDescription, angle: f64, seed: u64) -> Stand {
    let mut stand = Stand::new(axis, supply, ROTOR, angle, seed);
    // Cogging takes the rotor to a place where it rests.
    for _ in 0..REST_PERIODS {
        stand.period(&AxisCommand::RELEASED, 0.0);
    }
    stand
}

/// Calibrates a motor on its stand, the rotor at `angle` (rad); `name` is for the message where that fails.
pub fn commission(
    name: &str,
    configuration: &AxisConfiguration,
    settings: CalibrationSettings,
    axis: &AxisDescription,
    supply: &SupplyDescription,
    angle: f64,
    seed: u64,
) -> Result<Calibration, ToolError> {
    let refused = |reason: String| ToolError::input(format!("axis `{name}`: {reason}"));
    let mut stand = rested(axis, supply, angle, seed);
    let mut calibrator =
        Calibrator::new(configuration, settings).map_err(|error| refused(words::axis_error(error)))?;
    let mut command = AxisCommand::RELEASED;
    for _ in 0..LONGEST_CALIBRATION {
        match calibrator.tick(&stand.period(&command, 0.0)) {
            CalibrationStep::Running(next) => command = next,
            CalibrationStep::Done(calibration) => return Ok(calibration),
            CalibrationStep::Refused(reason) => {
                return Err(refused(words::refusal(reason)));
            }
        }
    }
    Err(refused("the calibration did not end".into()))
}

/// Axes of a board that is ready, and its chopper: motors calibrated, counts as those of the pose in which the world's leg stands.
fn ready<const N: usize>(
    believed: &LegFile,
    description: &CompleteDescription<N>,
    world: &mut World<N>,
    seed: u64,
) -> Result<([Axis; N], Chopper), ToolError> {
    let pose = world.sample();
    let samples = world.period(&[AxisCommand::RELEASED; N], 0.0);
    let mut axes = Vec::with_capacity(N);
    for (index, joint) in believed.joints.iter().enumerate().take(N) {
        let motor = joint
            .motor
            .as_ref()
            .ok_or_else(|| ToolError::input(format!("joint `{}` has no motor", joint.name)))?;
        let configuration = axis_configuration(joint, motor);
        let (name, simulated) = (&joint.name, &description.axes[index]);
        let settings = calibration_settings(&configuration, motor);
        let counts = pose.joints[index].encoder_counts;
        // The counter wraps at 16 bits, which are no whole turns of every encoder: it has to begin where the leg's does.
        let angle = TAU * f64::from(counts) / simulated.counter.counts;
        let supply = &description.supply;
        let calibration = commission(name, &configuration, settings, simulated, supply, angle, seed)?;
        let mut axis = Axis::new(&configuration, &calibration, &samples[index])
            .map_err(|error| ToolError::input(format!("axis `{name}`: {}", words::axis_error(error))))?;
        axis.set_counts(counts);
        axes.push(axis);
    }
    let chopper = Chopper::new(BRAKE[0], BRAKE[1])
        .ok_or_else(|| ToolError::input("the firmware refuses the chopper's voltages"))?;
    let axes = axes.try_into().map_err(|_| ToolError::input("a motor for every joint is needed"))?;
    // The first period was that of the reference; the rest of its servo tick passes released.
    for _ in 1..PERIODS_PER_TICK {
        world.period(&[AxisCommand::RELEASED; N], 0.0);
    }
    Ok((axes, chopper))
}

/// What the housekeeping of this leg is built from.
fn housekeeping_settings<const N: usize>(leg: &LegFile) -> Result<HousekeepingSettings<N>, ToolError> {
    let unfit = || ToolError::input("a motor for every joint is needed");
    let mut parts = Vec::with_capacity(N);
    for joint in leg.joints.iter().take(N) {
        let motor = joint.motor.as_ref().ok_or_else(unfit)?;
        let configuration = axis_configuration(joint, motor);
        parts.push((configuration, calibration_settings(&configuration, motor)));
    }
    let parts: [_; N] = parts.try_into().map_err(|_| unfit())?;
    Ok(HousekeepingSettings {
        axes: parts.map(|(axis, _)| axis),
        calibration: parts.map(|(_, calibration)| calibration),
        hottest_c: HOTTEST_C,
    })
}
