//! The encoders' counters, and the counts at which their index pulses came.

use core::sync::atomic::{AtomicU32, Ordering};

use super::registers::{load, store};
use super::settings::encoders::{BASES, CNT};
use super::settings::external::{INDEX_LINES, PENDING};

/// Set beside a count that was taken at an index pulse.
const SEEN: u32 = 1 << 16;
static INDEX: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];

/// The counter of an axis.
#[inline(always)]
pub fn count(axis: usize) -> u16 {
    BASES.get(axis).map_or(0, |base| load(base + CNT) as u16)
}

/// The count at the index pulse, if one came since the last call.
#[inline(always)]
pub fn index(axis: usize) -> Option<u16> {
    let slot = INDEX.get(axis)?;
    // Mostly there is none, and looking is cheaper than taking.
    if slot.load(Ordering::Relaxed) == 0 {
        return None;
    }
    let taken = slot.swap(0, Ordering::Relaxed);
    (taken & SEEN != 0).then_some(taken as u16)
}

/// The index pulse of an axis came: takes the count. It is late by the interrupts' latency, and by a current tick at worst:
/// about 6 us, 2 counts at 36 turns per second of 8192.
pub(super) fn index_came(axis: usize) {
    if let (Some(slot), Some(line)) = (INDEX.get(axis), INDEX_LINES.get(axis)) {
        slot.store(SEEN | u32::from(count(axis)), Ordering::Relaxed);
        store(PENDING, 1 << line);
    }
}
