//! What can go wrong, under numbers that never change.
//!
//! The numbers are the error codes of CiA 402 (and CiA 301 for those of the manufacturer), so a host that reads
//! object 603F understands them.

/// A kind of fault. New kinds get new numbers; a number is never used again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum FaultCode {
    /// The encoder moved farther than the joint can, three times in 10 ms (7305: incremental sensor 1).
    EncoderStep = 0x7305,
    /// Faster than 1.1 times the speed limit while enabled (8400: speed controller).
    Overspeed = 0x8400,
    /// Farther than 0.5 degrees beyond the range while enabled (8500: position controller).
    PositionLimit = 0x8500,
    /// Something measured or wanted is NaN or infinite (FF01: manufacturer's).
    NotFinite = 0xFF01,
}

/// The safe state a fault leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// Bridges released in the same tick.
    Off,
    /// Velocity damped under the torque cap for at most 300 ms, then Off.
    Damp,
}

impl FaultCode {
    /// The number on the bus and in every record.
    #[must_use]
    pub const fn number(self) -> u16 {
        self as u16
    }

    /// Where this fault leads.
    #[must_use]
    pub const fn reaction(self) -> Reaction {
        match self {
            Self::NotFinite => Reaction::Off,
            Self::EncoderStep | Self::Overspeed | Self::PositionLimit => Reaction::Damp,
        }
    }
}

/// A fault and the joint it was seen at; it stops the whole leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What went wrong.
    pub code: FaultCode,
    /// Where, counted from 0.
    pub joint: u8,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fault_numbers_are_fixed() {
        let numbers = [
            (FaultCode::EncoderStep, 0x7305),
            (FaultCode::Overspeed, 0x8400),
            (FaultCode::PositionLimit, 0x8500),
            (FaultCode::NotFinite, 0xFF01),
        ];
        for (code, number) in numbers {
            assert_eq!(code.number(), number);
        }
    }
}
