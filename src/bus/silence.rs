//! A host that spoke in every cycle and no longer speaks, noticed without its heartbeat.
//!
//! Why: much host software sets no consumer heartbeat (1016) and no event timer. When its process dies or its cable is cut, a joint in profile
//! velocity goes on to the end of its range.
//!
//! ```text
//! kind       SYNC, each received PDO, the controlword written by SDO: each has a cycle of its own
//! armed      after 20 frames of one kind, each at most 4 mean periods and 50 ms after the one before, and none later than 250 ms
//! mean       of the intervals; once armed over some 16 of them, so that a host may change its rate
//! silent     once all armed kinds are over their time: 10 mean periods, at least 100 ms
//! ```
//!
//! A kind that is given up while another one goes on is not missed, nor is one that was never cyclic: single frames, set-points of an
//! operator, a host that polls. Jitter that the bounds allow for: pauses below 100 ms, bursts after them. What it cannot know is whose SYNC it
//! hears: where another device sends it, only 1016 tells that the host is lost.
//!
//! Cost: some 20 instructions per frame and a loop over six kinds per poll. Memory: 16 bytes per kind.

use super::pdo::PDOS;

/// SYNC, the controlword by SDO, received PDOs.
const KINDS: usize = 2 + PDOS;
/// Frames that arm.
const ARMED: u8 = 20;
/// Longest period of what is cyclic, us.
const LONGEST_US: u32 = 250_000;
/// Intervals below this are never irregular, us.
const SLACK_US: u32 = 50_000;
/// Mean periods of silence, and at least so long, us.
const PERIODS: u64 = 10;
const LEAST_US: u64 = 100_000;

/// What a host sends cyclically.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// SYNC.
    Sync,
    /// The controlword, written by SDO.
    Word,
    /// A received PDO.
    Receive(u8),
}

impl Kind {
    const fn place(self) -> usize {
        match self {
            Self::Sync => 0,
            Self::Word => 1,
            Self::Receive(pdo) => 2 + pdo as usize,
        }
    }
}

/// The cycle of one kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Cycle {
    last_us: u64,
    mean_us: u32,
    /// Frames in a row, as far as they arm.
    count: u8,
}

impl Cycle {
    fn heard(&mut self, now_us: u64) {
        let since_us = now_us.saturating_sub(self.last_us).min(u64::from(u32::MAX)) as u32;
        self.last_us = now_us;
        let is_regular = since_us <= LONGEST_US
            && (self.count == 1 || since_us <= self.mean_us.saturating_mul(4).max(SLACK_US));
        // What is armed stays so until it is silent: a pause that is none does not open a gap.
        if self.count == 0 || self.count < ARMED && !is_regular {
            (self.count, self.mean_us) = (1, 0);
            return;
        }
        // The mean so far, later one that forgets.
        let share = self.count.min(16);
        let change = (i64::from(since_us) - i64::from(self.mean_us)) / i64::from(share);
        self.mean_us = (i64::from(self.mean_us) + change) as u32;
        self.count = self.count.saturating_add(1).min(ARMED);
    }

    fn due_us(&self) -> Option<u64> {
        let time_us = (PERIODS * u64::from(self.mean_us)).max(LEAST_US);
        (self.count >= ARMED).then(|| self.last_us + time_us)
    }
}

/// All kinds that one node hears.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Silence {
    cycles: [Cycle; KINDS],
}

impl Silence {
    /// A frame of a kind came.
    pub fn heard(&mut self, kind: Kind, now_us: u64) {
        if let Some(cycle) = self.cycles.get_mut(kind.place()) {
            cycle.heard(now_us);
        }
    }

    /// Whether a host that was cyclic has fallen silent: once, until it is cyclic again.
    pub fn begins(&mut self, now_us: u64) -> bool {
        let due = self.cycles.iter().filter_map(Cycle::due_us).max();
        let begins = due.is_some_and(|due| now_us > due);
        if begins {
            *self = Self::default();
        }
        begins
    }

    /// Nobody could be heard until now.
    pub fn wait(&mut self, now_us: u64) {
        self.cycles.iter_mut().for_each(|cycle| cycle.last_us = cycle.last_us.max(now_us));
    }
}

#[cfg(test)]
mod tests;
