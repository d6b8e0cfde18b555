//! Ports that a board provides to the firmware.
//!
//! A leg of `N` joints is sampled once and commanded once per servo tick. Angles arrive as encoder counts,
//! torques leave as motor currents, both with the anatomical sign (flexion positive) of their joint. The
//! firmware converts to the model's angles only in `servo::scale`.
//!
//! The level below is one axis: a motor with its bridge, sampled and commanded once per PWM period
//! ([`CURRENT_RATE_HZ`]), in raw codes and counts. A command computed from a sample acts from the beginning
//! of the next period on.

use crate::units::Ampere;

mod can;
mod program;

pub use can::{Controller, Frame};
pub use program::ProgramMemory;

/// PWM periods per second; also the rate of samples and commands of one axis.
pub const CURRENT_RATE_HZ: u32 = 24_000;

/// Servo ticks per second.
pub const SERVO_RATE_HZ: u32 = 4000;

/// Clock of the timers that drive the bridges and trigger the shunts' converters, Hz.
pub const BRIDGE_CLOCK_HZ: u32 = 168_000_000;

/// Trigger of the shunts' converters, timer clocks after the middle of the lower zero vector; negative values
/// lie before it. The board's timers, the modulator and the simulated plant use this value. Reasons:
/// docs/motor.md, section 1.
pub const SHUNT_TRIGGER_CLOCKS: i16 = 20;

/// Greatest duty of the brake resistor, as in ODrive's firmware.
pub const GREATEST_BRAKE_DUTY: f32 = 0.95;

/// Readings of one axis' converter and counter in one PWM period, at the middle of the zero
/// vector in which all low sides conduct. A board samples the shunts later by the lag of
/// their amplifiers ([`SHUNT_TRIGGER_CLOCKS`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AxisSample {
    /// Codes of the shunt amplifiers of the phases B and C, 12 bits; half of the range is zero current.
    pub shunt_codes: [u16; 2],
    /// Code of the bus voltage's divider, 12 bits.
    pub bus_code: u16,
    /// Quadrature counter of the motor's encoder, wrapping.
    pub encoder_count: u16,
    /// Counter at the index pulse, if one came since the last sample.
    pub index_count: Option<u16>,
}

/// Command to one axis' bridge for the next PWM period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisCommand {
    /// Whether the bridge switches. With `false` the outputs are off and the duties are ignored.
    pub enabled: bool,
    /// Share of the period for which the high sides of A, B and C conduct, 0..=1, dead time not subtracted.
    pub duty: [f32; 3],
}

impl AxisCommand {
    /// Outputs off.
    pub const OFF: Self = Self { enabled: false, duty: [0.5; 3] };

    /// Low sides on all the time: the motor brakes passively through its own resistance.
    pub const BRAKE: Self = Self { enabled: true, duty: [0.0; 3] };
}

/// Sensor readings of one joint at a servo tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointSample {
    /// Encoder position, counts, wrapping; zero is the reference pose.
    pub encoder_counts: i32,
    /// Measured motor current that makes torque (quadrature axis).
    pub current: Ampere,
    /// Whether a reading since the last sample was implausible; the position then comes from the others.
    pub doubtful: bool,
}

/// Sensor readings of a leg at one servo tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<const N: usize> {
    /// Joints, proximal first.
    pub joints: [JointSample; N],
}

/// Command to the drives of a leg at one servo tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveCommand<const N: usize> {
    /// Whether the bridges switch. With `false` the outputs are off and the currents are ignored.
    pub enabled: bool,
    /// Target of each joint's motor current, proximal first.
    pub currents: [Ampere; N],
}

impl<const N: usize> DriveCommand<N> {
    /// Outputs off.
    pub const OFF: Self = Self { enabled: false, currents: [Ampere::ZERO; N] };
}

/// Joint drives of one leg at the servo's level: one exchange per tick, never blocking.
pub trait LegDrives<const N: usize> {
    /// Returns the newest sample of every sensor.
    fn sample(&mut self) -> Sample<N>;
    /// Sets the targets; they act until the next call.
    fn command(&mut self, command: &DriveCommand<N>);
}

/// State of the operator's two contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contacts {
    /// Whether the enabling switch is held.
    pub enabling: bool,
    /// Whether the start button is pressed.
    pub start: bool,
}

/// Side of the gear at which an absolute encoder is mounted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AbsoluteEncoderSide {
    /// At the rotor.
    Rotor,
    /// At the joint.
    Joint,
}

/// Register access of a board of `N` axes, without decisions. Every method returns at once.
///
/// The levels of `operation` decide, on this trait and on plain queues and words. So the board and the
/// simulated hardware run the same decisions.
pub trait Hardware<const N: usize> {
    /// Runs `step` with all interrupts masked, the emergency stop's included. Only for a few instructions.
    fn masked(&mut self, step: impl FnOnce(&mut Self));
    /// Switches the outputs of all bridges off at once.
    fn disable_all(&mut self);
    /// Switches the outputs of one bridge off at once, and sets its duties to no voltage.
    fn disable(&mut self, axis: usize);
    /// Sets the duties of one bridge for its next period; its outputs stay as they are.
    fn set_duty(&mut self, axis: usize, duty: &[f32; 3]);
    /// Switches the outputs of one bridge on.
    fn enable(&mut self, axis: usize);
    /// Sets the brake resistor's duty.
    fn set_brake(&mut self, duty: f32);
    /// Releases or engages the holding brake; [`Self::disable_all`] engages it too.
    fn set_holding_brake(&mut self, released: bool);
    /// Switches the status light, if there is one.
    fn set_status_light(&mut self, is_lit: bool);
    /// Requests the servo's tick, to run as soon as the current tick ends.
    fn pend_servo(&mut self);
    /// Requests a round of the bus, to run as soon as the levels above it are done.
    fn pend_bus(&mut self);
    /// Requests a run of the assistance, like one of the bus.
    fn pend_assist(&mut self);

    /// Reads the operator's contacts.
    fn contacts(&self) -> Contacts;
    /// Quadrature counter of an axis.
    fn encoder_count(&self, axis: usize) -> u16;
    /// Frame with the angle of an absolute encoder; all ones without one.
    fn encoder_frame(&mut self, axis: usize, side: AbsoluteEncoderSide) -> u16;
    /// Temperature of a bridge, degrees Celsius; `None` if its thermistor is open or shorted.
    fn temperature(&self, axis: usize) -> Option<f32>;
    /// Starts a conversion of the thermistor in an axis' motor.
    fn convert_thermistor(&mut self, axis: usize);
    /// Code of the conversion that was started last, of 12 bits; `None` if it has not ended.
    fn thermistor_code(&mut self) -> Option<u16>;
    /// Whether a gate driver still holds its configuration.
    fn gate_holds(&mut self, axis: usize) -> bool;
    /// Status registers of a gate driver, the first in the upper half; all ones if it does not answer.
    fn gate_status(&mut self, axis: usize) -> u32;
    /// Switches the supply of all gate drivers.
    fn switch_gates(&mut self, on: bool);
    /// Writes the configuration of all gate drivers; returns whether they hold it.
    fn configure_gates(&mut self) -> bool;

    /// Time since the start, microseconds.
    fn now_us(&self) -> u64;
    /// State of the bus controller; a lost frame is reported once.
    fn controller(&mut self) -> Controller;
    /// Transmit mailboxes in which a frame waits, one bit each.
    fn mailboxes_waiting(&self) -> u32;
    /// Puts a frame into an empty mailbox.
    fn send(&mut self, mailbox: u32, frame: &Frame);
    /// Aborts the transmission of every frame that waits.
    fn abort_transmission(&mut self);

    /// Whether the processor's supply is too low to change the flash.
    fn processor_supply_is_low(&self) -> bool;
    /// Restarts the watchdog's count.
    fn feed_watchdog(&mut self);
    /// Requests the watchdog's time for a flash write; returns whether it applies now.
    fn stretch_watchdog(&mut self) -> bool;
    /// Requests the watchdog's normal time; returns whether it applies now.
    fn tighten_watchdog(&mut self) -> bool;
}
