//! The axes of a leg on this board, and what may be done to their motors: the numbers to check before the first power-on of
//! another machine (docs/board.md). What can be measured is measured by the calibration, and refused where it contradicts.

use super::analog;
use crate::leg::{DeratingRamps, LegDescription, MotorDescription};
use crate::motor::{AxisConfiguration, BridgeTiming, CalibrationSettings, DeadTime, Direction, Sine};
use crate::units::{Ampere, Hertz, RadianPerSecond, Volt};

/// Of the current loops.
pub const BANDWIDTH: Hertz = Hertz(1000.0);
/// Current within which the dead time is given back smoothly.
pub const DEAD_TIME_BAND: Ampere = Ampere(2.0);
/// Length of the current vector at which the bridges are released: what the shunts can tell, less their zeros.
pub const OVERCURRENT: Ampere = Ampere(61.0);
/// Within which the bridges may switch, on a board of 56 V and on one of 24 V.
pub const BUS: [[Volt; 2]; 2] = [[Volt(20.0), Volt(58.0)], [Volt(12.0), Volt(25.7)]];
/// Where a brake resistor begins to conduct, and where it does all the time it may; the same boards.
pub const CHOPPER: [[Volt; 2]; 2] = [[Volt(50.0), Volt(54.0)], [Volt(25.0), Volt(25.5)]];
/// Faster than the joint's limit by this a counter is not believed.
pub const SPEED_MARGIN: f32 = 2.0;
/// What a calibration may do to a motor.
pub const CALIBRATION: CalibrationSettings =
    CalibrationSettings { current: Ampere(15.0), voltage: Volt(3.0), turns_per_s: 10.0 };

/// Which of two voltages a board with this divider is for.
const fn is_low(divider: f32) -> usize {
    if divider < 15.0 { 1 } else { 0 }
}

/// Where the brake resistor conducts on a board with this divider of the bus voltage.
#[must_use]
pub const fn chopper(divider: f32) -> [Volt; 2] {
    CHOPPER[is_low(divider)]
}

/// Within which the bridges may switch on a board with this divider of the bus voltage.
#[must_use]
pub const fn bus(divider: f32) -> [Volt; 2] {
    BUS[is_low(divider)]
}

/// Where torque is given less and less of, on a board with this divider of the bus voltage: over the last 20 degrees of a bridge, from
/// a fifth above the lowest bus on, and between the chopper's end and the highest bus.
#[must_use]
pub const fn derating(divider: f32) -> DeratingRamps {
    let ([low, high], [_, full]) = (bus(divider), chopper(divider));
    let above = high.0 - full.0;
    DeratingRamps::new(
        [analog::HOTTEST_C - 20.0, analog::HOTTEST_C],
        [Volt(1.2 * low.0), Volt(1.05 * low.0)],
        [Volt(full.0 + 0.25 * above), Volt(high.0 - 0.1 * above)],
    )
}

/// The configuration of an axis that drives this motor, up to a joint's current and speed, on a board with this divider of the bus
/// voltage. A mirrored drive is the servo's affair (`servo::JointScale`).
#[must_use]
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
        index: true,
        counter: Direction::Up,
        flexion: Direction::Up,
        bandwidth: BANDWIDTH,
        feedforward: true,
        sine: Sine::default(),
        current_limit: current,
        overcurrent: OVERCURRENT,
        bus: bus(divider),
        greatest_speed: RadianPerSecond(SPEED_MARGIN * motor.ratio * speed.0),
    }
}

/// The configuration of every axis of a leg.
#[must_use]
pub fn axes<const N: usize>(leg: &LegDescription<N>, divider: f32) -> [AxisConfiguration; N] {
    leg.joints.map(|joint| axis(&joint.motor, joint.current, joint.speed, divider))
}
