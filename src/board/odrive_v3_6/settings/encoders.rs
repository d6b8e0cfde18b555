//! TIM3 and TIM4 count the encoders of axis 0 and 1, all four edges of a line; the index pulses come by external interrupt.
//!
//! A count is taken when a level has lasted for six samples of half the timer's clock: 0.14 us.
//! Source: `Board/v3/board.cpp:98-107,218-221`, `Src/tim.c:195-246`; registers RM0090 18.4 and 12.3.

use super::Write;

/// TIM3, TIM4.
pub const BASES: [u32; 2] = [0x4000_0400, 0x4000_0800];
/// Offset of the counter.
pub const CNT: u32 = 0x24;
/// Lines of the external interrupts of the index pulses: PC9, PC15.
pub const INDEX_LINES: [u32; 2] = [9, 15];

/// External interrupt controller.
const EXTI: u32 = 0x4001_3C00;
const SYSCFG: u32 = 0x4001_3800;
/// Pending lines; a one clears.
pub const PENDING: u32 = EXTI + 0x14;

/// Both inputs as they are, filter 4.
const INPUTS: u32 = 0b01 | 0b0100 << 4;

const fn encoder(base: u32, names: [&'static str; 5]) -> [Write; 5] {
    [
        Write::whole(names[0], base + 0x18, INPUTS | INPUTS << 8),
        Write::whole(names[1], base + 0x20, 0),
        Write::whole(names[2], base + 0x2C, 0xFFFF),
        // Counts on the edges of both inputs.
        Write::whole(names[3], base + 0x08, 0b011),
        Write::whole(names[4], base, 1),
    ]
}

/// Both counters, running.
pub const ENCODERS: [[Write; 5]; 2] = [
    encoder(BASES[0], ["TIM3_CCMR1", "TIM3_CCER", "TIM3_ARR", "TIM3_SMCR", "TIM3_CR1"]),
    encoder(BASES[1], ["TIM4_CCMR1", "TIM4_CCER", "TIM4_ARR", "TIM4_SMCR", "TIM4_CR1"]),
];

/// Lines 9 and 15 on port C, rising edge.
pub const INDEX: [Write; 5] = [
    Write::bits("SYSCFG_EXTICR3", SYSCFG + 0x10, 0xF << 4, 2 << 4),
    Write::bits("SYSCFG_EXTICR4", SYSCFG + 0x14, 0xF << 12, 2 << 12),
    Write::bits("EXTI_RTSR", EXTI + 0x08, LINES, LINES),
    Write::whole("EXTI_PR", PENDING, LINES),
    Write::bits("EXTI_IMR", EXTI, LINES, LINES),
];

const LINES: u32 = 1 << INDEX_LINES[0] | 1 << INDEX_LINES[1];
