//! Contacts: emergency stop, enabling switch, start button, and the fault line of the gate drivers.
//!
//! All contacts of the operator are closed to 3.3 V when they say "go", so that a wire that breaks says "stop". GPIO5 (PC4),
//! the emergency stop, has no noise filter on the board: what is open for a microsecond stops, and only the operator starts again.
//! The gate drivers' fault line has to stay low as long. Why: `safety::interlock`.
//!
//! The sense is looked at in each current tick. Besides, its opening is an interrupt above all others: it releases both bridges
//! where the current loops hang or no longer come. A tick that it interrupts reads the inhibit word again, with interrupts masked, before it
//! switches outputs on (`operation::CurrentLoops`).

use super::bridge;
use super::registers::{load, store};
use super::settings::external::{PENDING, STOP_LINE};
use super::settings::pins::{BSRR, IDR, port};
use crate::task::stays_active;

fn is_high(letter: u8, number: u32) -> bool {
    load(port(letter) + IDR) >> number & 1 == 1
}

/// The emergency stop's contact is open (GPIO5), and was for a microsecond.
#[inline(always)]
pub fn emergency_stop() -> bool {
    stays_active(|| !is_high(b'C', 4))
}

/// The contact has fallen: both bridges off, if it stays open. Whether it did.
pub(super) fn stop_came() -> bool {
    store(PENDING, 1 << STOP_LINE);
    let open = emergency_stop();
    if open {
        bridge::release_all();
    }
    open
}

/// A gate driver reports a fault, and did for a microsecond; only true where they are on.
#[inline(always)]
pub fn gate_fault() -> bool {
    stays_active(|| !is_high(b'D', 2))
}

/// The enabling switch is held (GPIO3).
pub fn enabling() -> bool {
    is_high(b'A', 2)
}

/// The start button is pressed (GPIO4).
pub fn start() -> bool {
    is_high(b'A', 3)
}

/// Drives an output of the board.
pub(super) fn drive(letter: u8, number: u32, high: bool) {
    store(port(letter) + BSRR, 1 << if high { number } else { number + 16 });
}
