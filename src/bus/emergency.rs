//! Emergency messages, error register (1001) and error history (1003).
//!
//! Why by source: the end of one error must not hide another that continues. Each source has at most one
//! error. A message is sent when it begins, changes or ends; the end has code 0 and the remaining error
//! register. Codes: `safety::fault`.
//!
//! ```text
//! message = error code, 2 bytes | error register, 1 byte | information, 5 bytes          identifier: 1014
//! ```
//!
//! Source: CiA 301, emergency object. Limits: at most four messages wait. A further one enters the history;
//! once the four are sent, its source sends its present state, ended errors first. So the last messages of a
//! burst say what is the case.

use super::abort::Abort;
use super::pdo::PDOS;
use crate::hal::Frame;
use crate::leg::NO_ERROR;

/// Entries of the error history.
pub(crate) const HISTORY: usize = 8;
const WAITING: usize = 4;
/// Default of 1015: 10 ms.
const INHIBIT: u16 = 100;

/// Source of an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// Drive of the joint, see [`ErrorReport`].
    Drive,
    /// Monitored heartbeat, 0 or 1.
    Heartbeat(u8),
    /// Received PDO by number.
    Receive(u8),
    /// CAN controller.
    Controller,
    /// Store of the parameters.
    Store,
    /// Silence of a cyclic host.
    Silence,
    /// Received SYNC.
    Sync,
}

const SOURCES: usize = 7 + PDOS;

impl Source {
    const fn index(self) -> usize {
        match self {
            Self::Drive => 0,
            Self::Heartbeat(0) => 1,
            Self::Heartbeat(_) => 2,
            Self::Controller => 3,
            Self::Store => 4,
            Self::Silence => 5,
            Self::Sync => 6,
            Self::Receive(pdo) => 7 + pdo as usize,
        }
    }
}

/// Error as reported to hosts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ErrorReport {
    /// Error code by CiA 301 or CiA 402.
    pub(crate) code: u16,
    /// Manufacturer-specific information.
    pub(crate) information: [u8; 5],
}

impl ErrorReport {
    /// Creates a report without information.
    pub(crate) const fn code(code: u16) -> Self {
        Self { code, information: [0; 5] }
    }

    /// Error register: bit 0 always; 1 current, 2 voltage, 3 temperature, 4 communication, 5 device profile,
    /// 7 manufacturer-specific.
    pub(crate) const fn register(&self) -> u8 {
        1 | match self.code >> 8 {
            0x20..=0x2F => 1 << 1,
            0x30..=0x3F => 1 << 2,
            0x40..=0x4F => 1 << 3,
            0x81 | 0x82 => 1 << 4,
            0x50..=0x5F | 0x70..=0x7F | 0x83..=0x8F => 1 << 5,
            0xFF => 1 << 7,
            _ => 0,
        }
    }
}

/// Active errors, waiting messages and history.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Emergency {
    active: [Option<ErrorReport>; SOURCES],
    waiting: [Option<[u8; 8]>; WAITING],
    /// Sources whose last change found no space.
    unsent: [bool; SOURCES],
    history: [u32; HISTORY],
    recorded: u8,
    /// Object 1014.
    pub(super) identifier: u32,
    /// Object 1015, in units of 100 us.
    pub(super) inhibit: u16,
    next_us: u64,
}

impl Emergency {
    /// Creates the state without errors; messages are sent with this COB-ID.
    pub const fn new(identifier: u32) -> Self {
        Self {
            active: [None; SOURCES],
            waiting: [None; WAITING],
            unsent: [false; SOURCES],
            history: [0; HISTORY],
            recorded: 0,
            identifier,
            inhibit: INHIBIT,
            next_us: 0,
        }
    }

    /// Sets or clears the error of a source; a change queues a message.
    pub(crate) fn set(&mut self, source: Source, error: Option<ErrorReport>) {
        let Some(slot) = self.active.get_mut(source.index()) else { return };
        if *slot == error {
            return;
        }
        *slot = error;
        let message = self.message(error);
        // Behind one that waits for space, later changes wait as well.
        let is_full = self.unsent.contains(&true);
        match self.waiting.iter_mut().find(|message| message.is_none()).filter(|_| !is_full) {
            Some(free) => *free = Some(message),
            None => {
                if let Some(unsent) = self.unsent.get_mut(source.index()) {
                    *unsent = true;
                }
            }
        }
        if error.is_some() {
            let [low, high, _, a, b, ..] = message;
            self.history.rotate_right(1);
            // The upper half is manufacturer-specific: the first two bytes of the information.
            self.history[0] = u32::from_le_bytes([low, high, a, b]);
            self.recorded = (self.recorded + 1).min(HISTORY as u8);
        }
    }

    /// Message of a change, with the present error register.
    fn message(&self, error: Option<ErrorReport>) -> [u8; 8] {
        let ErrorReport { code, information } = error.unwrap_or(ErrorReport::code(NO_ERROR));
        let ([low, high], [a, b, c, d, e]) = (code.to_le_bytes(), information);
        [low, high, self.register(), a, b, c, d, e]
    }

    /// Present state of a source whose change found no space.
    fn take_unsent(&mut self) -> Option<[u8; 8]> {
        let sources = || self.active.iter().zip(&self.unsent).enumerate().filter(|(_, (_, unsent))| **unsent);
        let ended = sources().find(|(_, (error, _))| error.is_none());
        let (index, (error, _)) = ended.or_else(|| sources().next())?;
        let message = self.message(*error);
        *self.unsent.get_mut(index)? = false;
        Some(message)
    }

    /// Returns object 1001.
    pub(crate) fn register(&self) -> u8 {
        self.active.iter().flatten().fold(0, |register, error| register | error.register())
    }

    /// Returns object 603F: code of the newest error in the history, 0 if it is empty.
    pub(super) fn newest(&self) -> u32 {
        self.history(1).unwrap_or(0) & 0xFFFF
    }

    /// Reads object 1003.
    pub(super) fn history(&self, sub: u8) -> Result<u32, Abort> {
        match sub.checked_sub(1) {
            None => Ok(u32::from(self.recorded)),
            Some(index) if index < self.recorded => {
                self.history.get(usize::from(index)).copied().ok_or(Abort::NoData)
            }
            Some(_) => Err(Abort::NoData),
        }
    }

    /// Clears the history, by writing 0 to 1003:0.
    pub(super) fn forget(&mut self, value: u32) -> Result<(), Abort> {
        if value != 0 {
            return Err(Abort::Range);
        }
        self.recorded = 0;
        Ok(())
    }

    /// Returns the next message.
    pub(super) fn poll(&mut self, now_us: u64) -> Option<Frame> {
        if now_us < self.next_us {
            return None;
        }
        let message = match self.waiting[0].take() {
            Some(message) => message,
            None => self.take_unsent()?,
        };
        self.waiting.rotate_left(1);
        self.next_us = now_us + 100 * u64::from(self.inhibit);
        (self.identifier >> 31 == 0).then(|| Frame::new(self.identifier as u16, &message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOST_LOST: ErrorReport = ErrorReport::code(0x8130);
    const OVERCURRENT: ErrorReport = ErrorReport::code(0x2310);

    #[test]
    fn an_error_is_reported_once_at_its_begin_and_once_at_its_end() {
        let mut emergency = Emergency { inhibit: 0, ..Emergency::new(0x85) };
        emergency.set(Source::Heartbeat(0), Some(HOST_LOST));
        emergency.set(Source::Heartbeat(0), Some(HOST_LOST));
        emergency.set(Source::Drive, Some(OVERCURRENT));
        emergency.set(Source::Heartbeat(0), None);
        let sent: [Option<Frame>; 4] = core::array::from_fn(|_| emergency.poll(0));
        let expected = [[0x30, 0x81, 0b01_0001], [0x10, 0x23, 0b01_0011], [0, 0, 0b00_0011]];
        let expected = expected.map(|[a, b, c]| Some(Frame::new(0x85, &[a, b, c, 0, 0, 0, 0, 0])));
        assert_eq!((&sent[..3], sent[3]), (&expected[..], None));
        assert_eq!(emergency.register(), 0b11);
        assert_eq!((emergency.history(0), emergency.history(1)), (Ok(2), Ok(0x2310)));
        assert_eq!((emergency.history(2), emergency.history(3)), (Ok(0x8130), Err(Abort::NoData)));
        assert_eq!((emergency.forget(1), emergency.forget(0)), (Err(Abort::Range), Ok(())));
        assert_eq!(emergency.history(1), Err(Abort::NoData));
    }

    #[test]
    fn each_class_of_codes_has_its_bit_of_the_error_register() {
        let codes = [0x2000, 0x2310, 0x3220, 0x4210, 0x8130, 0x8250, 0x5410, 0x7305, 0x8400, 0xFF02];
        for (code, bit) in codes.into_iter().zip([1, 1, 2, 3, 4, 4, 5, 5, 5, 7]) {
            assert_eq!(ErrorReport::code(code).register(), 1 | 1 << bit, "{code:04X}");
        }
        for code in [0x1000, 0x6100, 0x9000] {
            assert_eq!(ErrorReport::code(code).register(), 1, "{code:04X}");
        }
    }

    /// Codes that are sent in a second, one per inhibit time.
    fn codes(emergency: &mut Emergency) -> Vec<u16> {
        let mut next_us = 0;
        let sent = (0..1000).filter_map(|millisecond| {
            let sent = emergency.poll(1000 * millisecond)?;
            assert!(millisecond >= next_us, "inhibited");
            next_us = millisecond + u64::from(emergency.inhibit) / 10;
            Some(u16::from_le_bytes([sent.data()[0], sent.data()[1]]))
        });
        sent.collect()
    }

    #[test]
    fn the_inhibit_time_limits_messages_and_the_last_is_the_present_state() {
        let mut emergency = Emergency::new(0x81);
        for code in 1..=20 {
            emergency.set(Source::Drive, Some(ErrorReport::code(code)));
        }
        assert_eq!(codes(&mut emergency), [1, 2, 3, 4, 20]);
        assert_eq!((emergency.history(0), emergency.history(1)), (Ok(8), Ok(20)));
        // Each source ends with its present state, ended errors first.
        for _ in 0..20 {
            for source in [Source::Receive(0), Source::Heartbeat(0)] {
                emergency.set(source, Some(HOST_LOST));
                emergency.set(source, None);
            }
        }
        emergency.set(Source::Drive, Some(OVERCURRENT));
        emergency.next_us = 0;
        assert_eq!(codes(&mut emergency), [0x8130, 0, 0x8130, 0, 0, 0, 0x2310]);
        emergency.set(Source::Drive, None);
        emergency.next_us = 0;
        assert_eq!((codes(&mut emergency), emergency.register()), (Vec::from([0]), 0));
    }
}
