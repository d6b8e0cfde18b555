//! Encoder counters, and the counts captured at their index pulses.

use core::sync::atomic::{AtomicU32, Ordering};

use super::registers::{load, store};
use super::settings::encoders::{BASES, CNT, is_glitch};
use super::settings::external::{INDEX_LINES, PENDING};
use super::settings::pins::{IDR, port};

/// Flag beside a count that was captured at an index pulse.
const SEEN: u32 = 1 << 16;
static INDEX: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];
/// Counts at the last two samples; the newest in the lower half.
static SAMPLED: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];

/// Present counter of an axis.
#[inline(always)]
pub fn count(axis: usize) -> u16 {
    BASES.get(axis).map_or(0, |base| load(base + CNT) as u16)
}

/// Samples the counter of an axis for its tick.
#[inline(always)]
pub fn sample(axis: usize) -> u16 {
    let count = count(axis);
    if let Some(sampled) = SAMPLED.get(axis) {
        // Ticks and index interrupts share one priority, so none can come between load and store.
        sampled.store(sampled.load(Ordering::Relaxed) << 16 | u32::from(count), Ordering::Relaxed);
    }
    count
}

/// Takes the count at the index pulse, if one came since the last call.
#[inline(always)]
pub fn index(axis: usize) -> Option<u16> {
    let slot = INDEX.get(axis)?;
    // Mostly there is no pulse, and a load is cheaper than a swap.
    if slot.load(Ordering::Relaxed) == 0 {
        return None;
    }
    let taken = slot.swap(0, Ordering::Relaxed);
    (taken & SEEN != 0).then_some(taken as u16)
}

/// Interrupt of an index pulse: captures the count, late by the interrupt latency and at worst by a current
/// tick. That is up to 10 us, or 3 counts at 36 turns per second of 8192. A glitch at rest is dropped.
pub fn index_came(axis: usize) {
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
