//! Layer setting services (LSS): other node-IDs for boards that start with the same ones. A host addresses a
//! node by its identity (1018), so equal node-IDs do not matter.
//!
//! ```text
//! request 7E5 and answer 7E4 have eight bytes, numbers little-endian; byte 0 is the service
//! 04          all nodes: 0 waiting, 1 configuration (both nodes of a board, so select by identity instead)
//! 40 to 43    the node with this vendor, product, revision and serial number: configuration; answer 44
//! 46 to 4B    the same with ranges of revision and serial number (low, high) in any state; answer 4F
//! in configuration:
//! 11          node-ID (2001); answer 11 and error
//! 13          bit rate (2002) as table 0 and its index; answer 13 and error
//! 17          stores like "save" to 1010, so all parameters; answer 17 and error once the flash is written
//! 5A to 5D    identity; 5E: node-ID
//! ```
//!
//! Source: CiA 305 version 2.2. Not built: fastscan and the search for nodes without node-ID, since every
//! node has one; activation of a bit rate without a restart.

use super::communication::Identity;
use super::dictionary::Object;
use super::node_id::NodeId;
use super::stored_parameters::{BIT_RATE, NODE_ID};

/// COB-IDs of requests and answers.
pub(crate) const REQUEST: u16 = 0x7E5;
pub(crate) const ANSWER: u16 = 0x7E4;

const SET_NODE_ID: u8 = 0x11;
const SET_BIT_RATE: u8 = 0x13;
const STORE: u8 = 0x17;
const SELECTED: u8 = 0x44;
const IDENTIFIED: u8 = 0x4F;

/// Error of an answer: done, out of range, storing failed; storing refused now (255 and its own number).
const DONE: u32 = 0;
const OUT_OF_RANGE: u32 = 1;
const NOT_STORED: u32 = 2;
const NOT_NOW: u32 = 255 | 1 << 8;

/// What a request asks of the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Setting {
    /// Writes an object; [`Lss::written`] reports the result.
    Write(Object, u32),
    /// Stores the parameters; [`Lss::stored`] reports the result.
    Store,
}

/// Number of fields that matched in sequence, out of those of an address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Matched(u8);

impl Matched {
    /// Checks the next field; returns whether it was the last of `count` and all matched.
    fn check(&mut self, field: u8, count: u8, matches: bool) -> bool {
        self.0 = if matches && (field == 0 || field == self.0) { field + 1 } else { 0 };
        self.0 == count
    }
}

/// Request whose result is still awaited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Asked {
    /// An object is written for this service.
    Write(u8),
    /// To store; a store that began before does not count.
    Store,
    /// The parameters are being stored.
    Storing,
}

/// LSS slave of one node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lss {
    configures: bool,
    selected: Matched,
    identified: Matched,
    asked: Option<Asked>,
    answer: Option<[u8; 8]>,
}

impl Lss {
    /// Handles a request.
    pub(crate) fn request(&mut self, request: [u8; 8], identity: &Identity, node: NodeId) -> Option<Setting> {
        let [service, one, two, three, four, ..] = request;
        let number = u32::from_le_bytes([one, two, three, four]);
        let Identity { vendor, product, revision, serial, .. } = *identity;
        let values = [vendor, product, revision, serial];
        match service {
            0x04 if one <= 1 => {
                self.configures = one == 1;
                self.asked = None;
            }
            0x40..=0x43 => {
                let field = service - 0x40;
                let matches = values.get(usize::from(field)) == Some(&number);
                if self.selected.check(field, 4, matches) {
                    self.configures = true;
                    self.answer(SELECTED, 0);
                }
            }
            0x46..=0x4B => {
                let matches = match service {
                    0x46 => number == vendor,
                    0x47 => number == product,
                    0x48 => number <= revision,
                    0x49 => number >= revision,
                    0x4A => number <= serial,
                    _ => number >= serial,
                };
                if self.identified.check(service - 0x46, 6, matches) {
                    self.answer(IDENTIFIED, 0);
                }
            }
            _ if !self.configures => {}
            SET_NODE_ID if matches!(one, 1..=127) => {
                self.asked = Some(Asked::Write(service));
                return Some(Setting::Write(NODE_ID, u32::from(one)));
            }
            SET_BIT_RATE if let (0, Some(rate)) = (one, bit_rate(two)) => {
                self.asked = Some(Asked::Write(service));
                return Some(Setting::Write(BIT_RATE, rate));
            }
            SET_NODE_ID | SET_BIT_RATE => self.answer(service, OUT_OF_RANGE),
            STORE => {
                self.asked = Some(Asked::Store);
                return Some(Setting::Store);
            }
            0x5A..=0x5D => {
                let value = values.get(usize::from(service - 0x5A)).copied().unwrap_or(0);
                self.answer(service, value);
            }
            0x5E => self.answer(service, u32::from(node.number())),
            _ => {}
        }
        None
    }

    /// Answers a [`Setting::Write`].
    pub(crate) fn written(&mut self, is_done: bool) {
        if let Some(Asked::Write(service)) = self.asked.take() {
            self.answer(service, if is_done { DONE } else { OUT_OF_RANGE });
        }
    }

    /// Answers a [`Setting::Store`] that the node refuses now.
    pub(crate) fn refused(&mut self) {
        self.end_store(NOT_NOW);
    }

    /// Handles the begin of a store, or of one of the defaults instead.
    pub(crate) fn store_begins(&mut self, of_defaults: bool) {
        match self.asked {
            Some(Asked::Store) if of_defaults => self.end_store(NOT_STORED),
            Some(Asked::Store) => self.asked = Some(Asked::Storing),
            _ => {}
        }
    }

    /// Answers a [`Setting::Store`] whose store has begun.
    pub fn stored(&mut self, is_done: bool) {
        if self.asked == Some(Asked::Storing) {
            self.end_store(if is_done { DONE } else { NOT_STORED });
        }
    }

    fn end_store(&mut self, error: u32) {
        self.asked = None;
        self.answer(STORE, error);
    }

    /// Takes the answer to be sent.
    pub(crate) fn take_answer(&mut self) -> Option<[u8; 8]> {
        self.answer.take()
    }

    fn answer(&mut self, service: u8, value: u32) {
        let [one, two, three, four] = value.to_le_bytes();
        self.answer = Some([service, one, two, three, four, 0, 0, 0]);
    }
}

/// Bit rate in kbit/s of an index of CiA 301's table.
const fn bit_rate(index: u8) -> Option<u32> {
    Some(match index {
        0 => 1000,
        2 => 500,
        3 => 250,
        4 => 125,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: Identity =
        Identity { vendor: 7, product: 2, revision: 1 << 16, ..Identity::scarab(0xDEAD_BEEF, "") };

    fn node() -> NodeId {
        NodeId::new(5).expect("a number")
    }

    /// Sends a request; returns the setting and the answer's first six bytes.
    fn send(lss: &mut Lss, service: u8, value: u32) -> (Option<Setting>, Option<[u8; 5]>) {
        let [one, two, three, four] = value.to_le_bytes();
        let setting = lss.request([service, one, two, three, four, 0, 0, 0], &IDENTITY, node());
        (setting, lss.take_answer().map(|[a, b, c, d, e, ..]| [a, b, c, d, e]))
    }

    fn select(lss: &mut Lss, identity: [u32; 4]) -> Option<[u8; 5]> {
        let answers = [0, 1, 2, 3].map(|field: u8| send(lss, 0x40 + field, identity[usize::from(field)]).1);
        assert_eq!(answers[..3], [None; 3]);
        answers[3]
    }

    const WHOLE: [u32; 4] = [7, 2, 1 << 16, 0xDEAD_BEEF];

    #[test]
    fn only_the_whole_identity_selects_a_node() {
        for field in 0..4 {
            let mut lss = Lss::default();
            let mut other = WHOLE;
            other[field] += 1;
            assert_eq!(select(&mut lss, other), None);
            assert_eq!(send(&mut lss, 0x5E, 0), (None, None), "{field}");
        }
        let mut lss = Lss::default();
        // A field out of order does not count.
        send(&mut lss, 0x40, 7);
        send(&mut lss, 0x42, 1 << 16);
        assert_eq!(send(&mut lss, 0x43, 0xDEAD_BEEF).1, None);
        assert_eq!(select(&mut lss, WHOLE), Some([0x44, 0, 0, 0, 0]));
        assert_eq!(send(&mut lss, 0x5E, 0).1, Some([0x5E, 5, 0, 0, 0]));
        assert_eq!(send(&mut lss, 0x5D, 0).1, Some([0x5D, 0xEF, 0xBE, 0xAD, 0xDE]));
        // A reserved state changes nothing.
        send(&mut lss, 0x04, 2);
        assert_eq!(send(&mut lss, 0x5E, 0).1, Some([0x5E, 5, 0, 0, 0]));
        // Waiting again: no answer.
        send(&mut lss, 0x04, 0);
        assert_eq!(send(&mut lss, 0x5E, 0), (None, None));
    }

    #[test]
    fn a_range_of_serial_numbers_is_searched() {
        let ask = |low: u32, high: u32| {
            let mut lss = Lss::default();
            let fields = [7, 2, 0, u32::MAX, low, high];
            (0x46..).zip(fields).filter_map(|(service, value)| send(&mut lss, service, value).1).last()
        };
        let found = Some([0x4F, 0, 0, 0, 0]);
        assert_eq!(ask(0, u32::MAX), found);
        assert_eq!(ask(0xDEAD_BEEF, 0xDEAD_BEEF), found);
        assert_eq!(ask(0, 0xDEAD_BEEE), None);
        assert_eq!(ask(0xDEAD_BEF0, u32::MAX), None);
    }

    #[test]
    fn settings_are_answered_with_their_results() {
        let mut lss = Lss::default();
        // Waiting: ignored.
        assert_eq!(send(&mut lss, SET_NODE_ID, 9), (None, None));
        send(&mut lss, 0x04, 1);
        for invalid in [0, 128, 255] {
            assert_eq!(send(&mut lss, SET_NODE_ID, invalid), (None, Some([0x11, 1, 0, 0, 0])));
        }
        for valid in [127, 1, 9] {
            assert_eq!(send(&mut lss, SET_NODE_ID, valid), (Some(Setting::Write(NODE_ID, valid)), None));
        }
        lss.written(true);
        assert_eq!(lss.take_answer().map(|answer| [answer[0], answer[1]]), Some([0x11, 0]));
        for (value, rate) in [(0x0000, 1000), (0x0200, 500), (0x0300, 250), (0x0400, 125)] {
            assert_eq!(send(&mut lss, SET_BIT_RATE, value).0, Some(Setting::Write(BIT_RATE, rate)));
        }
        assert_eq!(send(&mut lss, SET_BIT_RATE, 0x0100), (None, Some([0x13, 1, 0, 0, 0])));
        assert_eq!(send(&mut lss, SET_BIT_RATE, 0x0001), (None, Some([0x13, 1, 0, 0, 0])));
        assert_eq!(send(&mut lss, STORE, 0), (Some(Setting::Store), None));
        // The end of a store that began before is none of this one.
        lss.stored(true);
        assert_eq!(lss.take_answer(), None);
        lss.store_begins(false);
        lss.stored(false);
        assert_eq!(lss.take_answer().map(|answer| [answer[0], answer[1]]), Some([0x17, 2]));
        // Defaults were asked for since.
        assert_eq!(send(&mut lss, STORE, 0), (Some(Setting::Store), None));
        lss.store_begins(true);
        assert_eq!(lss.take_answer().map(|answer| [answer[0], answer[1]]), Some([0x17, 2]));
        // A save by 1010 is not answered here.
        lss.store_begins(false);
        lss.stored(true);
        assert_eq!(lss.take_answer(), None);
    }
}
