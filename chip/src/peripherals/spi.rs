//! SPI3 as a master (RM0090 28.3, 28.5): frames of 8 or 16 bits with their time on the wire.

use crate::findings::{Access, NO_REGISTER, NOT_MODELLED};
use crate::time::{TICK_HZ, Ticks};

const ENABLE: u32 = 1 << 6;
const MASTER: u32 = 1 << 2;
const WIDE: u32 = 1 << 11;
const RXNE: u32 = 1;
const TXE: u32 = 1 << 1;
const OVR: u32 = 1 << 6;
const BSY: u32 = 1 << 7;

/// State of the peripheral.
#[derive(Clone, Debug, Default)]
pub struct Spi {
    control: [u32; 2],
    /// End of the frame on the wire, and the answer that it brings.
    end: Ticks,
    answer: Option<u16>,
    received: u16,
    full: bool,
    overrun: bool,
}

/// Frame that starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    /// Bits sent.
    pub word: u16,
    /// Whether it has 16 bits.
    pub wide: bool,
    /// Clock polarity and phase.
    pub mode: u32,
    /// Bit clock, Hz.
    pub hz: u64,
}

impl Spi {
    fn settle(&mut self, now: Ticks) {
        if now >= self.end
            && let Some(answer) = self.answer.take()
        {
            self.overrun |= self.full;
            if !self.full {
                (self.received, self.full) = (answer, true);
            }
        }
    }

    pub fn read(&mut self, offset: u32, access: &mut Access<'_>) -> u32 {
        self.settle(access.now);
        match offset {
            0x00 | 0x04 => self.control[offset as usize / 4],
            0x08 => {
                let busy = self.answer.is_some();
                (u32::from(self.full) * RXNE)
                    | (u32::from(!busy) * TXE)
                    | (u32::from(self.overrun) * OVR)
                    | (u32::from(busy) * BSY)
            }
            0x0C => {
                (self.full, self.overrun) = (false, false);
                self.received.into()
            }
            0x10 => 7,
            0x14 | 0x18 | 0x1C => 0,
            0x20 => 2,
            _ => access.no_register(format!("SPI3+{offset:#x}")),
        }
    }

    /// Writes a register; returns the frame that starts, which must be answered by [`Self::answer`].
    pub fn write(
        &mut self,
        offset: u32,
        value: u32,
        size: usize,
        bus_hz: u64,
        access: &mut Access<'_>,
    ) -> Option<Sent> {
        self.settle(access.now);
        match offset {
            0x00 => self.write_control(access.implemented(value, 0xFFFF, "SPI3_CR1"), access),
            0x04 => {
                self.control[1] = access.implemented(value, 0xF7, "SPI3_CR2");
                if value & 0x13 != 0 {
                    access.refuse(NOT_MODELLED, "SPI3_CR2");
                }
            }
            0x08 => {}
            0x0C => return self.send(value, size, bus_hz, access),
            0x10 | 0x1C | 0x20 if value & 0x0800 == 0 => {}
            0x10..=0x20 => access.refuse(NOT_MODELLED, format!("SPI3+{offset:#x}")),
            _ => access.refuse(NO_REGISTER, format!("SPI3+{offset:#x}")),
        }
        None
    }

    fn write_control(&mut self, value: u32, access: &mut Access<'_>) {
        let before = self.control[0];
        // Speed, phase, polarity, frame and format may only be set while the peripheral is off.
        if before & value & ENABLE != 0 && (before ^ value) & 0x08BB != 0 {
            access.refuse("format changed while the peripheral is enabled", "SPI3_CR1");
        }
        if before & ENABLE != 0 && value & ENABLE == 0 && access.now < self.end {
            access.refuse("disabled while a frame is on the wire", "SPI3_CR1");
        }
        if value & ENABLE != 0 && value & MASTER == 0 {
            access.refuse(NOT_MODELLED, "SPI3_CR1");
        }
        if value & MASTER != 0 && value & 0x300 == 0x200 {
            access.refuse("master without its own select (mode fault)", "SPI3_CR1");
        }
        self.control[0] = value;
    }

    fn send(&mut self, value: u32, size: usize, bus_hz: u64, access: &mut Access<'_>) -> Option<Sent> {
        let control = self.control[0];
        if control & ENABLE == 0 {
            access.refuse("data written while the peripheral is off", "SPI3_DR");
            return None;
        }
        if self.answer.is_some() {
            access.refuse("data written while a frame is on the wire", "SPI3_DR");
        }
        let wide = control & WIDE != 0;
        if size == 1 && wide || size > 1 && !wide {
            access.refuse("width of the access differs from the frame's", "SPI3_DR");
        }
        let hz = bus_hz >> (1 + (control >> 3 & 7));
        self.end = access.now + if wide { 16 } else { 8 } * TICK_HZ / hz;
        Some(Sent { word: value as u16, wide, mode: control & 3, hz })
    }

    /// Sets the answer to the frame on the wire.
    pub fn answer(&mut self, answer: u16) {
        self.answer = Some(answer);
    }

    /// Whether a frame is on the wire.
    pub fn is_busy(&self, now: Ticks) -> bool {
        self.answer.is_some() && now < self.end
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    #[test]
    fn a_frame_takes_its_bits_and_its_answer_comes_at_the_end() {
        let (mut spi, mut findings) = (Spi::default(), Findings::default());
        let mut write = |spi: &mut Spi, now: Ticks, offset: u32, value: u32, size: usize| {
            spi.write(offset, value, size, 42_000_000, &mut Access { now, findings: &mut findings })
        };
        assert_eq!(write(&mut spi, 0, 0x0C, 0x1234, 2), None);
        // Divider 16, 16 bits, second edge, software select.
        write(&mut spi, 0, 0, 1 | MASTER | 3 << 3 | WIDE | 0x300, 4);
        write(&mut spi, 0, 0, 1 | MASTER | 3 << 3 | WIDE | 0x300 | ENABLE, 4);
        let sent = write(&mut spi, 0, 0x0C, 0x1234, 2);
        assert_eq!(sent, Some(Sent { word: 0x1234, wide: true, mode: 1, hz: 2_625_000 }));
        spi.answer(0xBEEF);
        let end = 16 * 128;
        let access = &mut Access { now: end - 1, findings: &mut findings };
        assert_eq!(spi.read(0x08, access), BSY);
        access.now = end;
        assert_eq!(spi.read(0x08, access), RXNE | TXE);
        assert_eq!(spi.read(0x0C, access), 0xBEEF);
        assert_eq!(spi.read(0x08, access), TXE);
        assert!(findings.has("data written while the peripheral is off") && findings.len() == 1);
    }
}
