//! Check-ins that decide whether the watchdog is fed.
//!
//! Why here: counters and watchdog belong to the board, but the decision depends on values only. So the same
//! code is tested on the host against a hang of each level (row K3 of docs/safety.md).
//!
//! The watchdog is not fed while any count is unchanged since the last feed. A count that moves again within
//! the watchdog's time is forgiven. Checks run every 4 ms, so the reset follows at most 4 ms plus the
//! watchdog's time after a hang began. That is 15 to 34.1 ms over the oscillator's 47 to 17 kHz, 20 ms
//! nominally.

/// Counters of `N` axes and `M` priority levels at the last feed of the watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CheckIns<const N: usize, const M: usize> {
    before: ([u32; N], [u32; M]),
}

impl<const N: usize, const M: usize> CheckIns<N, M> {
    /// Starts from the current counts.
    pub const fn new(counts: ([u32; N], [u32; M])) -> Self {
        Self { before: counts }
    }

    /// Returns whether every counter has moved since this last returned true. Counters wrap.
    pub(crate) fn all(&mut self, counts: ([u32; N], [u32; M])) -> bool {
        let now = counts.0.iter().chain(&counts.1);
        let all = now.zip(self.before.0.iter().chain(&self.before.1)).all(|(now, before)| now != before);
        if all {
            self.before = counts;
        }
        all
    }
}

/// Rate at which `TickGuard::check` is called.
pub const GUARD_RATE_HZ: u32 = 2000;

/// Checks from a lower priority level that the current ticks of `N` axes go on. If all of them stop, no code
/// at their level can notice, and the bridges hold their last duties. A turning rotor then exceeds the torque
/// cap within 3 ms. Detected within 1 ms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct TickGuard<const N: usize> {
    before: Option<[u32; N]>,
}

impl<const N: usize> TickGuard<N> {
    /// A guard before its first check.
    pub const fn new() -> Self {
        Self { before: None }
    }

    /// Returns whether any axis has not ticked since the last call. Counters wrap.
    pub fn check(&mut self, ticks: [u32; N]) -> bool {
        let before = self.before.replace(ticks);
        before.is_some_and(|before| before.iter().zip(&ticks).any(|(before, now)| before == now))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stopped_axis_is_detected_at_the_next_check() {
        let mut guard = TickGuard::new();
        let counts = [[u32::MAX, 0], [11, 12], [23, 24], [35, 24], [47, 36], [47, 36]];
        assert_eq!(counts.map(|ticks| guard.check(ticks)), [false, false, false, true, false, true]);
    }

    #[test]
    fn the_watchdog_starves_while_any_counter_hangs() {
        for hung in 0..4 {
            let mut counts = [u32::MAX - 1; 4];
            let split = |[first, second, servo, rounds]: [u32; 4]| ([first, second], [servo, rounds]);
            let mut check_ins = CheckIns::new(split(counts));
            let mut check = |hangs: bool| {
                for (index, count) in counts.iter_mut().enumerate() {
                    *count = count.wrapping_add(u32::from(!(hangs && index == hung)));
                }
                check_ins.all(split(counts))
            };
            // The counters wrap; the hang lasts two checks, then the counter runs again.
            let fed = [false, false, false, true, true, false, false].map(&mut check);
            assert_eq!(fed, [true, true, true, false, false, true, true], "{hung}");
        }
    }

    #[test]
    fn a_run_before_the_last_feed_does_not_count_again() {
        let mut check_ins = CheckIns::new(([7], [7]));
        assert!(!check_ins.all(([7], [8])));
        assert!(check_ins.all(([8], [8])));
        assert!(!check_ins.all(([8], [8])));
    }
}
