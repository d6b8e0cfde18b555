//! Half bridge of the brake resistor, for boards with one connected.
//!
//! The timer takes over both compare values at an end of the counter, which may come between the two writes.
//! So the value that moves away from the other is written first, and at no end are the sides closer than
//! their gap.

use super::registers::{load, store};
use super::settings::chopper::{BASE, TOP, compare};

const LOW: u32 = BASE + 0x3C;
const HIGH: u32 = BASE + 0x40;

/// Sets the duty of the resistor.
#[inline(always)]
pub fn set(duty: f32) {
    let [low, high] = compare(duty);
    if u32::from(high) > load(HIGH) {
        store(HIGH, high.into());
        store(LOW, low.into());
    } else {
        store(LOW, low.into());
        store(HIGH, high.into());
    }
}

/// Present duty of the resistor.
pub fn duty() -> f32 {
    TOP.saturating_sub(load(HIGH)) as f32 / TOP as f32
}

/// Whether the resistor has a duty.
pub fn is_on() -> bool {
    load(HIGH) < TOP
}
