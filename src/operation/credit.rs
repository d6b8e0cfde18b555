//! Level 5: how much of the processor the bus may have.
//!
//! Why: hosts say how much work there is. Frames that are dear (a block that is sent again: 0.6 ms; a reset of all nodes), or many, would take what the
//! housekeeping below needs, until the watchdog bites. Work costs twice the time that it takes, of a credit that grows as time does: a burst is served
//! at once, a flood gets half of the time, with what the levels above take of it.

/// Work costs so many times what it takes.
const COSTS: i64 = 2;
/// The most that is saved, microseconds.
const MOST_US: i64 = 1000;
/// The deepest debt, microseconds: eight blocks that are sent again.
const DEBT_US: i64 = -10_000;
/// No time that is longer makes a difference, microseconds.
const LONGEST_US: u64 = 100_000;

/// Time that may be spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Credit {
    left_us: i64,
    /// Earned and paid until then.
    earned_us: u64,
    paid_us: u64,
}

/// From one instant to the next.
fn between(from_us: u64, to_us: u64) -> i64 {
    to_us.saturating_sub(from_us).min(LONGEST_US) as i64
}

impl Credit {
    /// All that can be saved.
    #[must_use]
    pub const fn new() -> Self {
        Self { left_us: MOST_US, earned_us: 0, paid_us: 0 }
    }

    /// Time has passed; what is done from now on is to be paid.
    pub fn earn(&mut self, now_us: u64) {
        self.left_us = (self.left_us + between(self.earned_us, now_us)).min(MOST_US);
        (self.earned_us, self.paid_us) = (now_us, now_us);
    }

    /// Pays for what was done since it was paid last.
    pub fn pay(&mut self, now_us: u64) {
        self.left_us = (self.left_us - COSTS * between(self.paid_us, now_us)).max(DEBT_US);
        self.paid_us = now_us;
    }

    /// Something may be begun.
    #[must_use]
    pub const fn is_left(&self) -> bool {
        self.left_us >= 0
    }

    /// What was begun may go on: many that are cheap together cost less than one by one.
    #[must_use]
    pub const fn goes_on(&self) -> bool {
        self.left_us > -MOST_US
    }
}

impl Default for Credit {
    fn default() -> Self {
        Self::new()
    }
}
