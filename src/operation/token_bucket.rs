//! Level 5: token bucket that limits the processor time of the bus.
//!
//! Why: hosts determine the amount of work. Many or expensive frames would take the housekeeping's time until
//! the watchdog resets the board; repeating a block takes 0.6 ms, for example. Work costs twice its duration
//! from a balance that grows with time. A burst is served at once; a flood gets half of the time, including
//! the time that higher levels take in between.

/// Cost of work as a multiple of its duration.
const COSTS: i64 = 2;
/// Largest balance, microseconds.
const MOST_US: i64 = 1000;
/// Largest debt, microseconds: eight repeated blocks.
const DEBT_US: i64 = -10_000;
/// Upper limit of measured durations, microseconds; longer ones make no difference.
const LONGEST_US: u64 = 100_000;

/// Balance of processor time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TokenBucket {
    left_us: i64,
    /// Times of the last increase and the last payment.
    refilled_us: u64,
    spent_us: u64,
}

/// Microseconds between two times, limited to [`LONGEST_US`].
fn between(from_us: u64, to_us: u64) -> i64 {
    to_us.saturating_sub(from_us).min(LONGEST_US) as i64
}

impl TokenBucket {
    /// Starts with the largest balance.
    pub const fn new() -> Self {
        Self { left_us: MOST_US, refilled_us: 0, spent_us: 0 }
    }

    /// Credits the time since the last call; work from now on has to be paid.
    pub(crate) fn refill(&mut self, now_us: u64) {
        self.left_us = (self.left_us + between(self.refilled_us, now_us)).min(MOST_US);
        (self.refilled_us, self.spent_us) = (now_us, now_us);
    }

    /// Pays for the time since the last payment.
    pub(crate) fn spend(&mut self, now_us: u64) {
        self.left_us = (self.left_us - COSTS * between(self.spent_us, now_us)).max(DEBT_US);
        self.spent_us = now_us;
    }

    /// Returns whether work may start.
    pub(crate) const fn may_start(&self) -> bool {
        self.left_us >= 0
    }

    /// Returns whether started work may continue. Many cheap frames in one round cost less than one by one.
    pub(crate) const fn may_continue(&self) -> bool {
        self.left_us > -MOST_US
    }
}
