//! Axis configurations of a leg on this board, and limits for their motors.
//!
//! Check these numbers before the first power-on of another machine (docs/board.md). The calibration measures
//! what it can, and refuses contradictions.

use super::analog;
use crate::leg::{DeratingRamps, LegDescription, MotorDescription};
use crate::motor::calibration::ALIGNMENT_TURNS;
use crate::motor::{AxisConfiguration, BridgeTiming, CalibrationSettings, DeadTime, Direction};
use crate::real::max;
use crate::units::{Ampere, Hertz, KilogramMetreSquared, RadianPerSecond, Volt};

/// Bandwidth of the current loops.
pub const BANDWIDTH: Hertz = Hertz(1000.0);
/// Half width of the band in which the dead-time compensation changes its sign.
pub const DEAD_TIME_BAND: Ampere = Ampere(2.0);
/// Length of the current vector above which the bridges turn off: the shunts' range less their offsets.
pub const OVERCURRENT: Ampere = Ampere(61.0);
/// Bus-voltage range in which the bridges may switch, on boards of 56 V and of 24 V.
pub const BUS: [[Volt; 2]; 2] = [[Volt(20.0), Volt(58.0)], [Volt(12.0), Volt(25.7)]];
/// Bus voltages at which a brake resistor begins to conduct and reaches its greatest duty; boards as above.
pub const CHOPPER: [[Volt; 2]; 2] = [[Volt(50.0), Volt(54.0)], [Volt(25.0), Volt(25.5)]];
/// Greatest plausible speed of a counter, relative to the joint's limit.
pub const SPEED_MARGIN: f32 = 2.0;
/// Current, voltage, speed and travel of a calibration. The inertia lies between those of the default leg's
/// hip (2.1e-3) and knee (0.9e-3); the image takes each joint's own ([`calibrations`]).
pub const CALIBRATION: CalibrationSettings = CalibrationSettings {
    current: Ampere(15.0),
    voltage: Volt(3.0),
    turns_per_s: 6.0,
    travel_turns: 1.25,
    inertia: KilogramMetreSquared(1e-3),
};

/// Index of the board's variant in the tables above, by its divider.
const fn is_low(divider: f32) -> usize {
    if divider < 15.0 { 1 } else { 0 }
}

/// Voltage range of the brake resistor on a board with this bus-voltage divider.
pub const fn chopper(divider: f32) -> [Volt; 2] {
    CHOPPER[is_low(divider)]
}

/// Bus-voltage range of the bridges on a board with this divider.
pub const fn bus(divider: f32) -> [Volt; 2] {
    BUS[is_low(divider)]
}

/// Ramps that reduce torque on a board with this bus-voltage divider. They cover the last 20 degrees of a
/// bridge, and the bus voltage below 1.2 of its lower limit. A third one lies between the chopper's end and
/// the upper limit.
pub const fn derating(divider: f32) -> DeratingRamps {
    let ([low, high], [_, full]) = (bus(divider), chopper(divider));
    let above = high.0 - full.0;
    DeratingRamps::new(
        [analog::HOTTEST_C - 20.0, analog::HOTTEST_C],
        [Volt(1.2 * low.0), Volt(1.05 * low.0)],
        [Volt(full.0 + 0.25 * above), Volt(high.0 - 0.1 * above)],
    )
}

/// Configuration of an axis that drives this motor, up to a joint's current and speed, on a board with this
/// bus-voltage divider. A mirrored drive is handled in the servo (`servo::JointScale`).
pub fn axis(
    motor: &MotorDescription,
    current: Ampere,
    speed: RadianPerSecond,
    divider: f32,
) -> AxisConfiguration {
    AxisConfiguration {
        sense: analog::sense(divider),
        timing: BridgeTiming::ODRIVE_3_6,
        dead_time: DeadTime::Compensated { band: DEAD_TIME_BAND },
        pole_pairs: motor.pole_pairs,
        flux: motor.flux,
        counts_per_turn: motor.counts_per_turn,
        index: !motor.absolute.rotor,
        absolute: motor.absolute.rotor,
        counter: Direction::Up,
        flexion: Direction::Up,
        bandwidth: BANDWIDTH,
        feedforward: true,
        current_limit: current,
        overcurrent: OVERCURRENT,
        bus: bus(divider),
        greatest_speed: RadianPerSecond(SPEED_MARGIN * motor.ratio * speed.0),
    }
}

/// Least travel of a calibration that passes the index, motor turns.
pub fn least_travel_turns(pole_pairs: u8) -> f32 {
    1.01 + ALIGNMENT_TURNS / f32::from(pole_pairs.max(1))
}

/// Travel of a calibration where the leg file states none, motor turns: 1.25, and more where few pole pairs
/// would miss the index.
pub fn usual_travel_turns(pole_pairs: u8) -> f32 {
    max(CALIBRATION.travel_turns, least_travel_turns(pole_pairs))
}

/// Calibrations of a leg's motors in place: the inertia is the largest that the joint moves, seen at the
/// rotor.
pub fn calibrations<const N: usize>(leg: &LegDescription<N>) -> [CalibrationSettings; N] {
    leg.joints.map(|joint| CalibrationSettings {
        inertia: KilogramMetreSquared(joint.inertia.0 / (joint.motor.ratio * joint.motor.ratio)),
        travel_turns: joint.motor.calibration_turns,
        ..CALIBRATION
    })
}

/// Configurations of all axes of a leg.
pub fn axes<const N: usize>(leg: &LegDescription<N>, divider: f32) -> [AxisConfiguration; N] {
    leg.joints.map(|joint| axis(&joint.motor, joint.current, joint.speed, divider))
}
