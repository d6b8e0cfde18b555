//! Both bridges: three compare values, and the main output that lets them through.
//!
//! Switching off is one store for each bridge, needs nothing else to work, and may be done from anywhere, also from a fault
//! handler. Switching on is the current loop's alone.

use super::registers::{load, store};
use super::settings::timers::{BASES, BDTR, CCR1, MOE, TOP, bridge, compare};
use crate::hal::AxisCommand;

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
        // Compare values are taken over once a period, the main output at once: the first period after the bridge is let
        // through would have the duties of the last one before it was released. Half and half is no voltage.
        for channel in [CCR1, CCR1 + 4, CCR1 + 8] {
            store(base + channel, NO_VOLTAGE);
        }
    }
}
