//! Absolute encoder AS5047P: the frames of its SPI, and its angle in counts of the incremental interface.
//!
//! ```text
//! frame   bit 15 even parity over all bits, bit 14 error of the last command, bits 13..0 angle
//! counts  floor(angle * counts per turn / 2^14)
//! ```
//!
//! A and B of the incremental interface come from the same chip. With A on A and B on B both grow together.
//!
//! Source: ams AS5047P data sheet (SPI, register ANGLECOM); the same checks as in ODrive v0.5.6
//! (`encoder.cpp`, AMS). Known limits: a magnet that is too far away shows only in a register that is not
//! read. A line that is shorted to ground reads as the valid angle 0.

use super::Direction;

/// Absolute encoders of an axis, beside the incremental one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AbsoluteEncoders {
    /// Whether there is one at the rotor. Its zero replaces the index.
    pub rotor: bool,
    /// Direction of the one at the joint while the counter grows; `None` without one.
    pub joint: Option<Direction>,
}

impl AbsoluteEncoders {
    /// Neither.
    pub const NONE: Self = Self { rotor: false, joint: None };
}

/// Angle of an absolute encoder, in 2^-14 turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AbsoluteAngle(u16);

impl AbsoluteAngle {
    /// Steps per turn.
    pub const STEPS: i32 = 1 << 14;

    /// Angle of so many steps, reduced to one turn.
    pub const fn from_steps(steps: u16) -> Self {
        Self(steps & ANGLE)
    }

    /// Angle in a frame; `None` with wrong parity or a set error flag. A line without a chip reads as all
    /// ones, which has the error flag.
    pub(crate) const fn from_frame(frame: u16) -> Option<Self> {
        let is_valid = frame.count_ones().is_multiple_of(2) && frame & ERROR == 0;
        if is_valid { Some(Self(frame & ANGLE)) } else { None }
    }

    /// Frame that carries this angle.
    #[cfg(test)]
    pub(crate) const fn to_frame(self) -> u16 {
        self.0 | ((self.0.count_ones() & 1) << 15) as u16
    }

    /// Steps from zero, below [`Self::STEPS`].
    pub const fn steps(self) -> u16 {
        self.0
    }

    /// Counts from zero of an incremental interface with so many counts per turn, at most 65,536.
    pub const fn counts(self, counts_per_turn: i32) -> i32 {
        (self.0 as i32 * counts_per_turn) >> 14
    }
}

const ERROR: u16 = 1 << 14;
const ANGLE: u16 = ERROR - 1;

/// Reduces a difference of positions to half a turn in either direction; zero for a turn of zero.
pub(crate) fn within_half_a_turn(difference: i32, turn: i32) -> i32 {
    let within = difference.checked_rem_euclid(turn).unwrap_or_default();
    if within > turn / 2 { within - turn } else { within }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_angle_returns_from_its_frame_and_no_single_bit_may_change() {
        for steps in 0..1 << 14 {
            let angle = AbsoluteAngle::from_steps(steps);
            let frame = angle.to_frame();
            assert_eq!(AbsoluteAngle::from_frame(frame).map(AbsoluteAngle::steps), Some(steps));
            assert!((0..16).all(|bit| AbsoluteAngle::from_frame(frame ^ 1 << bit).is_none()), "{steps}");
        }
        // No chip, and a chip that reports an error.
        assert_eq!(AbsoluteAngle::from_frame(0xFFFF), None);
        assert_eq!(AbsoluteAngle::from_frame(0xC000), None);
        // Data sheet: the answer to a read command has the parity in the highest bit.
        assert_eq!(AbsoluteAngle::from_frame(0x8001), Some(AbsoluteAngle(1)));
    }

    #[test]
    fn an_angle_is_the_count_of_the_incremental_interface() {
        for (steps, turn, counts) in [
            (0, 4000, 0),
            (16_383, 4000, 3999),
            (8192, 4096, 2048),
            (3, 4096, 0),
            (4, 4096, 1),
            (1, 65_536, 4),
        ] {
            assert_eq!(AbsoluteAngle::from_steps(steps).counts(turn), counts, "{steps} {turn}");
        }
    }

    #[test]
    fn a_difference_lies_within_half_a_turn() {
        for (difference, within) in
            [(0, 0), (2000, 2000), (2001, -1999), (-1999, -1999), (-2000, 2000), (9000, 1000)]
        {
            assert_eq!(within_half_a_turn(difference, 4000), within, "{difference}");
        }
        assert_eq!(within_half_a_turn(7, 0), 0);
    }
}
