//! Contacts: emergency stop, enabling switch, start button, and the fault line of the gate drivers.
//!
//! All contacts of the operator are closed to 3.3 V when they say "go", so that a wire that breaks says "stop". GPIO5 (PC4),
//! the emergency stop, has no noise filter on the board: a spike stops, and only the operator starts again.

use super::registers::{load, store};
use super::settings::pins::{BSRR, IDR, port};

fn is_high(letter: u8, number: u32) -> bool {
    load(port(letter) + IDR) >> number & 1 == 1
}

/// The emergency stop's contact is open (GPIO5).
#[inline(always)]
pub fn emergency_stop() -> bool {
    !is_high(b'C', 4)
}

/// A gate driver reports a fault; only true where they are on.
#[inline(always)]
pub fn gate_fault() -> bool {
    !is_high(b'D', 2)
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
