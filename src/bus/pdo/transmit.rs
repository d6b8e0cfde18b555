//! What the node sends as PDO.

use super::super::heartbeat::Clock;
use super::Parameters;
use crate::hal::Frame;

/// One PDO that is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmit {
    /// What it is set to.
    pub parameters: Parameters,
    /// SYNC since the last one; `None` until the one it begins with.
    syncs: Option<u8>,
    due: bool,
    event: Clock,
    sent: Option<[u8; 8]>,
    free_us: u64,
}

impl Transmit {
    /// Nothing sent yet.
    pub const fn new(parameters: Parameters) -> Self {
        Self { parameters, syncs: None, due: false, event: Clock::NEW, sent: None, free_us: 0 }
    }

    /// As if nothing had been sent: it was changed, or the node begins to take part.
    pub fn restart(&mut self) {
        *self = Self::new(self.parameters);
    }

    /// A SYNC with its counter, where it has one.
    pub fn at_sync(&mut self, counter: Option<u8>) {
        let start = self.parameters.sync_start;
        let counts = match (self.syncs, counter) {
            (None, Some(counter)) if start != 0 && counter != start => return,
            (None, Some(_)) if start != 0 => self.parameters.kind,
            (syncs, _) => syncs.unwrap_or(0).saturating_add(1),
        };
        let is_due = match self.parameters.kind {
            0 => true,
            every @ 1..=240 => counts >= every,
            _ => false,
        };
        self.due |= is_due;
        self.syncs = Some(if is_due { 0 } else { counts });
    }

    /// Whether the values are to be looked at: it is due, or a change would send it. At most once per inhibit time.
    pub fn is_wanted(&mut self, now_us: u64) -> bool {
        if self.parameters.identifier().is_none() || self.parameters.count == 0 {
            return false;
        }
        if self.parameters.is_synchronous() {
            return self.due;
        }
        self.due |= self.event.is_due(1000 * u64::from(self.parameters.event_ms), now_us);
        now_us >= self.free_us
    }

    /// The frame, unless it waits for a change and there is none.
    pub fn frame(&mut self, data: [u8; 8], now_us: u64) -> Option<Frame> {
        let changed = self.sent != Some(data);
        let by_change = self.parameters.kind == 0 || !self.parameters.is_synchronous() && !self.due;
        self.due = false;
        if by_change && !changed {
            return None;
        }
        self.sent = Some(data);
        self.free_us = now_us + 100 * u64::from(self.parameters.inhibit);
        let length = self.parameters.length();
        Some(Frame::new(self.parameters.identifier()?, data.get(..length)?))
    }
}
