//! Two DRV8301 gate drivers on one SPI, with a common enable line (Texas Instruments, SLOS719).
//!
//! ```text
//! frame   bit 15 read, bits 14..11 register, bits 10..0 data; the answer comes with the next frame
//! ```
//!
//! A driver answers 10 ms after it was enabled and loses its registers when it is disabled. Its second
//! control register sets the gain of the shunt amplifiers. Disabled drivers hold all gates low.

use crate::findings::Access;
use crate::peripherals::spi::Sent;
use crate::time::{TICK_HZ, Ticks};

/// Time from enabling to the first answer: at most 10 ms.
const READY: Ticks = TICK_HZ / 100;
/// Least time that the enable line must be low for a reset: 20 us.
const RESET: Ticks = TICK_HZ / 50_000;
/// Least time between two frames: 400 ns.
const BETWEEN: Ticks = TICK_HZ / 2_500_000;
/// Fastest bit clock, Hz.
const FASTEST_HZ: u64 = 10_000_000;
/// Gains of the amplifiers, V/V, by bits 3 and 2 of the second control register.
const GAINS: [f64; 4] = [10.0, 20.0, 40.0, 80.0];

/// One driver.
#[derive(Clone, Copy, Debug, Default)]
struct Driver {
    registers: [u16; 4],
    answer: u16,
}

/// Both drivers.
#[derive(Clone, Debug, Default)]
pub struct Drivers {
    drivers: [Driver; 2],
    /// Instant of the last rising edge of the enable line; `None` while it is low.
    enabled: Option<Ticks>,
    disabled_at: Ticks,
    /// End of the last frame's selection.
    pub released: Ticks,
    pub frames: [u64; 2],
}

impl Drivers {
    /// Follows the enable line.
    pub fn set_enabled(&mut self, high: bool, access: &mut Access<'_>) {
        match (self.enabled, high) {
            (None, true) => {
                if self.disabled_at > 0 && access.now < self.disabled_at + RESET {
                    access.refuse("gate drivers enabled again within 20 us", "DRV8301");
                }
                self.drivers = [Driver::default(); 2];
                self.enabled = Some(access.now);
            }
            (Some(_), false) => (self.enabled, self.disabled_at) = (None, access.now),
            _ => {}
        }
    }

    /// Whether the gates follow their inputs.
    pub const fn drive(&self) -> bool {
        self.enabled.is_some()
    }

    /// Gain of an axis' shunt amplifiers, V/V.
    pub fn gain(&self, axis: usize) -> f64 {
        GAINS[usize::from(self.drivers[axis].registers[3] >> 2 & 3)]
    }

    /// Loses a driver's configuration, as a brown-out of its supply does.
    pub fn lose_configuration(&mut self, axis: usize) {
        self.drivers[axis].registers = [0; 4];
    }

    /// Exchanges a frame with the selected drivers; returns the answer.
    pub fn frame(&mut self, sent: &Sent, selected: [bool; 2], access: &mut Access<'_>) -> u16 {
        let axis = match selected {
            [true, false] => 0,
            [false, true] => 1,
            _ => {
                access.refuse("frame with none or both gate drivers selected", "DRV8301");
                return u16::MAX;
            }
        };
        if !sent.wide || sent.mode != 1 || sent.hz > FASTEST_HZ {
            access.refuse("frame in a format that a gate driver does not read", "DRV8301");
            return u16::MAX;
        }
        if access.now < self.released + BETWEEN {
            access.refuse("less than 400 ns between two frames", "DRV8301");
        }
        if self.enabled.is_none_or(|since| access.now < since + READY) {
            access.refuse("frame to a gate driver that is off or not ready", "DRV8301");
            return u16::MAX;
        }
        self.frames[axis] += 1;
        let driver = &mut self.drivers[axis];
        let (reads, register, data) = (sent.word >> 15 == 1, sent.word >> 11 & 0xF, sent.word & 0x7FF);
        let answer = driver.answer;
        let slot = driver.registers.get_mut(usize::from(register));
        if !reads && register < 2 {
            access.refuse("status register of a gate driver written", "DRV8301");
        }
        let value = match slot {
            Some(slot) => {
                if !reads && register >= 2 {
                    // The fault reset bit of the first control register clears itself.
                    *slot = if register == 2 { data & !4 } else { data };
                }
                *slot
            }
            None => {
                access.refuse("register that a gate driver does not have", "DRV8301");
                0
            }
        };
        driver.answer = register << 11 | value;
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    const FRAME: Sent = Sent { word: 0, wide: true, mode: 1, hz: 2_625_000 };

    #[test]
    fn a_driver_answers_with_the_next_frame_and_loses_registers_when_disabled() {
        let (mut drivers, mut findings) = (Drivers::default(), Findings::default());
        let access = &mut Access { now: 1000, findings: &mut findings };
        drivers.set_enabled(true, access);
        access.now += READY;
        let ask = |drivers: &mut Drivers, word: u16, access: &mut Access<'_>| {
            access.now += 10_000;
            drivers.frame(&Sent { word, ..FRAME }, [true, false], access)
        };
        ask(&mut drivers, 3 << 11 | 8, access);
        assert_eq!(drivers.gain(0), 40.0);
        ask(&mut drivers, 1 << 15 | 3 << 11, access);
        assert_eq!(ask(&mut drivers, 1 << 15 | 3 << 11, access), 3 << 11 | 8);
        drivers.set_enabled(false, access);
        access.now += RESET;
        drivers.set_enabled(true, access);
        assert_eq!(drivers.gain(0), 10.0);
        assert!(access.findings.is_empty());
        ask(&mut drivers, 1 << 15, access);
        assert!(access.findings.has("frame to a gate driver that is off or not ready"));
    }

    #[test]
    fn a_wrong_clock_phase_is_not_read() {
        let (mut drivers, mut findings) = (Drivers::default(), Findings::default());
        let access = &mut Access { now: 1000, findings: &mut findings };
        assert_eq!(drivers.frame(&Sent { mode: 0, ..FRAME }, [true, false], access), u16::MAX);
        assert!(findings.has("frame in a format that a gate driver does not read"));
    }
}
