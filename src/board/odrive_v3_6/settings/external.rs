//! External interrupts: index pulses of both encoders, and the opening of the emergency stop's contact.
//!
//! Source: registers RM0090 9.2 and 12.3; line numbers equal pin numbers.

use super::Write;

/// Lines of the index pulses: PC9, PC15.
pub const INDEX_LINES: [u32; 2] = [9, 15];
/// Line of the emergency stop's contact: PC4.
pub const STOP_LINE: u32 = 4;

/// External interrupt controller.
const EXTI: u32 = 0x4001_3C00;
const SYSCFG: u32 = 0x4001_3800;
/// Register of pending lines; a one clears.
pub const PENDING: u32 = EXTI + 0x14;

/// All lines on port C: rising edges of the index pulses, falling edge of the contact.
pub const EXTERNAL: [Write; 7] = [
    Write::bits("SYSCFG_EXTICR2", SYSCFG + 0x0C, 0xF, 2),
    Write::bits("SYSCFG_EXTICR3", SYSCFG + 0x10, 0xF << 4, 2 << 4),
    Write::bits("SYSCFG_EXTICR4", SYSCFG + 0x14, 0xF << 12, 2 << 12),
    Write::bits("EXTI_RTSR", EXTI + 0x08, LINES, INDICES),
    Write::bits("EXTI_FTSR", EXTI + 0x0C, LINES, 1 << STOP_LINE),
    Write::whole("EXTI_PR", PENDING, LINES),
    Write::bits("EXTI_IMR", EXTI, LINES, LINES),
];

/// Write that masks a line.
pub const fn masked(line: u32) -> Write {
    Write::bits("EXTI_IMR", EXTI, 1 << line, 0)
}

const INDICES: u32 = 1 << INDEX_LINES[0] | 1 << INDEX_LINES[1];
const LINES: u32 = INDICES | 1 << STOP_LINE;
