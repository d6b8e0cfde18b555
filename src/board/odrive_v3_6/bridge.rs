//! Both bridges: three compare values, and the main output that lets them through.
//!
//! Switching off is one store for each bridge, needs nothing else to work, and may be done from anywhere, also from a fault
//! handler. Switching on is the current loop's alone.

use super::registers::store;
use super::settings::timers::{BASES, BDTR, CCR1, MOE, bridge, compare};
use crate::hal::AxisCommand;

/// Register with the main output as the start wrote it: output off.
const RELEASED: u32 = bridge(0)[0].value;

/// Both bridges off, now.
#[inline]
pub fn release_all() {
    store(BASES[0] + BDTR, RELEASED);
    store(BASES[1] + BDTR, RELEASED);
}

/// What an axis' bridge does in the next period.
#[inline]
pub fn set(axis: usize, command: &AxisCommand) {
    let Some(&base) = BASES.get(axis) else { return };
    if command.enabled {
        let [a, b, c] = command.duty;
        store(base + CCR1, compare(a).into());
        store(base + CCR1 + 4, compare(b).into());
        store(base + CCR1 + 8, compare(c).into());
        store(base + BDTR, RELEASED | MOE);
    } else {
        store(base + BDTR, RELEASED);
    }
}
