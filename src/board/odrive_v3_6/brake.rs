//! The brake resistor's half bridge, for boards that have one connected.
//!
//! Both compare values are taken over at an end of the counter, which may come between the two writes: so the one that moves
//! away from the other is written first, and at no end are the sides closer than their gap.

use super::registers::{load, store};
use super::settings::chopper::{BASE, TOP, compare};

const LOW: u32 = BASE + 0x3C;
const HIGH: u32 = BASE + 0x40;

/// Share of time for which the resistor is on.
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

/// Share of time for which the resistor is on now.
pub fn duty() -> f32 {
    TOP.saturating_sub(load(HIGH)) as f32 / TOP as f32
}

/// The resistor has a duty.
pub fn is_on() -> bool {
    load(HIGH) < TOP
}
