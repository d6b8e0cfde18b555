//! Driver of the holding brake on GPIO6 (PB2): high releases it, low engages it.
//!
//! In reset the pin floats, so the driver needs a pull-down. Without a brake the pin stays an input, and
//! engaging has no effect.

use super::registers::{apply, store};
use super::settings::pins::{BSRR, HOLDING_BRAKE, port};

/// Register that sets and clears the output.
const LEVEL: u32 = port(HOLDING_BRAKE.port) + BSRR;
const RELEASED: u32 = 1 << HOLDING_BRAKE.number;
const ENGAGED: u32 = 1 << (HOLDING_BRAKE.number + 16);

/// Makes the pin an output, initially low: engaged.
pub fn prepare() {
    apply(&HOLDING_BRAKE.writes());
}

/// Engages the brake by one store.
#[inline]
pub fn engage() {
    store(LEVEL, ENGAGED);
}

/// Releases or engages the brake.
#[inline]
pub fn set(released: bool) {
    store(LEVEL, if released { RELEASED } else { ENGAGED });
}
