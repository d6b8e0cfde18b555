//! How the loops do: counted where it happens, told from the lowest priority.

use core::sync::atomic::{AtomicU32, Ordering};

/// One number.
pub struct Count(AtomicU32);

impl Count {
    /// Nothing counted.
    #[must_use]
    pub const fn zero() -> Self {
        Self::of(0)
    }

    const fn of(value: u32) -> Self {
        Self(AtomicU32::new(value))
    }

    /// One more.
    pub fn add(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    /// Now.
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }

    /// Overwritten.
    #[inline(always)]
    pub fn set(&self, value: u32) {
        self.0.store(value, Ordering::Relaxed);
    }

    /// The largest so far; written by one level only.
    #[inline(always)]
    pub fn raise(&self, value: u32) {
        if value > self.get() {
            self.set(value);
        }
    }

    /// The smallest so far; written by one level only.
    #[inline(always)]
    pub fn lower(&self, value: u32) {
        if value < self.get() {
            self.set(value);
        }
    }

    /// Now, and from now on something else.
    pub fn swap(&self, value: u32) -> u32 {
        self.0.swap(value, Ordering::Relaxed)
    }
}

/// Longest current tick, processor cycles.
pub static CURRENT_WORST: Count = Count::of(0);
/// Current ticks that came late.
pub static CURRENT_MISSED: Count = Count::of(0);
/// Current ticks of each axis.
pub static CURRENT_TICKS: [Count; 2] = [const { Count::of(0) }; 2];
/// Longest servo tick, processor cycles, current ticks in it included.
pub static SERVO_WORST: Count = Count::of(0);
/// Servo ticks that came late.
pub static SERVO_MISSED: Count = Count::of(0);
/// Servo ticks.
pub static SERVO_TICKS: Count = Count::of(0);
/// Samples that the identification had no room for.
pub static SAMPLES_LOST: Count = Count::of(0);
/// Records that found no room on their way to whoever tells them.
pub static RECORDS_LOST: Count = Count::of(0);
/// Code of the bus voltage: now, lowest, highest.
pub static BUS: [Count; 3] = [Count::of(0), Count::of(u32::MAX), Count::of(0)];
/// Counts of each joint as the servo saw them last.
pub static COUNTS: [Count; 2] = [const { Count::of(0) }; 2];
