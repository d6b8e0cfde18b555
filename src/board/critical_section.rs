//! Critical sections that mask everything but the current loops and the servo.
//!
//! Why not the processor's global mask: one record to the probe holds a critical section for up to 5,000
//! instructions. A current tick comes every 20.8 us. With a priority floor the current loop never waits. The
//! price is a rule: code at levels 0 and 1, and above, must not use anything based on critical sections
//! (records, executors, their mutexes). Lock-free queues, atomics and registers remain. A debug build checks
//! the rule.
#![expect(unsafe_code, reason = "the trait is unsafe, and so is writing the mask")]

use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::peripheral::SCB;
use cortex_m::peripheral::scb::VectActive;
use cortex_m::register::{basepri, basepri_max};
use critical_section::{Impl, RawRestoreState, set_impl};

/// Priorities 3 and below of the processor are masked.
const FLOOR: u8 = 0x30;

struct Masked;
set_impl!(Masked);

// SAFETY: on this single core no code above the floor uses critical sections. That code is the current loops,
// index pulses, the emergency stop and the servo (a board's `interrupts`). So between acquire and release no
// other code is in one. Nested sections keep the stricter mask, and release restores what acquire found.
unsafe impl Impl for Masked {
    unsafe fn acquire() -> RawRestoreState {
        debug_assert!(!is_above_the_floor());
        let before = u32::from(basepri::read());
        basepri_max::write(FLOOR);
        compiler_fence(Ordering::SeqCst);
        before
    }

    unsafe fn release(before: RawRestoreState) {
        compiler_fence(Ordering::SeqCst);
        // SAFETY: restores the mask from before `acquire`.
        unsafe { basepri::write(before as u8) }
    }
}

/// Whether the active vector is never masked: 10, 18, 23, 40, 77 (RM0090 table 61).
fn is_above_the_floor() -> bool {
    matches!(SCB::vect_active(), VectActive::Interrupt { irqn: 10 | 18 | 23 | 40 | 77 })
}
