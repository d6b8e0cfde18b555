//! Why nothing may be enabled: one word, in which every reason has a bit.
//!
//! As long as it is not zero the current loops release both bridges in every tick, and the servo keeps its drive off. Reasons
//! are raised anywhere and stay until the operator resets them; one that still holds is raised again in the next tick. What
//! they are and what raises them: `safety::interlock`.

use core::sync::atomic::{AtomicU32, Ordering};

pub use crate::safety::{Cause, stays_active};

static CAUSES: AtomicU32 = AtomicU32::new(0);

/// From now on nothing is enabled.
pub fn raise(cause: Cause) {
    raise_bits(cause.bit());
}

/// The same for all causes with these bits; none for 0.
#[inline(always)]
pub fn raise_bits(bits: u32) {
    if bits != 0 {
        CAUSES.fetch_or(bits, Ordering::Relaxed);
    }
}

/// Nothing speaks against enabling.
#[inline(always)]
pub fn is_clear() -> bool {
    CAUSES.load(Ordering::Relaxed) == 0
}

/// All causes.
pub fn causes() -> u32 {
    CAUSES.load(Ordering::Relaxed)
}

/// The operator has reset: what does not hold for ever, or until the flash is written, is forgotten.
pub fn reset() {
    CAUSES.fetch_and(Cause::for_ever() | Cause::Storing.bit(), Ordering::Relaxed);
}

/// The flash is being written: everything may stand still for seconds.
#[inline(always)]
pub fn is_storing() -> bool {
    causes() & Cause::Storing.bit() != 0
}

/// It is written.
pub fn stored() {
    CAUSES.fetch_and(!Cause::Storing.bit(), Ordering::Relaxed);
}
