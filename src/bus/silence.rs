//! Detects that a cyclic host has stopped sending, without its heartbeat.
//!
//! Why: much host software sets neither a consumer heartbeat (1016) nor an event timer. If its process dies
//! or its cable is cut, a joint in profile velocity mode moves on to the end of its range.
//!
//! ```text
//! kind       SYNC, each received PDO, the controlword written by SDO; each has its own cycle
//! armed      after 20 frames of one kind; each interval at most 250 ms, and at most max(4 means, 50 ms)
//! mean       mean interval; once armed a moving mean over about 16, so that a host may change its rate
//! silent     when no armed kind has come for 10 mean periods of the fastest one, at least 100 ms, and for 2
//!            of the slowest one
//! given up   a kind later than its own 10 mean periods, at least 100 ms, when another armed kind comes
//! ```
//!
//! Why the fastest: SYNC every 2 ms beside a controlword every 240 ms is missed after 480 ms, not 2.4 s.
//! Why two periods of the slowest: a host that gives up SYNC on purpose must be heard by its next frame.
//!
//! A kind that stops while another one continues is thus disarmed. A kind that was never cyclic is ignored:
//! single frames, set-points of an operator, a polling host. Tolerated jitter: pauses below 100 ms and bursts
//! after them. Limits: the node cannot tell which device sends SYNC. If another device does, only 1016
//! detects a lost host.
//!
//! Cost: about 20 instructions and two loops over six kinds per frame; one comparison per poll. Memory: 16
//! bytes per kind, and 16 for the instant of silence.

use super::pdo::PDOS;

/// Number of kinds: SYNC, the controlword by SDO, received PDOs.
const KINDS: usize = 2 + PDOS;
/// Number of frames that arm the detection.
const ARMED: u8 = 20;
/// Longest interval of a cyclic kind, us.
const LONGEST_US: u32 = 250_000;
/// Intervals below this are always regular, us.
const SLACK_US: u32 = 50_000;
/// Timeout in mean periods, and its lower bound, us.
const PERIODS: u64 = 10;
const LEAST_US: u64 = 100_000;
/// Mean periods of the slowest kind that the timeout covers.
const SLOWEST_PERIODS: u64 = 2;

/// Kind of frame that a host may send cyclically.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// SYNC.
    Sync,
    /// Controlword, written by SDO.
    Word,
    /// Received PDO by number.
    Receive(u8),
}

impl Kind {
    const fn index(self) -> usize {
        match self {
            Self::Sync => 0,
            Self::Word => 1,
            Self::Receive(pdo) => 2 + pdo as usize,
        }
    }
}

/// Cycle of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Cycle {
    last_us: u64,
    mean_us: u32,
    /// Consecutive regular frames, saturated at [`ARMED`].
    count: u8,
}

impl Cycle {
    fn received(&mut self, now_us: u64) {
        let since_us = now_us.saturating_sub(self.last_us).min(u64::from(u32::MAX)) as u32;
        self.last_us = now_us;
        let is_regular = since_us <= LONGEST_US
            && (self.count == 1 || since_us <= self.mean_us.saturating_mul(4).max(SLACK_US));
        // An armed cycle stays armed until it is silent; a pause does not disarm it.
        if self.count == 0 || self.count < ARMED && !is_regular {
            (self.count, self.mean_us) = (1, 0);
            return;
        }
        // Arithmetic mean at first, later an exponential one.
        let share = self.count.min(16);
        let change = (i64::from(since_us) - i64::from(self.mean_us)) / i64::from(share);
        self.mean_us = (i64::from(self.mean_us) + change) as u32;
        self.count = self.count.saturating_add(1).min(ARMED);
    }

    const fn is_armed(&self) -> bool {
        self.count >= ARMED
    }

    /// Timeout of this kind alone, us.
    fn time_us(&self) -> u64 {
        (PERIODS * u64::from(self.mean_us)).max(LEAST_US)
    }
}

/// Cycles of all kinds received by one node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Silence {
    cycles: [Cycle; KINDS],
    /// Instant after which the host is silent; `None` without an armed kind.
    silent_us: Option<u64>,
}

impl Silence {
    /// Handles a frame of a kind.
    pub(crate) fn received(&mut self, kind: Kind, now_us: u64) {
        let Some(cycle) = self.cycles.get_mut(kind.index()) else { return };
        cycle.received(now_us);
        if cycle.is_armed() {
            // The host still sends, so a kind that is late was given up.
            let is_late = |other: &&mut Cycle| other.is_armed() && now_us > other.last_us + other.time_us();
            self.cycles.iter_mut().filter(is_late).for_each(|other| *other = Cycle::default());
        }
        self.plan();
    }

    /// Whether the host has just fallen silent; reported once, until it is cyclic again.
    pub(crate) fn begins(&mut self, now_us: u64) -> bool {
        let begins = self.silent_us.is_some_and(|silent_us| now_us > silent_us);
        if begins {
            *self = Self::default();
        }
        begins
    }

    /// Computes the instant of silence, so that each check is one comparison.
    fn plan(&mut self) {
        let (mut last_us, mut time_us, mut slowest_us) = (0, u64::MAX, 0);
        for cycle in self.cycles.iter().filter(|cycle| cycle.is_armed()) {
            last_us = last_us.max(cycle.last_us);
            time_us = time_us.min(cycle.time_us());
            slowest_us = slowest_us.max(SLOWEST_PERIODS * u64::from(cycle.mean_us));
        }
        let is_armed = time_us < u64::MAX;
        self.silent_us = is_armed.then(|| last_us.saturating_add(time_us.max(slowest_us)));
    }

    /// Restarts the timeout after a time in which nothing could be received.
    pub(crate) fn wait(&mut self, now_us: u64) {
        self.cycles.iter_mut().for_each(|cycle| cycle.last_us = cycle.last_us.max(now_us));
        self.plan();
    }
}

#[cfg(test)]
mod tests;
