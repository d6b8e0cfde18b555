//! Both bridges: three compare values, and the main output that lets them through.
//!
//! Switching off is one store for each bridge, needs nothing else to work, and may be done from anywhere, also from a fault
//! handler. Switching on is the current loop's alone.

use super::registers::{load, store};
use super::settings::timers::{BASES, BDTR, CCR1, MOE, TOP, bridge, compare};

/// Register with the main output as the start wrote it: output off.
const RELEASED: u32 = bridge(0)[0].value;

/// All three outputs half of the time.
const NO_VOLTAGE: u32 = TOP as u32 / 2;

/// Both bridges off, now.
#[inline]
pub fn release_all() {
    store(BASES[0] + BDTR, RELEASED);
    store(BASES[1] + BDTR, RELEASED);
}

/// Neither bridge lets anything through.
pub fn are_released() -> bool {
    BASES.iter().all(|base| load(base + BDTR) & MOE == 0)
}

/// One bridge off, now.
///
/// Compare values are taken over once a period, the main output at once: the first period after the bridge is enabled would have the
/// duties of the last one before it was released. So the duties are set to half, which is no voltage.
#[inline]
pub fn release(axis: usize) {
    let Some(&base) = BASES.get(axis) else { return };
    store(base + BDTR, RELEASED);
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

/// Switches the outputs of a bridge on. Only with interrupts masked, and after a look at the inhibit word: a stop that comes after
/// the look switches them off again.
#[inline]
pub fn enable(axis: usize) {
    if let Some(&base) = BASES.get(axis) {
        store(base + BDTR, RELEASED | MOE);
    }
}
