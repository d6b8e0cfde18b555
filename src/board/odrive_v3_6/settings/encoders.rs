//! TIM3 and TIM4 count the encoders of axis 0 and 1, all four edges of a line.
//!
//! The index pulses use external interrupts (`external`).
//!
//! An edge counts when its level has lasted for six samples of half the timer's clock: 0.14 us.
//! Source: `Board/v3/board.cpp:98-107,218-221`, `Src/tim.c:195-246`; registers RM0090 18.4.

use super::Write;

/// First registers of TIM3 and TIM4.
pub const BASES: [u32; 2] = [0x4000_0400, 0x4000_0800];
/// Offset of the counter.
pub const CNT: u32 = 0x24;
/// Both inputs direct, filter 4.
const INPUTS: u32 = 0b01 | 0b0100 << 4;

const fn encoder(base: u32, names: [&'static str; 5]) -> [Write; 5] {
    [
        Write::whole(names[0], base + 0x18, INPUTS | INPUTS << 8),
        Write::whole(names[1], base + 0x20, 0),
        Write::whole(names[2], base + 0x2C, 0xFFFF),
        // Encoder mode 3: counts on the edges of both inputs.
        Write::whole(names[3], base + 0x08, 0b011),
        Write::whole(names[4], base, 1),
    ]
}

/// Configures and starts both counters.
pub const ENCODERS: [[Write; 5]; 2] = [
    encoder(BASES[0], ["TIM3_CCMR1", "TIM3_CCER", "TIM3_ARR", "TIM3_SMCR", "TIM3_CR1"]),
    encoder(BASES[1], ["TIM4_CCMR1", "TIM4_CCER", "TIM4_ARR", "TIM4_SMCR", "TIM4_CR1"]),
];

/// Whether an index pulse is a glitch: the count is that of the last two samples, and the line is low again.
/// `sampled` has the newest count in its lower half. At such a speed a true index, which is at least one
/// count wide, lasts for 42 us, longer than the interrupt's latency. In motion the line of a true index may
/// already be low.
pub const fn is_glitch(sampled: u32, count: u16, is_high: bool) -> bool {
    !is_high && sampled as u16 == count && (sampled >> 16) as u16 == count
}

#[cfg(test)]
mod tests {
    use super::is_glitch;

    #[test]
    fn an_index_line_that_is_low_again_is_a_glitch_at_rest_alone() {
        assert!(is_glitch(0x1234_1234, 0x1234, false));
        assert!(!is_glitch(0x1234_1234, 0x1234, true), "a rotor that stands on its index");
        for (sampled, count) in [(0x1233_1234, 0x1234), (0x1234_1234, 0x1235), (0x1234_1233, 0x1233)] {
            assert!(!is_glitch(sampled, count, false), "{sampled:x} {count:x}");
        }
    }
}
