//! What the node receives as PDO.

use super::Parameters;
use crate::hal::Frame;

/// What came of a frame, or of the time since.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// Its values count now.
    Now,
    /// Its values count from the next SYNC on.
    AtSync,
    /// Fewer bytes than are mapped.
    TooShort,
}

/// One PDO that is received.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receive {
    /// What it is set to.
    pub parameters: Parameters,
    data: [u8; 8],
    waits: bool,
    /// When it will be missed, where its event timer is set and it has been seen.
    due_us: Option<u64>,
}

impl Receive {
    /// Nothing received yet.
    pub const fn new(parameters: Parameters) -> Self {
        Self { parameters, data: [0; 8], waits: false, due_us: None }
    }

    /// A frame with its identifier. More bytes than are mapped are not looked at.
    pub fn take(&mut self, frame: &Frame, now_us: u64) -> Received {
        if frame.data().len() < self.parameters.length() {
            return Received::TooShort;
        }
        for (place, byte) in self.data.iter_mut().zip(frame.data()) {
            *place = *byte;
        }
        let event_us = self.event_us();
        self.due_us = (event_us > 0).then_some(now_us + event_us);
        self.waits = self.parameters.is_synchronous();
        if self.waits { Received::AtSync } else { Received::Now }
    }

    /// Whether it has waited for this SYNC.
    pub fn at_sync(&mut self) -> bool {
        core::mem::take(&mut self.waits)
    }

    /// Whether it is missed from now on.
    pub fn is_missed(&mut self, now_us: u64) -> bool {
        self.due_us.take_if(|due| now_us > *due).is_some()
    }

    /// Nobody could be heard until now.
    pub fn wait(&mut self, now_us: u64) {
        let event_us = self.event_us();
        self.due_us = self.due_us.map(|_| now_us + event_us);
    }

    fn event_us(&self) -> u64 {
        1000 * u64::from(self.parameters.event_ms)
    }

    /// What waited or was watched is forgotten.
    pub fn stop(&mut self) {
        (self.waits, self.due_us) = (false, None);
    }

    /// The frame's bytes.
    pub const fn data(&self) -> [u8; 8] {
        self.data
    }
}
