//! Contacts: emergency stop, enabling switch, start button, and the fault line of the gate drivers.
//!
//! All operator contacts are closed to 3.3 V for "go", so a broken wire means "stop". The emergency stop on
//! GPIO5 (PC4) has no noise filter on the board. A contact open for 0.5 us stops, and only the
//! operator can restart. The gate drivers' fault line must be low for as long. Why: `safety::interlock`.
//!
//! Each current tick reads the contact. In addition, its opening raises an interrupt above all others, which
//! turns both bridges off even where the current loops hang or are not called. An interrupted tick reads the
//! inhibit word again, with interrupts masked, before it switches outputs on (`operation::CurrentLoops`).

use super::bridge;
use super::registers::{load, store};
use super::settings::external::{PENDING, STOP_LINE};
use super::settings::pins::{BSRR, IDR, port};
use crate::safety::stays_active;

fn is_high(letter: u8, number: u32) -> bool {
    load(port(letter) + IDR) >> number & 1 == 1
}

/// Whether the emergency stop's contact (GPIO5) is open, and was in 16 reads in a row.
#[inline(always)]
pub fn emergency_stop() -> bool {
    stays_active(|| !is_high(b'C', 4))
}

/// Interrupt of the contact's falling edge: turns both bridges off if the contact stays open, and returns
/// whether it did.
pub fn stop_came() -> bool {
    store(PENDING, 1 << STOP_LINE);
    let open = emergency_stop();
    if open {
        bridge::disable_all();
    }
    open
}

/// Whether a gate driver reports a fault in 16 reads in a row; only true where the gate drivers are on.
#[inline(always)]
pub fn gate_fault() -> bool {
    stays_active(|| !is_high(b'D', 2))
}

/// Whether the enabling switch (GPIO3) is held.
pub fn enabling() -> bool {
    is_high(b'A', 2)
}

/// Whether the start button (GPIO4) is pressed.
pub fn start() -> bool {
    is_high(b'A', 3)
}

/// Sets an output pin of the board.
pub(super) fn drive(letter: u8, number: u32, high: bool) {
    store(port(letter) + BSRR, 1 << if high { number } else { number + 16 });
}
