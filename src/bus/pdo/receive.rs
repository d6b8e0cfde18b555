//! Received PDOs.

use super::Parameters;
use crate::hal::Frame;

/// Result of a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Received {
    /// Its values are valid now.
    Now,
    /// Its values become valid at the next SYNC.
    AtSync,
    /// The frame has fewer bytes than are mapped.
    TooShort,
}

/// One received PDO.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Receive {
    /// Communication and mapping parameters.
    pub(crate) parameters: Parameters,
    data: [u8; 8],
    waits: bool,
    /// The values that wait belong to a session that has ended.
    is_void: bool,
    /// Deadline of the event timer, once a frame was received.
    due_us: Option<u64>,
}

impl Receive {
    /// Creates a PDO that has received nothing.
    pub const fn new(parameters: Parameters) -> Self {
        Self { parameters, data: [0; 8], waits: false, is_void: false, due_us: None }
    }

    /// Takes over a frame with this PDO's COB-ID. Bytes beyond the mapped ones are ignored. The event timer
    /// of a synchronous PDO is restarted by the SYNC that makes its values valid: without SYNC its host
    /// commands nothing, however often it sends.
    pub(crate) fn take(&mut self, frame: &Frame, now_us: u64) -> Received {
        if frame.data().len() < self.parameters.length() {
            return Received::TooShort;
        }
        for (slot, byte) in self.data.iter_mut().zip(frame.data()) {
            *slot = *byte;
        }
        (self.waits, self.is_void) = (self.parameters.is_synchronous(), false);
        if !self.waits {
            self.restart_event_timer(now_us);
        }
        if self.waits { Received::AtSync } else { Received::Now }
    }

    /// Whether values were waiting for this SYNC.
    pub(crate) fn at_sync(&mut self, now_us: u64) -> bool {
        let waited = core::mem::take(&mut self.waits);
        if waited {
            self.restart_event_timer(now_us);
        }
        waited
    }

    fn restart_event_timer(&mut self, now_us: u64) {
        let event_us = self.event_us();
        self.due_us = (event_us > 0).then_some(now_us + event_us);
    }

    /// Whether the event timer has just expired; reported once.
    pub(crate) fn is_missed(&mut self, now_us: u64) -> bool {
        self.due_us.take_if(|due| now_us > *due).is_some()
    }

    /// Restarts the timeout after a time in which nothing could be received.
    pub(crate) fn wait(&mut self, now_us: u64) {
        let event_us = self.event_us();
        self.due_us = self.due_us.map(|_| now_us + event_us);
    }

    fn event_us(&self) -> u64 {
        1000 * u64::from(self.parameters.event_ms)
    }

    /// Discards waiting values and stops the event timer.
    pub(crate) fn stop(&mut self) {
        (self.waits, self.due_us) = (false, None);
    }

    /// Makes waiting values void. Their SYNC still counts, and writes nothing.
    pub(crate) fn void(&mut self) {
        self.is_void = true;
    }

    /// Whether the values of the last frame are void.
    pub(crate) const fn is_void(&self) -> bool {
        self.is_void
    }

    /// Returns the bytes of the last frame.
    pub(crate) const fn data(&self) -> [u8; 8] {
        self.data
    }
}
