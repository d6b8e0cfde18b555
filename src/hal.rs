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

/// PWM periods per second, and so samples and commands of one axis.
pub const CURRENT_RATE_HZ: u32 = 24_000;

/// Clock of the timers that drive the bridges and trigger the shunts' converters [Hz].
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
