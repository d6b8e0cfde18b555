//! Level 6: turns bridges off when their current ticks stop, and feeds the watchdog while every level runs.
//!
//! A hanging level leads to a reset, after which the drive is refused.

use super::signals::{Signals, Word};
use crate::hal::Hardware;
use crate::safety::{CheckIns, GUARD_RATE_HZ, InhibitReason, TickGuard};

/// Checks of the ticks per check of the counters: 4 ms.
const CHECKS_PER_FEED: u32 = GUARD_RATE_HZ / 250;

/// State between two checks, [`GUARD_RATE_HZ`] a second.
#[derive(Clone, Debug, PartialEq)]
pub struct Watch<const N: usize> {
    guard: TickGuard<N>,
    /// Ticks of the axes; servo ticks and rounds of the housekeeping.
    check_ins: CheckIns<N, 2>,
    checks: u32,
}

impl<const N: usize> Watch<N> {
    /// Starts from the present counts.
    pub fn new(signals: &Signals<N>) -> Self {
        Self { guard: TickGuard::new(), check_ins: CheckIns::new(counts(signals)), checks: 0 }
    }

    /// Runs one check.
    pub fn check(&mut self, signals: &Signals<N>, hardware: &mut impl Hardware<N>) {
        let counts = counts(signals);
        if self.guard.check(counts.0) {
            hardware.disable_all();
            // Interrupts are masked, because the late tick would otherwise set the two sides of the half
            // bridge in between.
            hardware.masked(|hardware| hardware.set_brake(0.0));
            // During a flash write the ticks stand still.
            if !signals.inhibit.is_storing() {
                signals.inhibit.raise(InhibitReason::CurrentTicks);
            }
        }
        self.checks = (self.checks + 1) % CHECKS_PER_FEED;
        if self.checks == 0 && self.check_ins.all(counts) {
            hardware.feed_watchdog();
        }
    }
}

fn counts<const N: usize>(signals: &Signals<N>) -> ([u32; N], [u32; 2]) {
    let statistics = &signals.statistics;
    let levels = [statistics.servo_ticks.get(), statistics.rounds.get()];
    (statistics.current_ticks.each_ref().map(Word::get), levels)
}

#[cfg(test)]
mod tests;
