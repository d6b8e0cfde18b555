//! What a crash does on this board: both bridges off by two stores; and the crystal's failure, which is a crash.
#![expect(unsafe_code, reason = "a name that the crash handler finds at link time, and a vector")]

use cortex_m::peripheral::DWT;
use cortex_m_rt::exception;

use super::bridge;
use super::registers::apply;
use super::settings::CLOCK_FAILURE_SEEN;
use crate::board::crash::{Cause, give_up};

/// Called by every crash, before anything else.
#[unsafe(no_mangle)]
extern "C" fn scarab_release() -> u32 {
    bridge::release_all();
    DWT::cycle_count()
}

/// The crystal failed: the processor runs on its own oscillator, and so do the bridges' timers until they are released here.
#[exception]
unsafe fn NonMaskableInt() {
    bridge::release_all();
    apply(&[CLOCK_FAILURE_SEEN]);
    give_up(Cause::Clock, 0)
}
