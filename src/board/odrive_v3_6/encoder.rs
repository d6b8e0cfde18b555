//! The encoders' counters, and the counts at which their index pulses came.

use core::sync::atomic::{AtomicU32, Ordering};

use super::registers::{load, store};
use super::settings::encoders::{BASES, CNT, is_glitch};
use super::settings::external::{INDEX_LINES, PENDING};
use super::settings::pins::{IDR, port};

/// Set beside a count that was taken at an index pulse.
const SEEN: u32 = 1 << 16;
static INDEX: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];
/// Counts at the last two samples: the newest in the lower half.
static SAMPLED: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];

/// The counter of an axis.
#[inline(always)]
pub fn count(axis: usize) -> u16 {
    BASES.get(axis).map_or(0, |base| load(base + CNT) as u16)
}

/// The counter of an axis at its tick.
#[inline(always)]
pub fn sample(axis: usize) -> u16 {
    let count = count(axis);
    if let Some(sampled) = SAMPLED.get(axis) {
        // Ticks and index interrupts have one priority: neither comes in between.
        sampled.store(sampled.load(Ordering::Relaxed) << 16 | u32::from(count), Ordering::Relaxed);
    }
    count
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
/// up to 10 us, 3 counts at 36 turns per second of 8192. A glitch at rest is dropped.
pub(super) fn index_came(axis: usize) {
    if let (Some(slot), Some(sampled), Some(line)) =
        (INDEX.get(axis), SAMPLED.get(axis), INDEX_LINES.get(axis))
    {
        store(PENDING, 1 << line);
        let count = count(axis);
        let is_high = load(port(b'C') + IDR) >> line & 1 == 1;
        if !is_glitch(sampled.load(Ordering::Relaxed), count, is_high) {
            slot.store(SEEN | u32::from(count), Ordering::Relaxed);
        }
    }
}
