//! Both bridges, as far as the emulator has them: what is written to their timers' registers, it logs.
//!
//! The current loops' answer goes nowhere here ([`super::axes`]), so nothing is ever switched on; what a crash switches off are
//! the board's registers with the board's values, and QEMU (`-d unimp`) is the witness of when.
#![expect(unsafe_code, reason = "device registers, and a name that the crash handler finds at link time")]

use scarab::board::odrive_v3_6::settings::timers::{BASES, BDTR, bridge};

use super::clock;

/// Register with the main output, output off.
const RELEASED: u32 = bridge(0)[0].value;

/// Called by every crash, before anything else.
#[unsafe(no_mangle)]
extern "C" fn scarab_release() -> u32 {
    for base in BASES {
        let register = (base + BDTR) as *mut u32;
        // SAFETY: a register of a timer that the emulated machine maps without having it: nothing but its log hears of it.
        unsafe { register.write_volatile(RELEASED) }
    }
    clock::instructions()
}
