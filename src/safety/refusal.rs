//! What stands against enabling the drive: one list for the monitor, the bus and the records.
//!
//! Why one list: whoever asks for a step towards enabled and waits must learn what it waits for. Each reason has a bit of the digital
//! inputs (60FD), which is its number as well in emergency messages (FF0E) and a word in records (`not_enabled`).

/// A request that was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// Counted from 0; [`Self::LEG`] where no joint is meant.
    pub joint: u8,
    /// What stands against it.
    pub reason: RefusalReason,
}

impl Refusal {
    /// The leg as a whole.
    pub const LEG: u8 = u8::MAX;

    /// Counted from 1; 0 for the leg.
    #[must_use]
    pub const fn number(self) -> u8 {
        self.joint.wrapping_add(1)
    }
}

/// What stands against enabling; the numbers are those of the bits in 60FD.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum RefusalReason {
    /// The operator does not hold the enabling switch, whose bit is set while it is held.
    SwitchOpen = 16,
    /// Something forbids to enable (`Cause`).
    Blocked = 17,
    /// The joints' zeros are not known.
    NoReference = 18,
    /// An axis is not calibrated.
    NotCalibrated = 19,
    /// The joint is out of its range by more than 0.5 degrees, and must not return into it.
    OutOfRange = 20,
    /// The joint is faster than its limit; outside its range, than 0.1 rad/s.
    Moving = 21,
    /// The encoder reading of this tick was rejected.
    Encoder = 22,
}

impl RefusalReason {
    /// Its bit in 60FD.
    #[must_use]
    pub const fn bit(self) -> u32 {
        1 << self as u8
    }
}
