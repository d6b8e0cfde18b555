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

/// Longest wait where nobody else runs yet: 0.1 s of a loop of eight cycles at 168 MHz. A time that was written counts after six cycles of
/// the oscillator behind the divider, 91 ms at the slowest.
const PATIENCE: u32 = 2_000_000;

/// Runs with 4 s: as long as a start may take, and a crystal that does not swing.
pub(super) fn start() {
    store(KEY, START);
    // One that does not take them has half a second, and bites in it.
    let _ = (0..PATIENCE).any(|_| set(6, 500));
}

/// From now on 16 ms; waits until they hold. Whether they do.
pub fn tighten_at_once() -> bool {
    (0..PATIENCE).any(|_| tighten())
}

/// Asks for 16 ms; whether it has them: to be asked again until it has.
pub fn tighten() -> bool {
    set(0, 127)
}

/// Asks for 8 s (5.4 to 15): as long as the flash may stand still. The bridges are released meanwhile. Whether it has them, as above.
pub fn stretch() -> bool {
    set(6, 1000)
}

/// While an earlier write is under way (PVU, RVU) another is ignored and what is read means nothing: then nothing is done.
fn set(prescaler: u32, reload: u32) -> bool {
    if load(STATUS) != 0 {
        return false;
    }
    if (load(PRESCALER), load(RELOAD)) == (prescaler, reload) {
        feed();
        return true;
    }
    // Feeding in between, from a level above, would lock both again.
    critical_section::with(|_| {
        store(KEY, UNLOCK);
        store(PRESCALER, prescaler);
        store(RELOAD, reload);
    });
    false
}

/// All is well.
pub fn feed() {
    store(KEY, FEED);
}
