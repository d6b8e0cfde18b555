//! Both bridges as far as the emulator models them: QEMU logs writes to their timers' registers.
//!
//! The current loops' commands are discarded here ([`super::axes`]), so no bridge is ever turned on. A crash
//! writes the board's values to the board's registers, and QEMU's log (`-d unimp`) shows the time.
#![expect(unsafe_code, reason = "device registers, and a name that the crash handler finds at link time")]

use scarab::board::odrive_v3_6::settings::timers::{BASES, BDTR, bridge};

use super::clock;

/// Register value with the main output off.
const OFF: u32 = bridge(0)[0].value;

/// First step of every crash.
#[unsafe(no_mangle)]
extern "C" fn scarab_disable_all() -> u32 {
    for base in BASES {
        let register = (base + BDTR) as *mut u32;
        // SAFETY: a register of a timer that the emulated machine maps without modelling it: the write only
        // appears in the log.
        unsafe { register.write_volatile(OFF) }
    }
    clock::instructions()
}
