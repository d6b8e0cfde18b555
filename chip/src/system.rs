//! System control block and debug registers in the processor's private address range (ARMv7-M B3.2, C1.6).

use crate::chip::Chip;
use crate::findings::{Access, NOT_MODELLED};
use crate::nvic::{NMI, PENDING_SERVICE, SYSTEM_TICK};
use crate::peripherals::rcc::ResetReason;

/// First address of the private range.
pub const PRIVATE: u32 = 0xE000_0000;
const DEBUG_UNIT: u32 = 0x4_2000;

/// Bits of the fault status register.
pub mod fault {
    /// Instruction fetch from an address without memory.
    pub const FETCH: u32 = 1 << 8;
    /// Data access to an address without memory; its address is known.
    pub const DATA: u32 = 1 << 9 | 1 << 15;
    /// Stacking of an exception's frame failed.
    pub const STACKING: u32 = 1 << 12;
    /// Unknown instruction.
    pub const INSTRUCTION: u32 = 1 << 16;
}

/// Registers of the system control block.
#[derive(Clone, Debug, Default)]
pub struct System {
    /// Address of the vector table; 0 is the flash.
    pub vectors: u32,
    control: u32,
    /// Configurable fault status, hard fault status, address of a bus fault.
    pub faults: [u32; 2],
    pub fault_address: u32,
    coprocessors: u32,
    floating_point: [u32; 3],
}

impl Chip {
    /// Reads a register of the private range.
    pub fn read_private(&mut self, offset: u32, size: usize) -> u32 {
        let system = &self.system;
        match offset {
            0x1000 => u32::from(self.debug.counts) | 0x4000_0000,
            0x1004 => self.debug.cycles(self.now),
            0xE004 => 2,
            0xED00 => 0x410F_C241,
            0xED04 => self.nvic.state(),
            0xED08 => system.vectors,
            0xED0C => 0xFA05_0000 | self.nvic.group << 8,
            0xED10 => system.control,
            0xED14 => 0x200,
            0xED28 => system.faults[0],
            0xED2C => system.faults[1],
            0xED38 => system.fault_address,
            0xED24 | 0xED30..=0xED3C | 0xEDF0 => 0,
            0xED88 => system.coprocessors,
            0xED90 => 0x800,
            0xEDFC => u32::from(self.debug.trace) << 24,
            0xEF34 => system.floating_point[0] | 0xC000_0000,
            0xEF38 | 0xEF3C => system.floating_point[(offset as usize - 0xEF34) / 4],
            0xEF40 => 0x1011_0021,
            0xEF44 => 0x1100_0011,
            0xE000..0xF000 => self.nvic.read(offset - 0xE000, size),
            _ if offset & !0x3FF == DEBUG_UNIT => {
                let access = &mut Access { now: self.now, findings: &mut self.findings };
                self.debug.read(offset & 0x3FF, access)
            }
            _ => {
                self.findings.add(NOT_MODELLED, format!("{:#010x}", PRIVATE + offset));
                0
            }
        }
    }

    /// Writes a register of the private range.
    pub fn write_private(&mut self, offset: u32, size: usize, value: u32) {
        match offset {
            0x1000 => self.debug.enable(None, Some(value & 1 == 1), self.now),
            0x1004 => self.debug.set_cycles(value, self.now),
            0xED04 => {
                for (bit, exception) in [(31, NMI), (28, PENDING_SERVICE), (26, SYSTEM_TICK)] {
                    if value >> bit & 1 == 1 {
                        self.nvic.pend(exception, self.now);
                    } else if exception != NMI && value >> (bit - 1) & 1 == 1 {
                        self.nvic.unpend(exception);
                    }
                }
            }
            0xED08 => self.system.vectors = value & !0x1FF,
            0xED0C => self.write_reset(value),
            0xED10 => {
                if value & !0x10 != 0 {
                    self.findings.add(NOT_MODELLED, "SCB_SCR");
                }
                self.system.control = value;
            }
            0xED14 | 0xED24 => {
                if value & !0x200 != 0 {
                    self.findings.add(NOT_MODELLED, format!("{:#010x}", PRIVATE + offset));
                }
            }
            // Ones clear.
            0xED28 | 0xED2C => self.system.faults[(offset as usize - 0xED28) / 4] &= !value,
            0xED88 => self.system.coprocessors = value,
            0xEDFC => self.debug.enable(Some(value >> 24 & 1 == 1), None, self.now),
            0xEF34..=0xEF3C => self.system.floating_point[(offset as usize - 0xEF34) / 4] = value,
            0xE100..0xF000 => {
                if !self.nvic.write(offset - 0xE000, size, value, self.now) {
                    self.findings.add(NOT_MODELLED, format!("{:#010x}", PRIVATE + offset));
                }
            }
            _ if offset & !0x3FF == DEBUG_UNIT => {
                let access = &mut Access { now: self.now, findings: &mut self.findings };
                self.debug.write(offset & 0x3FF, value, access);
            }
            _ => self.findings.add(NOT_MODELLED, format!("{:#010x}", PRIVATE + offset)),
        }
    }

    fn write_reset(&mut self, value: u32) {
        if value >> 16 != 0x05FA {
            return self.findings.add("written without its key", "SCB_AIRCR");
        }
        self.nvic.group = value >> 8 & 7;
        if value & 4 != 0 {
            self.reset_request = Some(ResetReason::Software);
        }
    }

    /// Whether a pending interrupt wakes the processor even if it is masked (SEVONPEND).
    pub const fn wakes_when_pending(&self) -> bool {
        self.system.control & 0x10 != 0
    }
}
