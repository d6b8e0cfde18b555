//! Independent watchdog on registers: it must run before the clocks do, which the driver cannot provide.
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

/// Longest wait before other levels run: 0.1 s of a loop of eight cycles at 168 MHz. A new time applies after
/// six cycles of the oscillator behind the divider, 91 ms at the slowest.
const PATIENCE: u32 = 2_000_000;

/// Starts the watchdog with its long time: enough for the start and a crystal that does not oscillate.
pub(super) fn start() {
    store(KEY, START);
    // A watchdog that rejects these values runs with half a second, and resets within it.
    let _ = (0..PATIENCE).any(|_| stretch());
}

/// Sets 16 ms and waits until they apply. Returns whether they do.
pub fn tighten_at_once() -> bool {
    (0..PATIENCE).any(|_| tighten())
}

/// Requests 16 ms. Returns whether they apply; call again until they do.
pub fn tighten() -> bool {
    set(0, 127)
}

/// Requests the long time, 4 s (2.7 to 7.5): longer than the erase of a sector, 2 s at most. The bridges must
/// be off. Returns whether it applies, as [`tighten`].
pub fn stretch() -> bool {
    set(6, 500)
}

/// Writes prescaler and reload. While an earlier write is in progress (PVU, RVU) a write is ignored and reads
/// are invalid, so nothing is done.
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

/// Restarts the watchdog's count.
pub fn feed() {
    store(KEY, FEED);
}
