//! Crash handling of this board: both bridges off by two stores, then the holding brake engaged by one. A
//! failure of the crystal counts as a crash.
#![expect(unsafe_code, reason = "a name that the crash handler finds at link time, and a vector")]

use cortex_m::peripheral::DWT;
use cortex_m_rt::exception;

use super::bridge;
use super::registers::apply;
use super::settings::CLOCK_FAILURE_SEEN;
use crate::board::crash::{CrashCause, give_up};

/// First step of every crash.
#[unsafe(no_mangle)]
extern "C" fn scarab_disable_all() -> u32 {
    bridge::disable_all();
    DWT::cycle_count()
}

/// Failure of the crystal: the processor and the bridges' timers run on the internal oscillator until the
/// outputs are off.
#[exception]
unsafe fn NonMaskableInt() {
    bridge::disable_all();
    apply(&[CLOCK_FAILURE_SEEN]);
    give_up(CrashCause::Clock, 0)
}
