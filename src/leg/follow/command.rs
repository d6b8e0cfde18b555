//! Commands of a host to each joint, and the joint's status: plain values, anatomical, flexion positive.
//!
//! Modes and their numbers follow CiA 402; the units of the objects are converted in `bus`.

use crate::safety::DriveState;
use crate::units::{NewtonMetre, Radian, RadianPerSecond, RadianPerSecondSquared, Second, Volt};

/// Mode of operation (6060).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i8)]
pub enum Mode {
    /// Moves to a position along a profile.
    ProfilePosition = 1,
    /// Moves at a velocity along a profile.
    ProfileVelocity = 3,
    /// Applies a torque along a slope.
    ProfileTorque = 4,
    /// Sets the zero.
    Homing = 6,
    /// Follows a position per cycle.
    CyclicPosition = 8,
    /// Follows a velocity per cycle.
    CyclicVelocity = 9,
    /// Applies a torque per cycle.
    CyclicTorque = 10,
    /// Acts as a spring and a damper around a moving position; manufacturer-specific.
    Impedance = -1,
}

impl Mode {
    /// All modes.
    pub const ALL: [Self; 8] = [
        Self::ProfilePosition,
        Self::ProfileVelocity,
        Self::ProfileTorque,
        Self::Homing,
        Self::CyclicPosition,
        Self::CyclicVelocity,
        Self::CyclicTorque,
        Self::Impedance,
    ];

    /// Bit of the mode in 6502; manufacturer-specific modes begin at bit 16.
    pub const fn bit(self) -> u32 {
        let number = self as i8;
        1 << if number > 0 { number - 1 } else { 15 - number }
    }

    /// Returns the mode with this number.
    pub(crate) fn from_number(number: i8) -> Option<Self> {
        Self::ALL.into_iter().find(|mode| *mode as i8 == number)
    }
}

/// Longest period of cyclic targets: the largest value of 60C2:1 in milliseconds.
pub(crate) const LONGEST_PERIOD: Second = Second(0.255);

/// What a relative set-point is relative to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// The set-point before it; without one the commanded position.
    Target,
    /// The commanded position.
    Demand,
    /// The measured position.
    Actual,
}

/// Set-point of [`Mode::ProfilePosition`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SetPoint {
    /// Target position, absolute or relative.
    pub position: Radian,
    /// What the position is relative to; `None` for an absolute one.
    pub relative_to: Option<Reference>,
    /// Whether it replaces the active set-point at once.
    pub immediately: bool,
}

/// Target of a joint; angles and torques with the anatomical sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// No mode: the joint holds its position.
    Hold,
    /// Moves along a profile to the newest set-point, if there is one.
    ProfilePosition(SetPoint),
    /// Moves along a profile to a velocity.
    ProfileVelocity(RadianPerSecond),
    /// Follows a slope to a torque.
    ProfileTorque(NewtonMetre),
    /// Sets the present position to an offset, once per start of homing.
    Homing {
        /// Angle assigned to the present position.
        offset: Radian,
    },
    /// Position, interpolated over the period.
    CyclicPosition {
        /// Position at the end of the period.
        position: Radian,
        /// Added to the commanded velocity.
        velocity_offset: RadianPerSecond,
        /// Added to the commanded torque.
        torque_offset: NewtonMetre,
    },
    /// Velocity, interpolated over the period.
    CyclicVelocity {
        /// Velocity at the end of the period.
        velocity: RadianPerSecond,
        /// Added to the commanded torque.
        torque_offset: NewtonMetre,
    },
    /// Torque, without interpolation.
    CyclicTorque(NewtonMetre),
    /// Spring and damper, without interpolation.
    Impedance(ImpedanceTarget),
}

/// Target of [`Mode::Impedance`]: torque = K (position - q) + D (velocity - q') + torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImpedanceTarget {
    /// Position at which the spring gives no torque.
    pub position: Radian,
    /// Velocity at which the damper gives no torque.
    pub velocity: RadianPerSecond,
    /// Stiffness K, N m/rad.
    pub stiffness: f32,
    /// Damping D, N m s/rad.
    pub damping: f32,
    /// Torque added to spring and damper.
    pub torque: NewtonMetre,
}

impl Target {
    /// Mode of the target; `None` for [`Target::Hold`].
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
            Self::Impedance(_) => Mode::Impedance,
        })
    }
}

/// Command for one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointCommand {
    /// Target of the joint.
    pub target: Target,
    /// Counter of set-points and homing starts, wrapping. A changed value is a new request, unless it was
    /// made before the leg was enabled.
    pub request_count: u8,
    /// Uses an accepted model as feedforward, if all joints request it.
    pub feedforward: bool,
    /// Slows down along the profile and holds (bit 8).
    pub halt: bool,
    /// Profile velocity.
    pub velocity: RadianPerSecond,
    /// Profile acceleration.
    pub acceleration: RadianPerSecondSquared,
    /// Profile deceleration.
    pub deceleration: RadianPerSecondSquared,
    /// Slope of [`Target::ProfileTorque`], N m/s.
    pub torque_slope_nm_per_s: f32,
    /// A profile velocity is reached after [`Self::velocity_time`] within this distance.
    pub velocity_window: RadianPerSecond,
    /// Time within the velocity window.
    pub velocity_time: Second,
    /// The joint stands after [`Self::standing_time`] at no more than this speed.
    pub standing_speed: RadianPerSecond,
    /// Time at no more than the standing speed.
    pub standing_time: Second,
    /// Software limits, lowest and highest, in addition to the leg's own.
    pub range: [Radian; 2],
    /// Torque limit, in addition to the leg's own.
    pub largest_torque: NewtonMetre,
    /// A larger distance to the commanded position for longer than [`Self::following_time`] is a fault
    /// (8611).
    pub following_window: Radian,
    /// Time limit of the following error.
    pub following_time: Second,
    /// The target is reached after [`Self::position_time`] within this distance.
    pub position_window: Radian,
    /// Time within the position window.
    pub position_time: Second,
    /// Period of the targets in the cyclic modes.
    pub period: Second,
}

impl JointCommand {
    /// The command with the positions that a host states relative to its zero, relative to the joint's own.
    pub(crate) fn seen_from(mut self, zero: Radian) -> Self {
        match &mut self.target {
            Target::ProfilePosition(SetPoint { position, relative_to: None, .. })
            | Target::CyclicPosition { position, .. }
            | Target::Impedance(ImpedanceTarget { position, .. }) => *position -= zero,
            _ => {}
        }
        self.range = self.range.map(|end| end - zero);
        self
    }
}

/// Status of one joint at one tick; angles and torques with the anatomical sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointStatus {
    /// State of the leg's drive.
    pub(crate) drive: DriveState,
    /// Measured position.
    pub position: Radian,
    /// Measured velocity.
    pub velocity: RadianPerSecond,
    /// Torque by the measured motor current.
    pub(crate) torque: NewtonMetre,
    /// Commanded position, after profile and interpolation.
    pub position_demand: Radian,
    /// Commanded velocity, after profile and interpolation.
    pub velocity_demand: RadianPerSecond,
    /// Commanded torque, after the limits.
    pub torque_demand: NewtonMetre,
    /// Active mode (6061); 0 for none.
    pub mode: i8,
    /// Whether the joint follows its target: no halt, no other activity, and the target can be followed.
    pub follows: bool,
    /// Whether no further set-point can be taken.
    pub is_full: bool,
    /// [`JointCommand::request_count`] of the last tick in which the joint followed commands.
    pub(crate) requests_seen: u8,
    /// Whether the target is reached, or the joint is at rest after a halt.
    pub reached: bool,
    /// Whether the joint stands.
    pub(crate) stands: bool,
    /// Whether a limit reduces the command.
    pub limited: bool,
    /// Whether homing has succeeded.
    pub homed: bool,
    /// Whether the following error is too large or the target unreachable; in homing, whether it failed.
    pub deviates: bool,
    /// Digital inputs, bits of CiA 402.
    pub inputs: u32,
    /// Supply voltage.
    pub(crate) bus: Volt,
}

impl JointStatus {
    /// Status before the first tick.
    pub const NONE: Self = Self {
        drive: DriveState::NotReadyToSwitchOn,
        position: Radian::ZERO,
        velocity: RadianPerSecond::ZERO,
        torque: NewtonMetre::ZERO,
        position_demand: Radian::ZERO,
        velocity_demand: RadianPerSecond::ZERO,
        torque_demand: NewtonMetre::ZERO,
        mode: 0,
        follows: false,
        is_full: false,
        requests_seen: 0,
        reached: false,
        stands: false,
        limited: false,
        homed: false,
        deviates: false,
        inputs: 0,
        bus: Volt::ZERO,
    };
}
