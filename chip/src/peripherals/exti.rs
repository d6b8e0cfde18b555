//! External interrupts and the selection of their ports (RM0090 9.2, 12.2, 12.3).
//!
//! An edge of the selected port's pin sets a pending bit if it is enabled for that direction; writing a one
//! clears it. Lines 0 to 4 have an interrupt each, 5 to 9 and 10 to 15 share one.

use crate::findings::{Access, NO_REGISTER, NOT_MODELLED};

/// Lines of the chip.
const LINES: u32 = 0x007F_FFFF;
/// Interrupts of lines 0 to 4, of 5 to 9 and of 10 to 15, with their lines.
const INTERRUPTS: [(u8, u32); 7] = [(6, 1), (7, 2), (8, 4), (9, 8), (10, 0x10), (23, 0x3E0), (40, 0xFC00)];

/// State of the external interrupts.
#[derive(Clone, Debug, Default)]
pub struct Exti {
    mask: u32,
    events: u32,
    rising: u32,
    falling: u32,
    pending: u32,
    selection: [u32; 4],
    remap: [u32; 2],
}

impl Exti {
    /// Reports an edge of a pin (port number, pin).
    pub fn edge(&mut self, port: u32, pin: u32, rises: bool) {
        let selected = self.selection[(pin / 4) as usize % 4] >> (4 * (pin % 4)) & 0xF;
        let enabled = if rises { self.rising } else { self.falling };
        if selected == port {
            self.pending |= enabled & 1 << pin;
        }
    }

    /// Interrupt lines and their levels.
    pub fn lines(&self) -> [(u8, bool); 7] {
        INTERRUPTS.map(|(interrupt, lines)| (interrupt, self.pending & self.mask & lines != 0))
    }

    /// Reads a register of the external interrupts.
    pub fn read(&self, offset: u32, access: &mut Access<'_>) -> u32 {
        match offset {
            0x00 => self.mask,
            0x04 => self.events,
            0x08 => self.rising,
            0x0C => self.falling,
            0x10 => 0,
            0x14 => self.pending,
            _ => access.no_register(format!("EXTI+{offset:#x}")),
        }
    }

    /// Writes a register of the external interrupts.
    pub fn write(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        let value = access.implemented(value, LINES, "EXTI");
        match offset {
            0x00 => self.mask = value,
            0x04 => self.events = value,
            0x08 => self.rising = value,
            0x0C => self.falling = value,
            0x10 => self.pending |= value & self.mask,
            0x14 => self.pending &= !value,
            _ => access.refuse(NO_REGISTER, format!("EXTI+{offset:#x}")),
        }
    }

    /// Reads a register of the system configuration.
    pub fn read_selection(&self, offset: u32, access: &mut Access<'_>) -> u32 {
        match offset {
            0x00 | 0x04 => self.remap[offset as usize / 4],
            0x08..=0x14 => self.selection[(offset as usize - 8) / 4],
            // The compensation cell is off.
            0x20 => 0,
            _ => access.no_register(format!("SYSCFG+{offset:#x}")),
        }
    }

    /// Writes a register of the system configuration.
    pub fn write_selection(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        match offset {
            0x00 | 0x04 => {
                if value != 0 {
                    access.refuse(NOT_MODELLED, format!("SYSCFG+{offset:#x}"));
                }
                self.remap[offset as usize / 4] = value;
            }
            0x08..=0x14 => {
                self.selection[(offset as usize - 8) / 4] =
                    access.implemented(value, 0xFFFF, "SYSCFG_EXTICR");
            }
            0x20 => access.refuse(NOT_MODELLED, "SYSCFG_CMPCR"),
            _ => access.refuse(NO_REGISTER, format!("SYSCFG+{offset:#x}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    #[test]
    fn an_edge_counts_for_its_port_and_direction_and_a_one_clears_it() {
        let (mut exti, mut findings) = (Exti::default(), Findings::default());
        let access = &mut Access { now: 0, findings: &mut findings };
        exti.write_selection(0x0C, 2, access);
        exti.write(0x0C, 1 << 4, access);
        exti.write(0x00, 1 << 4, access);
        exti.edge(1, 4, false);
        exti.edge(2, 4, true);
        assert_eq!(exti.read(0x14, access), 0);
        exti.edge(2, 4, false);
        assert!(exti.lines().contains(&(10, true)));
        exti.write(0x14, 1 << 4, access);
        assert!(exti.lines().contains(&(10, false)));
    }
}
