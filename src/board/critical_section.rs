//! Critical sections that mask everything but the current loops and the servo.
//!
//! Why not the processor's global mask: one record to the probe holds a critical section for up to 5,000 instructions, and
//! a current tick comes every 20.8 us. With a floor under the priorities it never waits. The price is a rule: what runs
//! at levels 0 and 1, and above, must not use anything that relies on critical sections (records, executors, their mutexes). It uses
//! lock-free queues, atomics and registers. A debug build checks it.
#![expect(unsafe_code, reason = "the trait is unsafe, and so is writing the mask")]

use core::sync::atomic::{Ordering, compiler_fence};

use cortex_m::peripheral::SCB;
use cortex_m::peripheral::scb::{Exception, VectActive};
use cortex_m::register::{basepri, basepri_max};
use critical_section::{Impl, RawRestoreState, set_impl};

/// Of the processor's priorities 3 and below are masked.
const FLOOR: u8 = 0x30;

struct Masked;
set_impl!(Masked);

// SAFETY: on this single core nothing that uses critical sections runs above the floor (a board's `interrupts`: current loops, index
// pulses, the emergency stop and the servo are all that does, and they do not), so between acquire and release nobody else is in one. Nested ones keep the stricter mask,
// and release restores what acquire found.
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
        // SAFETY: restores the mask of before `acquire`.
        unsafe { basepri::write(before as u8) }
    }
}

/// Called from one of the vectors that are never masked: 10, 18, 23, 40, 77 (RM0090 table 61), or from the emulator's clock.
fn is_above_the_floor() -> bool {
    matches!(
        SCB::vect_active(),
        VectActive::Interrupt { irqn: 10 | 18 | 23 | 40 | 77 } | VectActive::Exception(Exception::SysTick)
    )
}
