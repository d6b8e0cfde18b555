//! The drive profile (CiA 402) of one joint, and the seam to the leg.
//!
//! Why values only: the node runs with the bus, the leg in an interrupt. What crosses is one status and one command per
//! joint and at most one power request per leg, copied once per tick in each direction; neither side calls the other.
//!
//! ```text
//!   host -- 6040, 6060, 607A, ... --> Axis --command(): AxisCommand--> leg
//!   host <-- 6041, 6064, 6077, ... -- Axis <--update(AxisStatus)------ leg
//!                      both Axis --Coupling--> PowerRequest ---------> leg
//! ```
//!
//! What the leg must offer for that: docs/bus.md. Units of the objects: micro-radian, micro-radian per second, thousandths
//! of the rated torque (6076, mN m); flexion is positive.

mod control;
mod coupling;
mod objects;
mod status;

pub use control::{Axis, AxisConstants};
pub use coupling::Coupling;
pub use status::AxisStatus;

use crate::units::{NewtonMetre, Radian, RadianPerSecond, RadianPerSecondSquared, Second};

/// How a joint is told to move (6060).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub enum Mode {
    /// To a position, along a profile.
    ProfilePosition = 1,
    /// At a velocity, along a profile.
    ProfileVelocity = 3,
    /// With a torque, along a slope.
    ProfileTorque = 4,
    /// Find the zero.
    Homing = 6,
    /// A position per cycle.
    CyclicPosition = 8,
    /// A velocity per cycle.
    CyclicVelocity = 9,
    /// A torque per cycle.
    CyclicTorque = 10,
}

impl Mode {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::ProfilePosition,
        Self::ProfileVelocity,
        Self::ProfileTorque,
        Self::Homing,
        Self::CyclicPosition,
        Self::CyclicVelocity,
        Self::CyclicTorque,
    ];

    /// Its bit in 6502.
    #[must_use]
    pub const fn bit(self) -> u32 {
        1 << (self as i8 - 1)
    }

    fn of(number: i8) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| *mode as i8 == number)
    }
}

/// A position that was asked for in [`Mode::ProfilePosition`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SetPoint {
    /// Grows with every new one, wrapping: another number than before, or than when the leg was enabled, is a new set-point.
    pub number: u8,
    /// Where to.
    pub position: Radian,
    /// From where it is commanded to be.
    pub relative: bool,
    /// Does not wait for the end of the one before.
    pub immediately: bool,
}

/// What a joint is to do; angles and torques with the anatomical sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// No mode: stays where it is.
    Hold,
    /// Along a profile to the newest set-point, if there is one.
    ProfilePosition(SetPoint),
    /// Along a profile to a velocity.
    ProfileVelocity(RadianPerSecond),
    /// Along a slope to a torque.
    ProfileTorque(NewtonMetre),
    /// Take the place where it stands for its zero, where `start` is another number than before.
    Homing {
        /// Grows with every start, wrapping.
        start: u8,
        /// What that place is from then on.
        offset: Radian,
    },
    /// Interpolated over the period.
    CyclicPosition {
        /// Where to be at the period's end.
        position: Radian,
        /// Added to the commanded velocity.
        velocity_offset: RadianPerSecond,
        /// Added to the commanded torque.
        torque_offset: NewtonMetre,
    },
    /// Interpolated over the period.
    CyclicVelocity {
        /// How fast to be at the period's end.
        velocity: RadianPerSecond,
        /// Added to the commanded torque.
        torque_offset: NewtonMetre,
    },
    /// As it is.
    CyclicTorque(NewtonMetre),
}

/// What the leg is told about one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisCommand {
    /// What to do.
    pub target: Target,
    /// Slow down along the profile and hold (bit 8).
    pub halt: bool,
    /// Of profiles.
    pub velocity: RadianPerSecond,
    /// Of profiles.
    pub acceleration: RadianPerSecondSquared,
    /// Of profiles.
    pub deceleration: RadianPerSecondSquared,
    /// Of [`Target::ProfileTorque`], N m per second.
    pub torque_slope_nm_per_s: f32,
    /// Software limits, lowest and highest; the leg's own are kept besides.
    pub range: [Radian; 2],
    /// On top of the leg's own.
    pub largest_torque: NewtonMetre,
    /// Farther from where it is commanded to be for longer than [`Self::following_time`] is a fault (8611).
    pub following_window: Radian,
    /// See there.
    pub following_time: Second,
    /// Nearer to the target than this for [`Self::position_time`] is reached.
    pub position_window: Radian,
    /// See there.
    pub position_time: Second,
    /// Between two targets of the cyclic modes.
    pub period: Second,
}

#[cfg(test)]
mod tests;
