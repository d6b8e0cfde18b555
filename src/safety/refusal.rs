//! Reasons why enabling or assistance is refused: one list for the monitor, the bus and the records.
//!
//! Why one list: a host that requests a step towards enabled must learn what is missing. Each reason has a
//! bit of the digital inputs (60FD). Its bit number is also its number in emergency messages (FF0E), and its
//! word appears in records (`not_enabled`).

use crate::listed::listed;

/// A request that was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Counted from 0; [`Self::LEG`] for the whole leg.
    pub(crate) joint: u8,
    /// Why the request was refused.
    pub(crate) reason: RefusalReason,
}

impl Refusal {
    /// Value of `joint` for the whole leg.
    pub(crate) const LEG: u8 = u8::MAX;

    /// Joint counted from 1; 0 for the leg.
    pub const fn number(self) -> u8 {
        self.joint.wrapping_add(1)
    }
}

listed! {
    /// Reason why a request is refused; the numbers are the bits of 60FD.
    #[repr(u8)]
    pub enum RefusalReason {
        /// All reasons, in the order of their bits.
        ALL,
        /// Word used in records.
        name;
        /// The operator does not hold the enabling switch. The bit of 60FD is set while it is held.
        SwitchOpen = 16, "switch_open";
        /// An inhibit reason is active (`InhibitReason`).
        Blocked = 17, "blocked";
        /// The joints' zeros are unknown.
        NoReference = 18, "no_reference";
        /// An axis is not calibrated.
        NotCalibrated = 19, "not_calibrated";
        /// The joint is more than 0.5 degrees out of its range, and returning is not permitted.
        OutOfRange = 20, "out_of_range";
        /// The joint is too fast to stop within its range, or faster than 0.1 rad/s outside it.
        Moving = 21, "moving";
        /// The encoder reading of this tick was rejected.
        Encoder = 22, "encoder";
        /// CiA 402 has no such step from the joint's state, or bit 7 of the controlword is set.
        NoTransition = 23, "no_transition";
        /// Assistance: a model that its shares need is missing or no longer fits, or the joints move.
        NoAssistance = 24, "no_assistance";
    }
}

impl RefusalReason {
    /// Bit of this reason in 60FD.
    pub const fn bit(self) -> u32 {
        1 << self as u8
    }
}
