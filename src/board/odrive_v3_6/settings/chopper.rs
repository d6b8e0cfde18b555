//! TIM2: the half bridge of the brake resistor.
//!
//! ```text
//! low side (channel 3) on while counter < low      off state: low = 0, high = 4097
//! high side (channel 4) on while counter >= high   duty = 1 - high / 4096,  low <= high - 40
//! 84 MHz / (2 * 4096) = 10.25 kHz
//! ```
//!
//! No hardware separates both sides, only the compare values do.
//! Source: `Board/v3/Inc/main.h:72-74`, `Src/tim.c:158-186`, `MotorControl/low_level.cpp:97-136`; registers
//! RM0090 18.4. Without a brake resistor the off state remains.

use super::Write;

/// First register of TIM2.
pub const BASE: u32 = 0x4000_0000;
/// Top of the counter.
pub const TOP: u32 = 4096;
/// Least distance of both sides, counts of the timer: 0.48 us.
pub const GAP: u32 = 40;

/// Starts the timer in its off state; pins are connected afterwards. The buffered compare values are loaded
/// before an output is enabled. Otherwise the reset's zeros would keep the high side on until the counter's
/// first end, 49 us later.
pub const CHOPPER: [Write; 7] = [
    // PWM mode 2, compare values buffered.
    Write::whole("TIM2_CCMR2", BASE + 0x1C, 0x7878),
    Write::whole("TIM2_ARR", BASE + 0x2C, TOP),
    Write::whole("TIM2_CCR3", BASE + 0x3C, 0),
    Write::whole("TIM2_CCR4", BASE + 0x40, TOP + 1),
    Write::whole("TIM2_EGR", BASE + 0x14, 1),
    // Channel 3 active low.
    Write::whole("TIM2_CCER", BASE + 0x20, 1 << 8 | 1 << 9 | 1 << 12),
    Write::whole("TIM2_CR1", BASE, 0b11 << 5 | 1),
];

/// Compare values of the low and the high side for a duty of the resistor. Duties outside 0..=0.95 are
/// clamped, NaN counts as 0. The values are never less than [`GAP`] apart.
pub fn compare(duty: f32) -> [u16; 2] {
    let on = (duty * TOP as f32) as u32;
    let high = TOP - on.min(TOP * 95 / 100);
    [(high - GAP) as u16, high as u16]
}
