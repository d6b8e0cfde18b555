//! The ports a board provides to the firmware, and nothing else of the board.
//!
//! A leg of `N` joints is sampled once per servo tick and answered once per servo tick. Angles arrive as encoder
//! counts, torques leave as motor currents, both with the anatomical sign (flexion positive) of the joint they
//! belong to; the firmware converts to the model's angles in one place (`servo::scale`).

use crate::units::Ampere;

/// What one joint's sensors say at a servo tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointSample {
    /// Encoder position, counts, wrapping; zero is the reference pose.
    pub encoder_counts: i32,
    /// Measured motor current that makes torque (quadrature axis).
    pub current: Ampere,
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
