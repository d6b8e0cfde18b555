//! What a host tells each joint, and what it is told about it: values only, anatomical, flexion positive.
//!
//! The numbers of the modes and what they mean are CiA 402's; its units stay with the bus.

use crate::safety::DriveState;
use crate::units::{NewtonMetre, Radian, RadianPerSecond, RadianPerSecondSquared, Second, Volt};

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

    /// The mode of this number.
    #[must_use]
    pub fn of(number: i8) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| *mode as i8 == number)
    }
}

/// A position that was asked for in [`Mode::ProfilePosition`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SetPoint {
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
    /// Take the place where it stands for its zero, once for each that is asked for.
    Homing {
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

impl Target {
    /// The mode it belongs to.
    #[must_use]
    pub const fn mode(&self) -> Option<Mode> {
        Some(match self {
            Self::Hold => return None,
            Self::ProfilePosition(_) => Mode::ProfilePosition,
            Self::ProfileVelocity(_) => Mode::ProfileVelocity,
            Self::ProfileTorque(_) => Mode::ProfileTorque,
            Self::Homing { .. } => Mode::Homing,
            Self::CyclicPosition { .. } => Mode::CyclicPosition,
            Self::CyclicVelocity { .. } => Mode::CyclicVelocity,
            Self::CyclicTorque(_) => Mode::CyclicTorque,
        })
    }
}

/// What the leg is told about one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCommand {
    /// What to do.
    pub target: Target,
    /// Grows with every set-point and every start of homing, wrapping: another number than before is a new one, but none that
    /// was asked before the leg was enabled.
    pub asked: u8,
    /// An accepted model feeds forward, where all joints ask for it.
    pub feedforward: bool,
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

/// One joint at one tick; angles and torques with the anatomical sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointStatus {
    /// Where the leg's drive stands.
    pub drive: DriveState,
    /// Measured.
    pub position: Radian,
    /// Measured.
    pub velocity: RadianPerSecond,
    /// Measured: of the motor's current.
    pub torque: NewtonMetre,
    /// Commanded after profile and interpolation.
    pub position_demand: Radian,
    /// Commanded after profile and interpolation.
    pub velocity_demand: RadianPerSecond,
    /// Commanded, as it was let through.
    pub torque_demand: NewtonMetre,
    /// The mode the leg is in (6061); 0 is none.
    pub mode: i8,
    /// The target of that mode is reached, or the joint stands after a halt.
    pub reached: bool,
    /// Less is commanded than was asked for.
    pub limited: bool,
    /// Homing has been done.
    pub homed: bool,
    /// The following error is too large, or the target is out of reach; of homing: it failed.
    pub deviates: bool,
    /// Digital inputs, CiA 402's bits.
    pub inputs: u32,
    /// Of the supply.
    pub bus: Volt,
}

impl JointStatus {
    /// Before the leg's first tick.
    pub const NONE: Self = Self {
        drive: DriveState::NotReadyToSwitchOn,
        position: Radian::ZERO,
        velocity: RadianPerSecond::ZERO,
        torque: NewtonMetre::ZERO,
        position_demand: Radian::ZERO,
        velocity_demand: RadianPerSecond::ZERO,
        torque_demand: NewtonMetre::ZERO,
        mode: 0,
        reached: false,
        limited: false,
        homed: false,
        deviates: false,
        inputs: 0,
        bus: Volt::ZERO,
    };
}
