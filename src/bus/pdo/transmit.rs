//! Transmitted PDOs.

use super::super::heartbeat::Clock;
use super::Parameters;
use crate::hal::Frame;

/// One transmitted PDO.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Transmit {
    /// Communication and mapping parameters.
    pub(crate) parameters: Parameters,
    /// SYNCs since the last frame; `None` until the SYNC with the start value.
    syncs: Option<u8>,
    due: bool,
    event: Clock,
    sent: Option<[u8; 8]>,
    free_us: u64,
}

impl Transmit {
    /// Creates a PDO that has sent nothing.
    pub const fn new(parameters: Parameters) -> Self {
        Self { parameters, syncs: None, due: false, event: Clock::NEW, sent: None, free_us: 0 }
    }

    /// Forgets what was sent, after a change of the PDO or of the NMT state.
    pub(crate) fn restart(&mut self) {
        *self = Self::new(self.parameters);
    }

    /// Handles a SYNC with its counter, if it has one.
    pub(crate) fn at_sync(&mut self, counter: Option<u8>) {
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

    /// Whether the values must be read: the PDO is due, or a change would send it. At most once per inhibit
    /// time.
    pub(crate) fn is_wanted(&mut self, now_us: u64) -> bool {
        if self.parameters.identifier().is_none() || self.parameters.count == 0 {
            return false;
        }
        if self.parameters.is_synchronous() {
            return self.due;
        }
        self.due |= self.event.is_due(1000 * u64::from(self.parameters.event_ms), now_us);
        now_us >= self.free_us
    }

    /// Returns the frame, or `None` if the PDO is sent on change only and nothing changed.
    pub(crate) fn frame(&mut self, data: [u8; 8], now_us: u64) -> Option<Frame> {
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
