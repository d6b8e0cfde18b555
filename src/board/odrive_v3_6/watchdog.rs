//! The independent watchdog, by its registers: it has to run before the clocks do, which the driver cannot.
//!
//! Its oscillator runs at 17 to 47 kHz (32 nominal): 16 ms are 11 to 30 ms. Registers RM0090 21.4.

use super::registers::{load, store};

const KEY: u32 = 0x4000_3000;
const PRESCALER: u32 = KEY + 0x04;
const RELOAD: u32 = KEY + 0x08;
const STATUS: u32 = KEY + 0x0C;

const UNLOCK: u32 = 0x5555;
const FEED: u32 = 0xAAAA;
const START: u32 = 0xCCCC;

/// Runs with 4 s: as long as a start may take, and a crystal that does not swing.
pub(super) fn start() {
    store(KEY, START);
    set(6, 500);
}

/// From now on 16 ms.
pub fn tighten() {
    set(0, 127);
}

/// 8 s (5.4 to 15): as long as the flash may stand still. The bridges are released meanwhile.
pub fn stretch() {
    set(6, 1000);
}

fn set(prescaler: u32, reload: u32) {
    // Feeding in between, from a level above, would lock both again.
    critical_section::with(|_| {
        store(KEY, UNLOCK);
        store(PRESCALER, prescaler);
        store(RELOAD, reload);
    });
    // Five of its cycles; a status that stays would be an oscillator that stands, which nothing here can mend.
    for _ in 0..100_000 {
        if load(STATUS) == 0 {
            break;
        }
    }
    feed();
}

/// All is well.
pub fn feed() {
    store(KEY, FEED);
}
