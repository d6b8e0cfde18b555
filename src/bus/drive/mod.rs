//! Drive profile (CiA 402) of one joint, and its interface to the leg.
//!
//! Why values only: the node runs at the priority of the bus, the leg in an interrupt. One status and one
//! command per joint, and at most one power request per leg, are copied once per tick. Neither side calls the
//! other.
//!
//! ```text
//!   host -- 6040, 6060, 607A, ... --> Axis --command(): JointCommand--> leg
//!   host <-- 6041, 6064, 6077, ... -- Axis <--update(JointStatus)------ leg
//!                      both Axis --Coupling--> PowerRequest ----------> leg
//!              6007 is 1, host lost: Axis --take_fault()--> Fault ----> leg
//! ```
//!
//! Execution of the commands: `leg::Following`. Units of the objects: micro-radian, micro-radian per second,
//! thousandths of the rated torque (6076, mN m). Flexion is positive.

mod control;
mod coupling;
mod objects;

pub(crate) use crate::leg::LONGEST_PERIOD;
pub use crate::leg::{ImpedanceTarget, JointCommand, JointStatus, Mode, Reference, SetPoint, Target};
pub(super) use control::USUAL_KBIT;
pub use control::{Axis, AxisConstants};
pub(crate) use coupling::Coupling;

use crate::units::Hertz;

/// Bandwidths of a joint's control loops that a host has set; `None`: the one a loop was designed for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LoopBandwidths {
    /// Bandwidth of the position loop.
    pub(crate) position: Option<Hertz>,
    /// Bandwidth of the current loop.
    pub(crate) current: Option<Hertz>,
}

#[cfg(test)]
mod tests;
