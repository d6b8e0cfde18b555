//! Nested vectored interrupt controller and the processor's exceptions: priorities, pending and active ones.
//!
//! Exception numbers: 2 non-maskable interrupt, 3 hard fault, 11 supervisor call, 14, 15 system, 16 + n for
//! interrupt n. An STM32F405 has 82 interrupts and four bits of priority; lower values win, equal ones by
//! number. Source: Arm, ARMv7-M Architecture Reference Manual, B1.5 and B3.4.

/// Exceptions, the 16 of the processor included.
pub const EXCEPTIONS: usize = 16 + 82;
/// Non-maskable interrupt.
pub const NMI: u8 = 2;
pub const HARD_FAULT: u8 = 3;
pub const SUPERVISOR_CALL: u8 = 11;
/// Request for a system service (PendSV).
pub const PENDING_SERVICE: u8 = 14;
pub const SYSTEM_TICK: u8 = 15;
/// Priority of the thread.
pub const THREAD: i16 = 256;

/// State of the interrupt controller.
#[derive(Clone, Debug, Default)]
pub struct Nvic {
    enabled: u128,
    pending: u128,
    /// Levels of the interrupt lines.
    lines: u128,
    active: Vec<u8>,
    priorities: Vec<u8>,
    /// Instant at which each exception became pending, and worst latency to its entry.
    pub pended: Vec<u64>,
    /// Split of a priority into group and sub-priority (AIRCR PRIGROUP): 0 to 7.
    pub group: u32,
}

impl Nvic {
    /// State after a reset.
    pub fn new() -> Self {
        Self {
            enabled: 0xFFFF,
            priorities: vec![0; EXCEPTIONS],
            pended: vec![0; EXCEPTIONS],
            ..Self::default()
        }
    }

    /// Exceptions that are enabled and pending.
    #[inline]
    pub fn ready(&self) -> u128 {
        self.enabled & self.pending
    }

    /// Whether an enabled interrupt is pending, which ends a sleep even if it is masked.
    pub fn is_pending(&self, exception: u8) -> bool {
        self.pending >> exception & 1 == 1
    }

    /// Sets an interrupt's line. A rising line makes the interrupt pending.
    pub fn set_line(&mut self, interrupt: u8, level: bool, now: u64) {
        let bit = 1_u128 << (16 + interrupt);
        if level && self.lines & bit == 0 {
            self.pend(16 + interrupt, now);
        }
        if level { self.lines |= bit } else { self.lines &= !bit }
    }

    /// Makes an exception pending.
    pub fn pend(&mut self, exception: u8, now: u64) {
        let bit = 1_u128 << exception;
        if self.pending & bit == 0 {
            self.pending |= bit;
            if let Some(slot) = self.pended.get_mut(usize::from(exception)) {
                *slot = now;
            }
        }
    }

    /// Withdraws a request.
    pub fn unpend(&mut self, exception: u8) {
        self.pending &= !(1 << exception);
    }

    /// Interrupt control and state register (B3.2.4): active and first pending exception, pending system
    /// exceptions. Known limit, also QEMU's: the base priority does not hide the pending exception, as on
    /// silicon.
    pub fn state(&self) -> u32 {
        let pending = |exception: u8| u32::from(self.is_pending(exception));
        u32::from(self.current())
            | u32::from(self.depth() <= 1) << 11
            | u32::from(self.preempting(THREAD).unwrap_or(0)) << 12
            | u32::from(self.pending >> 16 != 0) << 22
            | pending(SYSTEM_TICK) << 26
            | pending(PENDING_SERVICE) << 28
            | pending(NMI) << 31
    }

    /// Priority of an exception; a smaller number preempts.
    pub fn priority(&self, exception: u8) -> i16 {
        match exception {
            1 => -3,
            NMI => -2,
            HARD_FAULT => -1,
            _ => self.priorities.get(usize::from(exception)).map_or(THREAD, |&priority| i16::from(priority)),
        }
    }

    /// Part of a priority that decides about preemption.
    fn group_of(&self, priority: i16) -> i16 {
        if priority < 0 { priority } else { priority & !((2_i16 << self.group) - 1) }
    }

    /// Priority at which the processor runs, without masks.
    pub fn running(&self) -> i16 {
        self.active.iter().map(|&exception| self.group_of(self.priority(exception))).min().unwrap_or(THREAD)
    }

    /// Pending exception that preempts code at this priority.
    pub fn preempting(&self, running: i16) -> Option<u8> {
        let mut ready = self.ready();
        let mut best: Option<(i16, u8)> = None;
        while ready != 0 {
            let exception = ready.trailing_zeros() as u8;
            ready &= ready - 1;
            let candidate = (self.priority(exception), exception);
            if best.is_none_or(|best| candidate < best) {
                best = Some(candidate);
            }
        }
        best.filter(|&(priority, _)| self.group_of(priority) < running).map(|(_, exception)| exception)
    }

    /// Whether an exception would preempt code at this priority.
    pub fn preempts(&self, exception: u8, running: i16) -> bool {
        self.group_of(self.priority(exception)) < running
    }

    pub fn enter(&mut self, exception: u8) {
        self.pending &= !(1 << exception);
        self.active.push(exception);
    }

    /// Leaves the newest exception and returns it. If its line is still high, it becomes pending again.
    pub fn leave(&mut self, now: u64) -> Option<u8> {
        let exception = self.active.pop()?;
        if self.lines >> exception & 1 == 1 {
            self.pend(exception, now);
        }
        Some(exception)
    }

    /// Active exception; 0 for the thread.
    pub fn current(&self) -> u8 {
        self.active.last().copied().unwrap_or(0)
    }

    /// Number of active exceptions.
    pub fn depth(&self) -> usize {
        self.active.len()
    }

    /// Reads a register by its offset from 0xE000_E000.
    pub fn read(&self, offset: u32, size: usize) -> u32 {
        let word = |bits: u128, first: u32| (bits >> (16 + 8 * (offset - first))) as u32;
        match offset {
            0x100..0x110 => word(self.enabled, 0x100),
            0x180..0x190 => word(self.enabled, 0x180),
            0x200..0x210 => word(self.pending, 0x200),
            0x280..0x290 => word(self.pending, 0x280),
            0x300..0x310 => word(self.active.iter().fold(0, |bits, exception| bits | 1 << exception), 0x300),
            0x400..0x454 => self.priority_bytes(16 + (offset - 0x400), size),
            0xD18..0xD24 => self.priority_bytes(4 + (offset - 0xD18), size),
            _ => 0,
        }
    }

    fn priority_bytes(&self, first: u32, size: usize) -> u32 {
        (0..size as u32).fold(0, |value, byte| {
            let priority = self.priorities.get((first + byte) as usize).copied().unwrap_or(0);
            value | u32::from(priority) << (8 * byte)
        })
    }

    /// Writes a register by its offset from 0xE000_E000; returns whether it belongs to this unit.
    pub fn write(&mut self, offset: u32, size: usize, value: u32, now: u64) -> bool {
        let bits = |first: u32| u128::from(value) << (16 + 8 * (offset - first));
        match offset {
            0x100..0x110 => {
                // The latency of an interrupt that waited for its enable counts from that moment.
                let mut waiting = bits(0x100) & !self.enabled & self.pending;
                self.enabled |= bits(0x100);
                while waiting != 0 {
                    self.pended[waiting.trailing_zeros() as usize] = now;
                    waiting &= waiting - 1;
                }
            }
            0x180..0x190 => self.enabled &= !bits(0x180),
            0x200..0x210 => {
                let mut set = bits(0x200);
                while set != 0 {
                    self.pend(set.trailing_zeros() as u8, now);
                    set &= set - 1;
                }
            }
            0x280..0x290 => self.pending &= !bits(0x280),
            0x400..0x454 => self.set_priority_bytes(16 + (offset - 0x400), size, value),
            0xD18..0xD24 => self.set_priority_bytes(4 + (offset - 0xD18), size, value),
            // Software trigger: the number of an interrupt.
            0xF00 => self.pend(16 + (value & 0x7F) as u8, now),
            _ => return false,
        }
        true
    }

    fn set_priority_bytes(&mut self, first: u32, size: usize, value: u32) {
        for byte in 0..size as u32 {
            if let Some(priority) = self.priorities.get_mut((first + byte) as usize) {
                *priority = (value >> (8 * byte)) as u8 & 0xF0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(priorities: &[(u8, u8)]) -> Nvic {
        let mut nvic = Nvic::new();
        for &(interrupt, priority) in priorities {
            nvic.write(0x400 + u32::from(interrupt), 1, priority.into(), 0);
            nvic.write(0x100 + 4 * u32::from(interrupt / 32), 4, 1 << (interrupt % 32), 0);
        }
        nvic
    }

    #[test]
    fn a_line_that_stays_up_makes_its_interrupt_pending_again() {
        let mut nvic = with(&[(18, 0x10)]);
        nvic.set_line(18, true, 5);
        nvic.enter(34);
        assert!(!nvic.is_pending(34));
        nvic.leave(9);
        assert!(nvic.is_pending(34));
        nvic.enter(34);
        nvic.set_line(18, false, 10);
        nvic.leave(11);
        assert!(!nvic.is_pending(34));
    }

    #[test]
    fn a_disabled_interrupt_waits_until_it_is_enabled() {
        let mut nvic = Nvic::new();
        nvic.write(0xF00, 4, 77, 0);
        assert_eq!(nvic.preempting(THREAD), None);
        nvic.write(0x108, 4, 1 << (77 - 64), 0);
        assert_eq!(nvic.preempting(THREAD), Some(16 + 77));
    }
}
