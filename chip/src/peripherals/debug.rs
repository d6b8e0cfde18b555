//! Debug unit, cycle counter, unique number and one-time programmable memory (RM0090 38, 39; ARMv7-M C1.8).
//!
//! The cycle counter stops in sleep unless DBGMCU_CR keeps the clock on (DBG_SLEEP). A processor is never
//! halted here, so the freeze bits have no effect.

use crate::findings::{Access, NO_REGISTER};
use crate::time::Ticks;

/// Address of the system memory that is readable: one-time programmable memory, unique number, flash size.
pub const SYSTEM_MEMORY: u32 = 0x1FFF_0000;
pub const SYSTEM_BYTES: usize = 0x8000;

/// Content of the system memory of an ODrive v3.6-56V.
pub fn system_memory() -> Vec<u8> {
    let mut bytes = vec![0xFF; SYSTEM_BYTES];
    // Factory version: major, minor, voltage.
    bytes[0x7803..0x7806].copy_from_slice(&[3, 6, 56]);
    for (index, byte) in bytes[0x7A10..0x7A1C].iter_mut().enumerate() {
        *byte = 0x31 + index as u8;
    }
    // Kilobytes of flash.
    bytes[0x7A22..0x7A24].copy_from_slice(&1024_u16.to_le_bytes());
    bytes
}

/// State of debug unit and cycle counter.
#[derive(Clone, Debug, Default)]
pub struct Debug {
    control: u32,
    freeze: [u32; 2],
    /// Whether tracing is on (DEMCR TRCENA), and whether the cycle counter counts (DWT_CTRL CYCCNTENA).
    pub trace: bool,
    pub counts: bool,
    /// Count at an instant, and the length of a cycle since then.
    count: u32,
    since: Ticks,
    cycle: Ticks,
}

impl Debug {
    /// State after power-on.
    pub fn new() -> Self {
        Self { cycle: 21, ..Self::default() }
    }

    /// Cycle counter.
    pub fn cycles(&self, now: Ticks) -> u32 {
        let running = self.trace && self.counts;
        if running { self.count.wrapping_add(((now - self.since) / self.cycle) as u32) } else { self.count }
    }

    /// Changes the length of a cycle.
    pub fn set_cycle(&mut self, cycle: Ticks, now: Ticks) {
        (self.count, self.since, self.cycle) = (self.cycles(now), now, cycle);
    }

    /// Leaves a sleep that began at an instant.
    #[inline]
    pub fn woke(&mut self, begun: Ticks, now: Ticks) {
        // The bit keeps the processor's clock on.
        if self.control & 1 == 0 {
            self.since += now - begun;
        }
    }

    /// Reads a register of the debug unit.
    pub fn read(&self, offset: u32, access: &mut Access<'_>) -> u32 {
        match offset {
            // Device F405, revision 1.
            0x00 => 0x1001_6413,
            0x04 => self.control,
            0x08 | 0x0C => self.freeze[(offset as usize - 8) / 4],
            _ => access.no_register(format!("DBGMCU+{offset:#x}")),
        }
    }

    /// Writes a register of the debug unit.
    pub fn write(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        match offset {
            0x04 => self.control = access.implemented(value, 0xE7, "DBGMCU_CR"),
            0x08 => self.freeze[0] = access.implemented(value, 0x06E0_1DFF, "DBGMCU_APB1_FZ"),
            0x0C => self.freeze[1] = access.implemented(value, 0x0007_0003, "DBGMCU_APB2_FZ"),
            _ => access.refuse(NO_REGISTER, format!("DBGMCU+{offset:#x}")),
        }
    }

    /// Sets whether tracing is on, or the cycle counter counts.
    pub fn enable(&mut self, trace: Option<bool>, counts: Option<bool>, now: Ticks) {
        (self.count, self.since) = (self.cycles(now), now);
        self.trace = trace.unwrap_or(self.trace);
        self.counts = counts.unwrap_or(self.counts);
    }

    pub fn set_cycles(&mut self, count: u32, now: Ticks) {
        (self.count, self.since) = (count, now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    #[test]
    fn the_cycle_counter_stops_in_sleep_without_its_debug_bit() {
        let mut debug = Debug::new();
        debug.set_cycle(2, 0);
        debug.enable(Some(true), Some(true), 0);
        assert_eq!(debug.cycles(200), 100);
        debug.woke(200, 400);
        assert_eq!(debug.cycles(400), 100);
        debug.write(4, 1, &mut Access { now: 400, findings: &mut Findings::default() });
        debug.woke(400, 600);
        assert_eq!(debug.cycles(600), 200);
    }
}
