//! ADC1 to ADC3: currents of both axes at the middle of their zero vectors, supply and temperatures.
//!
//! ```text
//! TIM1 trigger -> injected: ADC2 B, ADC3 C of axis 0; ADC1 bus voltage, thermistors
//! TIM8 trigger -> regular:  ADC2 B, ADC3 C of axis 1
//! software     -> regular:  ADC1 thermistor of one motor
//! clock 84 MHz / 4 = 21 MHz; 3 + 12 cycles = 0.71 us
//! ```
//!
//! Both shunts of an axis are sampled in the same cycle. ADC2 and ADC3 raise one interrupt, so each shows the
//! other's silence. Axis 1 uses the bus voltage of half a period ago.
//! Source: `Board/v3/Src/adc.c:81-218`, `board.cpp:431-440`, `Inc/main.h:83-90` (on axis 1 PC3 is B and PC2
//! is C); registers RM0090 13.13, triggers tables 68 and 69.

use super::timers::DOWN;
use super::{FAST_TIMER_HZ, Write};

/// First registers of ADC1, ADC2, ADC3.
pub const BASES: [u32; 3] = [0x4001_2000, 0x4001_2100, 0x4001_2200];
/// Common control register ADC_CCR with the prescaler of all three.
const COMMON: u32 = 0x4001_2304;
/// Clock of the converters, Hz.
pub const CLOCK_HZ: u32 = 21_000_000;

/// Offset of the status register.
pub const SR: u32 = 0x00;
/// Offset of the first injected result; three follow.
pub const JDR1: u32 = 0x3C;
/// Offset of the regular result.
pub const DR: u32 = 0x4C;
/// End of the regular conversion.
pub const EOC: u32 = 1 << 1;
/// End of the injected conversions.
pub const JEOC: u32 = 1 << 2;

/// Channels of the shunts of B and C, by axis.
pub const SHUNTS: [[u32; 2]; 2] = [[10, 11], [13, 12]];
/// Channels of bus voltage, bridge of axis 0, bridge of axis 1, chopper: all four injected ranks of ADC1.
pub const SLOW: [u32; 4] = [6, 15, 4, 5];

/// Offset of the register with the channel of a regular conversion.
pub const SQR3: u32 = 0x34;
/// Offset of the register that starts a regular conversion.
pub const CR2: u32 = 0x08;
/// Channels of the thermistors in the motors, by axis: PA0, PA1.
pub const MOTORS: [u32; 2] = [0, 1];

/// Ends of either kind.
pub const ENDS: u32 = JEOC | EOC;

const ON: u32 = 1;
/// Interrupts at the end of regular and injected conversions.
const INTERRUPTS: u32 = 1 << 5 | 1 << 7;
/// Injected conversions by TIM1's trigger (number 1), rising edge.
const INJECTED: u32 = 0b0001 << 16 | 0b01 << 20;
/// Regular conversions by TIM8's trigger (number 14), rising edge.
const REGULAR: u32 = 0b1110 << 24 | 0b01 << 28;
/// Fifteen cycles of sampling for the thermistors' dividers, channels 4 and 5 (SMPR2), 15 (SMPR1). For those
/// in the motors, channels 0 and 1, 480 cycles or 23 us: resistors of 10 kOhm and long wires.
const SLOW_SAMPLING: [u32; 2] = [0b001 << 15, 0b111 | 0b111 << 3 | 0b001 << 12 | 0b001 << 15];

macro_rules! adc {
    ($number:literal, $name:literal, $offset:expr, $value:expr) => {
        Write::whole(concat!("ADC", $number, "_", $name), BASES[$number - 1] + $offset, $value)
    };
}

/// Turns all converters on and sets channels and sequences; nothing triggers them yet. Settling takes 3 us.
pub const CONVERTERS: [Write; 21] = [
    Write::whole("ADC_CCR", COMMON, 0b01 << 16),
    // Scan mode: four injected conversions per trigger.
    adc!(1, "CR1", 0x04, 1 << 8),
    adc!(1, "SMPR1", 0x0C, SLOW_SAMPLING[0]),
    adc!(1, "SMPR2", 0x10, SLOW_SAMPLING[1]),
    adc!(1, "SQR1", 0x2C, 0),
    adc!(1, "JSQR", 0x38, 3 << 20 | SLOW[0] | SLOW[1] << 5 | SLOW[2] << 10 | SLOW[3] << 15),
    adc!(1, "CR2", 0x08, ON),
    adc!(2, "CR1", 0x04, INTERRUPTS),
    adc!(2, "SMPR1", 0x0C, 0),
    adc!(2, "JSQR", 0x38, SHUNTS[0][0] << 15),
    adc!(2, "SQR1", 0x2C, 0),
    adc!(2, "SQR3", 0x34, SHUNTS[1][0]),
    adc!(2, "CR2", 0x08, ON),
    adc!(2, "SR", SR, 0),
    adc!(3, "CR1", 0x04, INTERRUPTS),
    adc!(3, "SMPR1", 0x0C, 0),
    adc!(3, "JSQR", 0x38, SHUNTS[0][1] << 15),
    adc!(3, "SQR1", 0x2C, 0),
    adc!(3, "SQR3", 0x34, SHUNTS[1][1]),
    adc!(3, "CR2", 0x08, ON),
    adc!(3, "SR", SR, 0),
];

/// Enables the timers' triggers; written once the timers run in phase.
pub const TRIGGERED: [Write; 3] = [
    adc!(1, "CR2", 0x08, ON | INJECTED),
    adc!(2, "CR2", 0x08, ON | INJECTED | REGULAR),
    adc!(3, "CR2", 0x08, ON | INJECTED | REGULAR),
];

/// Whether ADC1 converts nothing for the next microsecond, by TIM1's control register and counter: the scan
/// begins at the counter's zero and takes 4.6 us, less than the half period in which the counter rises.
pub const fn is_idle(control: u32, counter: u32) -> bool {
    control & DOWN != 0 && counter > FAST_TIMER_HZ / 1_000_000
}

/// Value of CR2 of ADC1 that starts a regular conversion; the triggers stay.
pub const START: u32 = ON | INJECTED | 1 << 30;

/// Axes with an end in ADC2 or ADC3; `Some(true)` where both have one.
#[inline(always)]
pub const fn finished_axes([one, other]: [u32; 2]) -> [Option<bool>; 2] {
    let (any, both) = (one | other, one & other);
    [
        if any & JEOC != 0 { Some(both & JEOC != 0) } else { None },
        if any & EOC != 0 { Some(both & EOC != 0) } else { None },
    ]
}

/// Value that clears flags of a status register: zeros clear, ones do nothing (rc_w0), so a flag raised
/// meanwhile is not lost.
pub const fn cleared(flags: u32) -> u32 {
    !flags
}
