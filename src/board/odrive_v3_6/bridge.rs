//! Both bridges: three compare values each, and the main output enable.
//!
//! Switching off is one store for each bridge, has no preconditions, and is allowed anywhere, also in a fault
//! handler. One more store engages the holding brake, after both bridges. Only the current loop switches on.

use super::holding_brake;
use super::registers::{load, store};
use super::settings::timers::{BASES, BDTR, CCR1, MOE, TOP, bridge, compare};

/// BDTR as the start wrote it: main output off.
const OFF: u32 = bridge(0)[0].value;

/// All three duties one half.
const NO_VOLTAGE: u32 = TOP as u32 / 2;

/// Turns both bridges off at once, then engages the holding brake.
#[inline]
pub fn disable_all() {
    store(BASES[0] + BDTR, OFF);
    store(BASES[1] + BDTR, OFF);
    holding_brake::engage();
}

/// Whether both bridges are off.
pub fn are_disabled() -> bool {
    BASES.iter().all(|base| load(base + BDTR) & MOE == 0)
}

/// Turns one bridge off at once.
///
/// Compare values are taken over once a period, the main output at once. So the first period after enabling
/// would have the duties of the last period before. This function therefore sets the duties to one half,
/// which is no voltage.
#[inline]
pub fn disable(axis: usize) {
    let Some(&base) = BASES.get(axis) else { return };
    store(base + BDTR, OFF);
    for channel in [CCR1, CCR1 + 4, CCR1 + 8] {
        store(base + channel, NO_VOLTAGE);
    }
}

/// Sets the duties of a bridge for its next period.
#[inline]
pub fn set_duty(axis: usize, duty: &[f32; 3]) {
    let Some(&base) = BASES.get(axis) else { return };
    let [a, b, c] = *duty;
    store(base + CCR1, compare(a).into());
    store(base + CCR1 + 4, compare(b).into());
    store(base + CCR1 + 8, compare(c).into());
}

/// Switches the outputs of a bridge on. Call only with interrupts masked and after reading the inhibit word:
/// a stop that comes after the read then switches the outputs off again.
#[inline]
pub fn enable(axis: usize) {
    if let Some(&base) = BASES.get(axis) {
        store(base + BDTR, OFF | MOE);
    }
}
