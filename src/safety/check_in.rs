//! Who has to have run since the last time before the watchdog is fed.
//!
//! Why here: counters and watchdog are the board's, but whether all have checked in is decided by values only, so the same code is tested
//! against hangs of each on the host (row K3 of docs/safety.md).
//!
//! A count that did not move since the watchdog was last fed keeps it from being fed, whatever the others do; one that moves again within
//! the watchdog's time is forgiven. Looked at every 4 ms, a hang is answered by a reset at most 4 ms and the watchdog's time after it began:
//! 15 to 34.1 ms over the oscillator's 47 to 17 kHz, 20 ms nominally.

/// Counters of `N` axes and of `M` levels that have to run, as they were when the watchdog was last fed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CheckIns<const N: usize, const M: usize> {
    before: ([u32; N], [u32; M]),
}

impl<const N: usize, const M: usize> CheckIns<N, M> {
    /// Counters as they are now.
    #[must_use]
    pub const fn new(counts: ([u32; N], [u32; M])) -> Self {
        Self { before: counts }
    }

    /// Whether every one of them ran since this last said so; then they are waited for anew. Counters wrap.
    pub fn all(&mut self, counts: ([u32; N], [u32; M])) -> bool {
        let now = counts.0.iter().chain(&counts.1);
        let all = now.zip(self.before.0.iter().chain(&self.before.1)).all(|(now, before)| now != before);
        if all {
            self.before = counts;
        }
        all
    }
}

/// How often [`TickGuard`] looks.
pub const GUARD_RATE_HZ: u32 = 2000;

/// Looks from below whether the current ticks of `N` axes go on. Where those of all stop, nobody at their level is left to see it, and the
/// bridges hold their last duties: a rotor that turns on makes more torque than the cap within 3 ms. Seen after 1 ms at most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickGuard<const N: usize> {
    before: Option<[u32; N]>,
}

impl<const N: usize> TickGuard<N> {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { before: None }
    }

    /// Whether some axis did not tick since the last look. Counters wrap.
    pub fn look(&mut self, ticks: [u32; N]) -> bool {
        let before = self.before.replace(ticks);
        before.is_some_and(|before| before.iter().zip(&ticks).any(|(before, now)| before == now))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_that_does_not_tick_is_seen_at_the_next_look() {
        let mut guard = TickGuard::new();
        let looks = [[u32::MAX, 0], [11, 12], [23, 24], [35, 24], [47, 36], [47, 36]];
        assert_eq!(looks.map(|ticks| guard.look(ticks)), [false, false, false, true, false, true]);
    }

    #[test]
    fn any_one_that_hangs_keeps_the_watchdog_hungry_and_is_forgiven_when_it_runs_again() {
        for hung in 0..4 {
            let mut counts = [u32::MAX - 1; 4];
            let split = |[first, second, servo, rounds]: [u32; 4]| ([first, second], [servo, rounds]);
            let mut check_ins = CheckIns::new(split(counts));
            let mut look = |hangs: bool| {
                for (place, count) in counts.iter_mut().enumerate() {
                    *count = count.wrapping_add(u32::from(!(hangs && place == hung)));
                }
                check_ins.all(split(counts))
            };
            // Across the wrap; one hang of two looks; then it runs again.
            let fed = [false, false, false, true, true, false, false].map(&mut look);
            assert_eq!(fed, [true, true, true, false, false, true, true], "{hung}");
        }
    }

    #[test]
    fn what_ran_before_the_watchdog_was_fed_counts_once() {
        let mut check_ins = CheckIns::new(([7], [7]));
        assert!(!check_ins.all(([7], [8])));
        assert!(check_ins.all(([8], [8])));
        assert!(!check_ins.all(([8], [8])));
    }
}
