//! The ports a board provides to the firmware, and nothing else of the board.
//!
//! A leg of `N` joints is sampled once per servo tick and answered once per servo tick. Angles arrive as encoder
//! counts, torques leave as motor currents, both with the anatomical sign (flexion positive) of the joint they
//! belong to; the firmware converts to the model's angles in one place (`servo::scale`).
//!
//! Below that lies one axis: a motor with its bridge, sampled and answered once per PWM period
//! ([`CURRENT_RATE_HZ`]), raw as converter and counter give it. What is commanded after a sample acts from the beginning of the
//! next period on.

use crate::units::Ampere;

mod can;

pub use can::{Controller, Frame};

/// PWM periods per second, and so samples and commands of one axis.
pub const CURRENT_RATE_HZ: u32 = 24_000;

/// Clock of the timers that drive the bridges and trigger the shunts' converters, Hz.
pub const BRIDGE_CLOCK_HZ: u32 = 168_000_000;

/// Trigger of the shunts' converters [timer clocks after the middle of the lower zero vector, negative before it].
/// The board's timers, the modulator and the simulated plant take it from here; docs/motor.md, section 1, says why.
pub const SHUNT_TRIGGER_CLOCKS: i16 = 20;

/// Reading of one axis' converter and counter in one PWM period, at the middle of the zero vector in which all low sides
/// conduct. A board samples the shunts later by the lag of their amplifiers ([`SHUNT_TRIGGER_CLOCKS`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AxisSample {
    /// Codes of the shunt amplifiers of the phases B and C, 12 bits; half of the range is no current.
    pub shunt_codes: [u16; 2],
    /// Code of the bus voltage's divider, 12 bits.
    pub bus_code: u16,
    /// Quadrature counter of the motor's encoder, wrapping.
    pub encoder_count: u16,
    /// The counter when the index pulse came, if it came since the last sample.
    pub index_count: Option<u16>,
}

/// What one axis' bridge is told for the next PWM period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisCommand {
    /// The bridge switches; `false` releases it and the duties mean nothing.
    pub enabled: bool,
    /// Share of the period for which the high sides of A, B and C conduct, 0..=1, dead time not subtracted.
    pub duty: [f32; 3],
}

impl AxisCommand {
    /// Bridge released.
    pub const RELEASED: Self = Self { enabled: false, duty: [0.5; 3] };

    /// Low sides on all the time: the motor brakes itself through its own resistance.
    pub const BRAKE: Self = Self { enabled: true, duty: [0.0; 3] };
}

/// What one joint's sensors say at a servo tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointSample {
    /// Encoder position, counts, wrapping; zero is the reference pose.
    pub encoder_counts: i32,
    /// Measured motor current that makes torque (quadrature axis).
    pub current: Ampere,
    /// A reading since the last sample was not believed; the position is that of the others.
    pub doubtful: bool,
}

/// What all sensors of a leg say at one servo tick, proximal joint first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<const N: usize> {
    /// Proximal first.
    pub joints: [JointSample; N],
}

/// What the drives of a leg are told at one servo tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveCommand<const N: usize> {
    /// The bridges switch; `false` releases them and the currents mean nothing.
    pub enabled: bool,
    /// Target of each joint's motor current, proximal first.
    pub currents: [Ampere; N],
}

impl<const N: usize> DriveCommand<N> {
    /// Bridges released.
    pub const RELEASED: Self = Self { enabled: false, currents: [Ampere::ZERO; N] };
}

/// The joint drives of one leg as the servo sees them: one exchange per tick, never blocking.
pub trait LegDrives<const N: usize> {
    /// The newest sample of every sensor.
    fn sample(&mut self) -> Sample<N>;
    /// Hands over targets; they act until the next call.
    fn command(&mut self, command: &DriveCommand<N>);
}

/// The operator's two contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contacts {
    /// The enabling switch is held.
    pub enabling: bool,
    /// The start button is pressed.
    pub start: bool,
}

/// What only a board of `N` axes can do: registers, no decisions. Every method returns at once.
///
/// The levels of `operation` decide over this trait and over plain queues and words, so that the board and the simulated hardware
/// run the same decisions.
pub trait Hardware<const N: usize> {
    /// Runs `step` while no interrupt can come in between, the emergency stop's included. Only for a few instructions.
    fn masked(&mut self, step: impl FnOnce(&mut Self));
    /// Switches the outputs of all bridges off, now.
    fn release_all(&mut self);
    /// Switches the outputs of one bridge off, now, and sets its duties to no voltage.
    fn release(&mut self, axis: usize);
    /// Sets the duties of one bridge for its next period; its outputs stay as they are.
    fn set_duty(&mut self, axis: usize, duty: &[f32; 3]);
    /// Switches the outputs of one bridge on.
    fn enable(&mut self, axis: usize);
    /// Sets the brake resistor's share of time.
    fn set_brake(&mut self, duty: f32);
    /// Requests the servo's tick as soon as the current tick ends.
    fn pend_servo(&mut self);
    /// Requests a round of the bus as soon as the levels above it are done.
    fn pend_bus(&mut self);

    /// Reads the operator's contacts.
    fn contacts(&self) -> Contacts;
    /// Quadrature counter of an axis.
    fn encoder_count(&self, axis: usize) -> u16;
    /// Temperature of a bridge, degrees Celsius; `None` if its thermistor is open or shorted.
    fn temperature(&self, axis: usize) -> Option<f32>;
    /// Whether a gate driver still holds its configuration.
    fn gate_holds(&mut self, axis: usize) -> bool;
    /// Status registers of a gate driver, the first in the upper half; all ones if it does not answer.
    fn gate_status(&mut self, axis: usize) -> u32;
    /// Switches the supply of all gate drivers.
    fn switch_gates(&mut self, on: bool);
    /// Writes the configuration of all gate drivers; whether they hold it.
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

    /// Restarts the watchdog's time.
    fn feed_watchdog(&mut self);
    /// Asks the watchdog for the time that a flash write may take; whether it has it now.
    fn stretch_watchdog(&mut self) -> bool;
    /// Asks the watchdog for its usual time; whether it has it now.
    fn tighten_watchdog(&mut self) -> bool;
}
