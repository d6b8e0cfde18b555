//! TIM1 and TIM8: both bridges at 24 kHz, half a period apart.
//!
//! ```text
//! counter   0 -> 3500 -> 0, 168 MHz              f = 168 MHz / (2 * 3500) = 24 kHz
//! high side on while counter >= compare          compare = (1 - duty) * 3500          PWM mode 2
//! trigger   when the counter rises to 20     the converters sample from there: low sides on, 0.12 us after 0
//! ```
//!
//! Why half a period: with centred duties the edges of a bridge lie around a quarter and three quarters of
//! its period. They come to its middle, the other bridge's sample, only near the voltage limit
//! (docs/motor.md, section 1).
//!
//! Source: `Board/v3/Inc/main.h:69-75`, `Src/tim.c:77-143`, `board.cpp:388-397`; registers RM0090 17.4.
//! ODrive uses every third update. Here compare values are taken over once a period, at zero, by a repetition
//! counter of 1. With an odd value the update is at the end that follows the register's write (RM0090
//! 17.3.3). So [`repetition`] is written while the counter falls, and the start checks it ([`crate::board`]).

use super::Write;
use crate::hal::SHUNT_TRIGGER_CLOCKS;

/// Timer of each bridge: 0 is the hip's, 1 the knee's.
pub const BASES: [u32; 2] = [0x4001_0000, 0x4001_0400];
/// Top of the counter: half a period.
pub const TOP: u16 = 3500;
/// Dead time, timer clocks: 119 ns.
pub const DEAD_TIME: u32 = 20;
/// Counters at the start, half a period apart: TIM1 rises from zero, TIM8 falls from the top. Writing the top
/// makes the counter fall, zero makes it rise (RM0090 17.3.10, hints on the centre-aligned mode).
pub const START: [u16; 2] = [0, TOP];
/// Largest deviation from half a period that the start accepts, timer clocks: 0.19 us.
pub const SHIFT_TOLERANCE: u16 = 32;

/// Offset of the control register; bit 0 starts the counter.
pub const CR1: u32 = 0x00;
/// Offset of the status register; bit 0 is the update flag.
pub const SR: u32 = 0x10;
/// Offset of the counter.
pub const CNT: u32 = 0x24;
/// Offset of the first compare register; three follow each other.
pub const CCR1: u32 = 0x34;
/// Offset of the register with the main output enable.
pub const BDTR: u32 = 0x44;
/// Main output enable.
pub const MOE: u32 = 1 << 15;
/// Counting down (CR1).
pub const DOWN: u32 = 1 << 4;

/// Centre-aligned, interrupt flags at both ends, reload buffered; dead-time clock undivided.
const CR1_VALUE: u32 = 0b11 << 5 | 1 << 7;
/// Off-state selection for run and idle: outputs are driven to their idle level, low. Main output off, no
/// break input.
const BDTR_VALUE: u32 = DEAD_TIME | 1 << 10 | 1 << 11;
/// PWM mode 2, compare value buffered.
const MODE: u32 = 0b111 << 4 | 1 << 3;
/// Mode and compare value of channel 4; its rising edge triggers the converters.
const TRIGGER: (u32, u32) = trigger(SHUNT_TRIGGER_CLOCKS);
/// Both outputs of channels 1 to 3, active high.
const OUTPUTS: u32 = 0b0101_0101_0101;

/// Mode and compare value of a channel with an output that rises so many clocks after the counter's zero, or
/// before it. PWM mode 2 rises at its compare value while the counter rises, mode 1 while it falls. Zero has
/// no such edge.
const fn trigger(clocks: i16) -> (u32, u32) {
    assert!(clocks != 0 && clocks.unsigned_abs() < TOP);
    let mode = if clocks > 0 { MODE } else { 0b110 << 4 | 1 << 3 };
    (mode, clocks.unsigned_abs() as u32)
}

/// Configures a bridge's timer: stopped, main output off, every phase at one half.
pub const fn bridge(axis: usize) -> [Write; 15] {
    let base = BASES[if axis == 0 { 0 } else { 1 }];
    macro_rules! write {
        ($name:literal, $offset:expr, $value:expr) => {
            Write::whole(
                if axis == 0 { concat!("TIM1_", $name) } else { concat!("TIM8_", $name) },
                base + $offset,
                $value,
            )
        };
    }
    let half = (TOP / 2) as u32;
    [
        write!("BDTR", BDTR, BDTR_VALUE),
        write!("CR1", CR1, CR1_VALUE),
        write!("CR2", 0x04, 0),
        write!("SMCR", 0x08, 0),
        write!("DIER", 0x0C, 0),
        write!("CCMR1", 0x18, MODE | MODE << 8),
        write!("CCMR2", 0x1C, MODE | TRIGGER.0 << 8),
        write!("PSC", 0x28, 0),
        write!("ARR", 0x2C, TOP as u32),
        write!("RCR", 0x30, 0),
        write!("CCR1", CCR1, half),
        write!("CCR2", CCR1 + 4, half),
        write!("CCR3", CCR1 + 8, half),
        write!("CCR4", CCR1 + 12, TRIGGER.1),
        // Loads the buffered values now.
        write!("EGR", 0x14, 1),
    ]
}

/// Enables the channels and sets the counters; the last writes before the start.
pub const fn ready() -> [Write; 4] {
    [
        Write::whole("TIM1_CCER", BASES[0] + 0x20, OUTPUTS),
        Write::whole("TIM8_CCER", BASES[1] + 0x20, OUTPUTS),
        Write::whole("TIM1_CNT", BASES[0] + CNT, START[0] as u32),
        Write::whole("TIM8_CNT", BASES[1] + CNT, START[1] as u32),
    ]
}

/// Starts both: TIM1's enable starts TIM8 in the same cycle (its internal trigger 0 is TIM1,
/// RM0090 table 93).
pub const LOCK_AND_START: [Write; 3] = [
    Write::whole("TIM1_CR2", BASES[0] + 0x04, 0b001 << 4),
    Write::whole("TIM8_SMCR", BASES[1] + 0x08, 0b110),
    Write::whole("TIM1_CR1", BASES[0] + CR1, CR1_VALUE | 1),
];

/// With both timers running, makes channel 4 of each trigger the converters.
pub const TRIGGERS: [Write; 3] = [
    Write::whole("TIM8_SMCR", BASES[1] + 0x08, 0),
    Write::whole("TIM1_CR2", BASES[0] + 0x04, 0b111 << 4),
    Write::whole("TIM8_CR2", BASES[1] + 0x04, 0b111 << 4),
];

/// Takes compare values over at every second end; to be written while the counter falls.
pub const fn repetition(axis: usize) -> Write {
    if axis == 0 {
        Write::whole("TIM1_RCR", BASES[0] + 0x30, 1)
    } else {
        Write::whole("TIM8_RCR", BASES[1] + 0x30, 1)
    }
}

/// Whether two counters run half a period apart, from three equally spaced reads: the falling counter, the
/// rising one, the falling one again.
pub fn half_a_period_apart([before, rising, after]: [u16; 3]) -> bool {
    let twice = u32::from(before) + u32::from(after) + 2 * u32::from(rising);
    twice.abs_diff(2 * u32::from(TOP)) <= 2 * u32::from(SHIFT_TOLERANCE)
}

/// Compare value of a duty. Duties outside 0..=1 are clamped, NaN counts as 0 (low side on).
pub fn compare(duty: f32) -> u16 {
    let high = duty * f32::from(TOP) + 0.5;
    // One instruction converts to 32 bits and saturates; a conversion to 16 bits would compare each limit.
    TOP - (high as u32).min(u32::from(TOP)) as u16
}
