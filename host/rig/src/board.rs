//! Firmware side of a complete drive: all levels of the board (`levels`) over simulated registers
//! (`registers`).
//!
//! The firmware answers the plant's readings of a PWM period in the same period; the answer acts in
//! the next. The servo's sample is the mean of the six periods since its last tick.
//!
//! A run begins with a ready drive. Every motor was calibrated on a stand, free of its gear and at rest, with
//! rotor and counter at the leg's positions. The leg's initial pose is used as the reference: with outputs
//! off, the leg would swing for the half second that `StatedPose` waits.

pub(crate) mod levels;
mod locked;
pub(crate) mod registers;

use core::f64::consts::TAU;
use std::sync::{Mutex, PoisonError};

use hal_sim::drive::description::{AxisDescription, CompleteDescription, SupplyDescription};
use hal_sim::drive::stand::{Load, Stand};
use hal_sim::world::World;
use hal_sim::world::periods::PERIODS_PER_TICK;
use scarab::board::odrive_v3_6::settings::analog::HOTTEST_C;
use scarab::board::odrive_v3_6::settings::drives;
use scarab::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ, LegDrives};
use scarab::motor::calibration::STRONG_SHARE;
use scarab::motor::{
    Axis, AxisConfiguration, Calibration, CalibrationSettings, CalibrationStep, Calibrator, Chopper, Refusal,
    SenseScale,
};
use scarab::operation::{EncoderSettings, HousekeepingSettings};
use scarab::units::{Ampere, KilogramMetreSquared, RadianPerSecond, Volt};

use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::{JointFile, LegFile, MotorFile};
use scarab_identify::leg::board_words as words;

/// Bus voltages at which the bridges may switch.
pub(crate) const BUS: [Volt; 2] = drives::bus(SenseScale::DIVIDER);
/// Bus voltages at which the brake resistor conducts.
pub const BRAKE: [Volt; 2] = drives::chopper(SenseScale::DIVIDER);

/// Largest current for the calibration of a motor on its stand.
const CALIBRATION_CURRENT_A: f64 = drives::CALIBRATION.current.0 as f64;
/// Voltage vectors of a calibration: sufficient for motors of the default leg, and less than half
/// of the lowest bus voltage.
const CALIBRATION_VOLTAGE_V: [f64; 2] = [3.0, 9.5];
/// Half-wave with which the firmware measures inductances, s, and its share of the calibration current.
const HALF_WAVE_S: f64 = 2.0 / CURRENT_RATE_HZ as f64;
const WAVE_SHARE: f64 = 0.3;
/// Load on the stand: the rotor alone, kg m^2; bearings, N m; slight drag, N m s/rad.
const ROTOR: Load = Load::Free { inertia: ROTOR_INERTIA, coulomb: 0.01, viscous: 1e-4, torque: 0.0 };
const ROTOR_INERTIA: f64 = 1e-4;
/// Rest before a calibration: half a second.
const REST_PERIODS: u32 = 12_000;
/// Limit of a calibration, periods; it takes some seconds.
pub(crate) const LONGEST_CALIBRATION: u64 = 60 * CURRENT_RATE_HZ as u64;

/// Configuration of a joint's axis, derived from the leg file by the board's settings.
pub fn axis_configuration(joint: &JointFile, motor: &MotorFile) -> AxisConfiguration {
    let speed = RadianPerSecond(joint.speed_limit_deg_s.to_radians() as f32);
    drives::axis(&motor.for_firmware(joint), Ampere(joint.current_limit() as f32), speed, SenseScale::DIVIDER)
}

/// Calibration settings of a motor on its stand. The current is limited by the axis and by the resistance at
/// the permitted voltage; the voltage follows from resistance and inductance.
pub fn calibration_settings(configuration: &AxisConfiguration, motor: &MotorFile) -> CalibrationSettings {
    let [usual, most] = CALIBRATION_VOLTAGE_V;
    let limit = f64::from(configuration.current_limit.0 / STRONG_SHARE);
    let current = CALIBRATION_CURRENT_A.min(limit).min(0.7 * most / motor.resistance_ohm);
    let inductance = 1e-6 * motor.inductance_d_uh.max(motor.inductance_q_uh);
    let wave = WAVE_SHARE * current * inductance / HALF_WAVE_S;
    let voltage = (1.7 * current * motor.resistance_ohm).max(wave).clamp(usual, most);
    CalibrationSettings {
        current: Ampere(current as f32),
        voltage: Volt(voltage as f32),
        inertia: KilogramMetreSquared(ROTOR_INERTIA as f32),
        travel_turns: motor.calibration_turns(),
        ..drives::CALIBRATION
    }
}

/// Motor on its stand, free of its gear, at rest with outputs off; the rotor started at `angle`, rad.
pub(crate) fn rested(axis: &AxisDescription, supply: &SupplyDescription, angle: f64, seed: u64) -> Stand {
    let mut stand = Stand::new(axis, supply, ROTOR, angle, seed);
    // Cogging moves the rotor to a rest position.
    for _ in 0..REST_PERIODS {
        stand.period(&AxisCommand::OFF, 0.0);
    }
    stand
}

/// Runs a calibration with `sample`, the readings of a period under the command of the period before. Returns
/// the period of its end and the result; `None` if it does not end in time.
pub(crate) fn run_calibration(
    calibrator: &mut Calibrator,
    mut sample: impl FnMut(u64, &AxisCommand) -> AxisSample,
) -> Option<(u64, Result<Calibration, Refusal>)> {
    let mut command = AxisCommand::OFF;
    for period in 0..LONGEST_CALIBRATION {
        match calibrator.tick(&sample(period, &command)) {
            CalibrationStep::Running(next) => command = next,
            CalibrationStep::Done(calibration) => return Some((period, Ok(calibration))),
            CalibrationStep::Refused(reason) => return Some((period, Err(reason))),
        }
    }
    None
}

/// Calibrates a motor on its stand with the rotor at `angle` (rad); `name` is used in error messages.
pub(crate) fn commission(
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
    match run_calibration(&mut calibrator, |_, command| stand.period(command, 0.0)) {
        Some((_, result)) => result.map_err(|reason| refused(words::refusal(reason))),
        None => Err(refused("the calibration did not end in time".into())),
    }
}

/// Everything that a calibration depends on, in the order of [`commission`].
type Motor = (AxisConfiguration, CalibrationSettings, AxisDescription, SupplyDescription, f64, u64);

/// Calibrations that are remembered.
const REMEMBERED: usize = 16;

/// Calibrates as [`commission`] does. Boards with equal motors share one calibration, which costs as much as
/// several seconds of their leg.
fn commission_once(name: &str, motor: Motor) -> Result<Calibration, ToolError> {
    static KNOWN: Mutex<Vec<(Motor, Calibration)>> = Mutex::new(Vec::new());
    let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let found = known().iter().find(|(other, _)| *other == motor).map(|(_, calibration)| *calibration);
    if let Some(calibration) = found {
        return Ok(calibration);
    }
    let (configuration, settings, axis, supply, angle, seed) = &motor;
    let calibration = commission(name, configuration, *settings, axis, supply, *angle, *seed)?;
    let mut known = known();
    if known.len() == REMEMBERED {
        known.remove(0);
    }
    known.push((motor, calibration));
    Ok(calibration)
}

/// Axes and chopper of a ready board: motors calibrated, counters at the initial pose of the simulated leg.
fn ready<const N: usize>(
    believed: &LegFile,
    description: &CompleteDescription<N>,
    world: &mut World<N>,
    seed: u64,
) -> Result<([Axis; N], Chopper), ToolError> {
    let pose = world.sample();
    let samples = world.period(&[AxisCommand::OFF; N], 0.0);
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
        // The counter wraps at 16 bits, not at whole turns of every encoder: it must start at the
        // leg's count.
        let angle = TAU * f64::from(counts) / simulated.counter.counts;
        let supply = description.supply;
        let calibration = commission_once(name, (configuration, settings, *simulated, supply, angle, seed))?;
        let mut axis = Axis::new(&configuration, &calibration, &samples[index])
            .map_err(|error| ToolError::input(format!("axis `{name}`: {}", words::axis_error(error))))?;
        axis.set_counts(counts);
        axes.push(axis);
    }
    let chopper = Chopper::new(BRAKE[0], BRAKE[1])
        .ok_or_else(|| ToolError::input("the firmware rejects the chopper's voltages"))?;
    let axes =
        axes.try_into().map_err(|_| ToolError::input("every joint needs a motor (`[joint.motor]`)"))?;
    // The first period took the reference; outputs stay off for the rest of its servo tick.
    for _ in 1..PERIODS_PER_TICK {
        world.period(&[AxisCommand::OFF; N], 0.0);
    }
    Ok((axes, chopper))
}

/// Settings of the housekeeping for this leg.
fn housekeeping_settings<const N: usize>(leg: &LegFile) -> Result<HousekeepingSettings<N>, ToolError> {
    let unfit = || ToolError::input("every joint needs a motor (`[joint.motor]`)");
    let mut parts = Vec::with_capacity(N);
    for joint in leg.joints.iter().take(N) {
        let motor = joint.motor.as_ref().ok_or_else(unfit)?;
        let configuration = axis_configuration(joint, motor);
        // These motors carry gear and leg.
        let inertia = drives::CALIBRATION.inertia;
        let settings = CalibrationSettings { inertia, ..calibration_settings(&configuration, motor) };
        let encoders = EncoderSettings::new(&motor.for_firmware(joint));
        let thermistor = motor.thermistor.map(|fitted| fitted.for_firmware());
        parts.push((configuration, settings, motor.winding(), thermistor, encoders));
    }
    let parts: [_; N] = parts.try_into().map_err(|_| unfit())?;
    Ok(HousekeepingSettings {
        axes: parts.map(|(axis, ..)| axis),
        calibration: parts.map(|(_, calibration, ..)| calibration),
        hottest_c: HOTTEST_C,
        windings: parts.map(|(.., winding, _, _)| winding),
        thermistors: parts.map(|(.., thermistor, _)| thermistor),
        encoders: parts.map(|(.., encoders)| encoders),
        assist: leg.assist.map(|assist| assist.shares()),
    })
}
