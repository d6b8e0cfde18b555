//! TIM3 and TIM4 count the encoders of axis 0 and 1, all four edges of a line; the index pulses come by external interrupt
//! (`external`).
//!
//! A count is taken when a level has lasted for six samples of half the timer's clock: 0.14 us.
//! Source: `Board/v3/board.cpp:98-107,218-221`, `Src/tim.c:195-246`; registers RM0090 18.4.

use super::Write;

/// TIM3, TIM4.
pub const BASES: [u32; 2] = [0x4000_0400, 0x4000_0800];
/// Offset of the counter.
pub const CNT: u32 = 0x24;
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
