//! Independent watchdog (RM0090 21): a down-counter of its own oscillator that resets the chip at zero.
//!
//! Prescaler and reload are written behind a key. A write takes some periods of the divided oscillator; until
//! then its busy flag is set and further writes are ignored. The count goes on through sleep and stalls.

use crate::findings::{Access, NO_REGISTER};
use crate::time::{NEVER, TICK_HZ, Ticks};

/// Periods of the divided oscillator that a write of prescaler or reload takes.
const UPDATE: u64 = 6;

/// State of the watchdog.
#[derive(Clone, Debug, Default)]
pub struct Iwdg {
    /// Frequency of the oscillator, Hz: 17,000 to 47,000.
    pub oscillator_hz: u64,
    runs: bool,
    unlocked: bool,
    prescaler: u32,
    reload: u32,
    /// Count at an instant.
    count: u64,
    since: Ticks,
    /// Instants until which prescaler and reload are busy.
    busy: [Ticks; 2],
}

impl Iwdg {
    /// A stopped watchdog.
    pub fn new() -> Self {
        Self { oscillator_hz: 32_000, reload: 0xFFF, count: 0xFFF, ..Self::default() }
    }

    /// Stops the watchdog, as a reset does.
    pub fn reset(&mut self) {
        *self = Self { oscillator_hz: self.oscillator_hz, ..Self::new() };
    }

    /// Length of a count.
    fn step(&self) -> Ticks {
        (4 << self.prescaler.min(6)) * TICK_HZ / self.oscillator_hz
    }

    fn count_at(&self, now: Ticks) -> u64 {
        if self.runs { self.count.saturating_sub((now - self.since) / self.step()) } else { self.count }
    }

    /// Instant at which the watchdog resets the chip.
    pub fn due(&self) -> Ticks {
        if self.runs { self.since + (self.count + 1) * self.step() } else { NEVER }
    }

    pub fn read(&mut self, offset: u32, access: &mut Access<'_>) -> u32 {
        let busy = self.busy.map(|until| access.now < until);
        if matches!((offset, busy), (4, [true, _]) | (8, [_, true])) {
            access.refuse("read of a value that is being updated", format!("IWDG+{offset:#x}"));
        }
        match offset {
            0 => 0,
            4 => self.prescaler,
            8 => self.reload,
            12 => u32::from(busy[0]) | u32::from(busy[1]) << 1,
            _ => access.no_register(format!("IWDG+{offset:#x}")),
        }
    }

    pub fn write(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        let now = access.now;
        match (offset, value) {
            (0, 0x5555) => self.unlocked = true,
            (0, key) => {
                self.unlocked = false;
                match key {
                    0xAAAA => (self.count, self.since) = (self.reload.into(), now),
                    // A start counts from the present value, 0xFFF without a feed before (RM0090 21.3).
                    0xCCCC if !self.runs => (self.runs, self.since) = (true, now),
                    0xCCCC => {}
                    _ => access.refuse("unknown key", "IWDG_KR"),
                }
            }
            (4 | 8, _) => self.set(usize::from(offset == 8), value, access),
            _ => access.refuse(NO_REGISTER, format!("IWDG+{offset:#x}")),
        }
    }

    fn set(&mut self, which: usize, value: u32, access: &mut Access<'_>) {
        let name = ["IWDG_PR", "IWDG_RLR"][which];
        if !self.unlocked {
            return access.refuse("written without its key", name);
        }
        if access.now < self.busy[which] {
            return access.refuse("written while an update is in progress", name);
        }
        let count = self.count_at(access.now);
        if which == 0 {
            self.prescaler = access.implemented(value, 7, name);
        } else {
            self.reload = access.implemented(value, 0xFFF, name);
        }
        (self.count, self.since) = (count, access.now);
        self.busy[which] = access.now + UPDATE * self.step();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    fn write(iwdg: &mut Iwdg, findings: &mut Findings, now: Ticks, offset: u32, value: u32) {
        iwdg.write(offset, value, &mut Access { now, findings });
    }

    #[test]
    fn values_are_locked_and_busy_ones_ignored() {
        let (mut iwdg, mut findings) = (Iwdg::new(), Findings::default());
        write(&mut iwdg, &mut findings, 0, 4, 3);
        assert!(findings.has("written without its key"));
        write(&mut iwdg, &mut findings, 0, 0, 0x5555);
        write(&mut iwdg, &mut findings, 0, 4, 3);
        write(&mut iwdg, &mut findings, 1, 4, 1);
        assert!(findings.has("written while an update is in progress"));
        assert_eq!(iwdg.prescaler, 3);
    }
}
