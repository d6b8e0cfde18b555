//! AS5047P magnetic encoders on the gate drivers' SPI (ams data sheet, AS5047P).
//!
//! ```text
//! command   bit 15 even parity, bit 14 read, bits 13..0 register         answer with the next frame
//! answer    bit 15 even parity, bit 14 error of a command before, bits 13..0 data
//! ```
//!
//! The commands 0xFFFF (angle) and 0x4001 (errors), the error bits and SPI mode 1 are those of SimpleFOC's
//! driver (`Arduino-FOC-drivers`, `AS5047.cpp`) too.
//!
//! A command takes effect when the chip is deselected. The error flag stays until the error register (0x0001)
//! is read. Only reads of that and of the angle (0x3FFF) are modelled.

use crate::findings::Access;
use crate::peripherals::spi::Sent;
use crate::time::{TICK_HZ, Ticks};

/// Least time between two frames, and from selection to the first clock: 350 ns.
const BETWEEN: Ticks = TICK_HZ * 35 / 100_000_000;
/// Fastest bit clock, Hz.
const FASTEST_HZ: u64 = 10_000_000;
const ERROR: u16 = 1 << 14;
const ANGLE: u16 = 0x3FFF;
const ERRORS: u16 = 0x0001;

/// One encoder.
#[derive(Clone, Copy, Debug, Default)]
pub struct Encoder {
    answer: u16,
    /// Contents of the error register: bit 2 parity, bit 1 invalid command.
    errors: u16,
    /// End of the last frame's selection.
    pub released: Ticks,
}

impl Encoder {
    /// Exchanges a frame; `angle` is the reading, 14 bits.
    pub fn frame(&mut self, sent: &Sent, angle: u16, access: &mut Access<'_>) -> u16 {
        if !sent.wide || sent.mode != 1 || sent.hz > FASTEST_HZ {
            access.refuse("frame in a format that an encoder does not read", "AS5047P");
            return u16::MAX;
        }
        if access.now < self.released + BETWEEN {
            access.refuse("less than 350 ns between two frames", "AS5047P");
        }
        let answer = self.answer;
        let is_even = sent.word.count_ones().is_multiple_of(2);
        let (reads, register) = (sent.word & ERROR != 0, sent.word & ANGLE);
        let data = match (is_even, reads, register) {
            (false, ..) => {
                self.errors |= 4;
                0
            }
            (_, true, ANGLE) => angle,
            (_, true, ERRORS) => core::mem::take(&mut self.errors),
            _ => {
                access.refuse("command that the model does not know", "AS5047P");
                self.errors |= 2;
                0
            }
        };
        let error = if self.errors == 0 { 0 } else { ERROR };
        let word = data & ANGLE | error;
        self.answer = word | (word.count_ones() as u16 & 1) << 15;
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    fn ask(encoder: &mut Encoder, word: u16, findings: &mut Findings) -> u16 {
        let access = &mut Access { now: 1_000_000, findings };
        encoder.frame(&Sent { word, wide: true, mode: 1, hz: 2_625_000 }, 0x1235, access)
    }

    #[test]
    fn the_angle_comes_with_the_next_frame_and_even_parity() {
        let (mut encoder, mut findings) = (Encoder::default(), Findings::default());
        ask(&mut encoder, 0xFFFF, &mut findings);
        assert_eq!(ask(&mut encoder, 0xFFFF, &mut findings), 0x1235);
        assert!(findings.is_empty());
    }

    #[test]
    fn a_command_with_wrong_parity_sets_the_flag_until_the_register_is_read() {
        let (mut encoder, mut findings) = (Encoder::default(), Findings::default());
        ask(&mut encoder, 0x7FFF, &mut findings);
        assert_eq!(ask(&mut encoder, 0xFFFF, &mut findings) & ERROR, ERROR);
        assert_eq!(ask(&mut encoder, 0x4001, &mut findings) & ERROR, ERROR);
        assert_eq!(ask(&mut encoder, 0xFFFF, &mut findings) & 0x3FFF, 4, "the parity error");
        assert_eq!(ask(&mut encoder, 0xFFFF, &mut findings), 0x1235);
    }
}
