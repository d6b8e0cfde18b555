//! Heartbeat producer (1017) and consumer (1016).
//!
//! Why a consumer: a host application that dies leaves its last targets active, so the drive must detect the
//! loss itself. Monitoring begins with the first heartbeat received (CiA 301). A host that sends none is not
//! monitored.
//!
//! ```text
//! 1016:i = node << 16 | milliseconds       0 milliseconds or node 0: not monitored
//! ```

use super::abort::Abort;

/// Number of nodes that can be monitored.
pub(crate) const WATCHED: usize = 2;

/// Change of a monitored node's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// The heartbeat timed out.
    Lost,
    /// The heartbeat is back.
    Back,
}

/// Consumer of one other node's heartbeat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Consumer {
    setting: u32,
    /// Deadline; `None` before the first heartbeat and while the node is lost.
    due_us: Option<u64>,
    lost: bool,
}

impl Consumer {
    const fn node(self) -> u8 {
        (self.setting >> 16) as u8
    }

    const fn time_us(self) -> u64 {
        (self.setting & 0xFFFF) as u64 * 1000
    }

    /// Returns object 1016.
    pub(crate) const fn setting(self) -> u32 {
        self.setting
    }

    /// Writes object 1016 and restarts the monitoring.
    ///
    /// # Errors
    /// [`Abort::Range`] if the node-ID exceeds 127 or a reserved bit is set.
    pub(crate) fn set(&mut self, setting: u32) -> Result<(), Abort> {
        if setting >> 16 > 127 {
            return Err(Abort::Range);
        }
        *self = Self { setting, due_us: None, lost: false };
        Ok(())
    }

    /// Handles a heartbeat or boot-up message of `node`.
    pub(crate) fn received(&mut self, node: u8, now_us: u64) -> Option<Change> {
        if self.time_us() == 0 || node == 0 || node != self.node() {
            return None;
        }
        self.due_us = Some(now_us + self.time_us());
        core::mem::take(&mut self.lost).then_some(Change::Back)
    }

    /// Restarts the timeout after a time in which nothing could be received.
    pub(crate) fn wait(&mut self, now_us: u64) {
        let time_us = self.time_us();
        self.due_us = self.due_us.map(|_| now_us + time_us);
    }

    /// Checks the timeout.
    pub(crate) fn poll(&mut self, now_us: u64) -> Option<Change> {
        self.due_us.take_if(|due| now_us > *due).map(|_| {
            self.lost = true;
            Change::Lost
        })
    }
}

/// Periodic timer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Clock {
    next_us: Option<u64>,
}

impl Clock {
    /// Not started.
    pub(crate) const NEW: Self = Self { next_us: None };

    /// Whether the period has elapsed; never with a period of 0. Missed periods are not made up for.
    pub(crate) fn is_due(&mut self, period_us: u64, now_us: u64) -> bool {
        if period_us == 0 {
            self.next_us = None;
            return false;
        }
        let phase_us = match self.next_us {
            // A shortened period takes effect at once.
            Some(next) if now_us < next && next - now_us <= period_us => return false,
            Some(next) if now_us >= next && now_us - next < period_us => next,
            _ => now_us,
        };
        self.next_us = Some(phase_us + period_us);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heartbeat_times_out_but_never_before_the_first() {
        let mut consumer = Consumer::default();
        assert_eq!(consumer.set(80 << 16 | 100), Ok(()));
        assert_eq!(consumer.poll(10_000_000), None);
        assert_eq!((consumer.received(80, 0), consumer.received(81, 90_000)), (None, None));
        assert_eq!((consumer.poll(100_000), consumer.poll(100_001)), (None, Some(Change::Lost)));
        assert_eq!(consumer.poll(200_000), None);
        assert_eq!(consumer.received(80, 300_000), Some(Change::Back));
        assert_eq!(consumer.set(128 << 16 | 100), Err(Abort::Range));
    }

    #[test]
    fn a_refused_consumer_setting_changes_nothing() {
        let mut consumer = Consumer::default();
        assert_eq!((consumer.setting(), consumer.set(127 << 16 | 0xFFFF)), (0, Ok(())));
        assert_eq!(consumer.set(0x0080_0064), Err(Abort::Range));
        assert_eq!(consumer.setting(), 0x007F_FFFF);
    }

    #[test]
    fn a_clock_keeps_its_phase_and_skips_missed_periods() {
        let mut clock = Clock::default();
        let times = [0, 400, 1000, 1001, 2100, 3000, 9500, 9600, 10_500].map(|now| clock.is_due(1000, now));
        assert_eq!(times, [true, false, true, false, true, true, true, false, true]);
        assert!(!clock.is_due(0, 20_000));
    }
}
