//! A node of the bus as a silent listener knows it: object values that its frames have shown.
//!
//! ```text
//! mapped object in a PDO                 value
//! expedited SDO write, once confirmed    value, also of PDO parameters
//! expedited SDO read, once answered      value
//! boot-up message                        communication parameters are the defaults again
//! ```
//!
//! A listener sends nothing, so values that no frame carries stay unknown. Stored PDO parameters are
//! unknown too: the defaults are assumed until a host writes or reads them. A PDO whose length does not fit
//! its mapping is reported and not decoded.

use std::collections::{BTreeMap, BTreeSet};

use scarab::bus::Frame;
use scarab::bus::dictionary::{Object, find};

/// PDOs per direction.
const PDOS: u16 = 4;
const RECEIVED: (u16, u16) = (0x1400, 0x1600);
const TRANSMITTED: (u16, u16) = (0x1800, 0x1A00);
/// Bit of a PDO's COB-ID that disables it.
const DISABLED: u32 = 1 << 31;
const COMMUNICATION: core::ops::Range<u16> = 0x1000..0x2000;
/// Indices below are dummy entries.
const FIRST_OBJECT: u16 = 0x1000;

/// NMT state in a heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NmtState {
    /// 0: the node has started.
    BootUp,
    /// 4.
    Stopped,
    /// 5.
    Operational,
    /// 127.
    PreOperational,
}

impl NmtState {
    const fn from_byte(byte: u8) -> Option<Self> {
        match byte & 0x7F {
            0 => Some(Self::BootUp),
            4 => Some(Self::Stopped),
            5 => Some(Self::Operational),
            127 => Some(Self::PreOperational),
            _ => None,
        }
    }

    /// State as the end of a sentence.
    pub(crate) const fn words(self) -> &'static str {
        match self {
            Self::BootUp => "has started",
            Self::Stopped => "is stopped",
            Self::Operational => "is operational",
            Self::PreOperational => "is pre-operational",
        }
    }
}

/// What a frame was, besides values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// Emergency message of the node.
    Emergency,
    /// Another NMT state in its heartbeat.
    Nmt(NmtState),
    /// PDO whose length, bytes, does not fit its mapping; reported once.
    Unmapped {
        /// Length of the frame.
        length: usize,
        /// Length of the mapped objects.
        mapped: usize,
    },
}

#[derive(Clone, Copy, Debug)]
struct Known {
    raw: u32,
    bytes: usize,
    at_s: f64,
}

/// SDO request without an answer yet.
#[derive(Clone, Copy, Debug)]
enum Asked {
    Read(Object),
    Write(Object, Known),
}

/// What the frames have shown about one node.
#[derive(Clone, Debug, Default)]
pub(crate) struct Node {
    id: u8,
    values: BTreeMap<(u16, u8), Known>,
    asked: Option<Asked>,
    state: Option<NmtState>,
    /// Time of the node's last own frame, s.
    heard_s: Option<f64>,
    /// COB-IDs of PDOs that do not fit their mapping.
    unmapped: BTreeSet<u16>,
}

/// Number in the first four bytes, little-endian.
fn number(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}

impl Node {
    /// A node of this ID, of which nothing is known.
    pub fn new(id: u8) -> Self {
        Self { id, ..Self::default() }
    }

    /// Node-ID.
    pub(crate) fn id(&self) -> u8 {
        self.id
    }

    /// Time of the node's last own frame, s.
    pub(crate) fn heard_s(&self) -> Option<f64> {
        self.heard_s
    }

    /// COB-ID of its emergency messages.
    pub(crate) fn emergency(&self) -> u16 {
        (self.parameter(0x1014, 0) & 0x7FF) as u16
    }

    fn known(&self, index: u16, sub: u8) -> Option<Known> {
        self.values.get(&(index, sub)).copied()
    }

    /// Raw value of an object, if known.
    pub(crate) fn raw(&self, index: u16, sub: u8) -> Option<u32> {
        self.known(index, sub).map(|known| known.raw)
    }

    /// The object among these that was seen last.
    pub(crate) fn newest(&self, indices: &[u16]) -> Option<u16> {
        let seen = indices.iter().filter_map(|index| Some((*index, self.time_s(*index, 0)?)));
        seen.max_by(|one, other| one.1.total_cmp(&other.1)).map(|(index, _)| index)
    }

    /// Value of a signed object, if known.
    pub(crate) fn signed(&self, index: u16) -> Option<i32> {
        let known = self.known(index, 0)?;
        let unused = 32 - 8 * known.bytes.clamp(1, 4) as u32;
        Some((known.raw << unused) as i32 >> unused)
    }

    /// Value of a REAL32 object, if known and a number.
    pub(crate) fn real(&self, index: u16, sub: u8) -> Option<f32> {
        self.raw(index, sub).map(f32::from_bits).filter(|value| value.is_finite())
    }

    /// Time at which a value was last seen, s.
    pub(crate) fn time_s(&self, index: u16, sub: u8) -> Option<f64> {
        self.known(index, sub).map(|known| known.at_s)
    }

    /// Value of a communication parameter: the one seen, or the default.
    fn parameter(&self, index: u16, sub: u8) -> u32 {
        self.raw(index, sub).unwrap_or_else(|| {
            let added = |row: &scarab::bus::dictionary::Row| u32::from(row.plus_node) * u32::from(self.id);
            find(Object::at(index, sub)).map_or(0, |row| row.default + added(row))
        })
    }

    /// Takes a frame of the bus at this time, s.
    pub(crate) fn take(&mut self, frame: &Frame, now_s: f64) -> Option<Event> {
        let own = u16::from(self.id);
        let id = frame.id();
        if id == 0x600 + own {
            self.request(frame, now_s);
            return None;
        }
        let event = if id == 0x580 + own {
            self.answer(frame, now_s);
            None
        } else if id == 0x700 + own {
            self.heartbeat(frame)
        } else if id == self.emergency() {
            Some(Event::Emergency)
        } else if let Some(event) = self.pdo(frame, TRANSMITTED, now_s) {
            event
        } else {
            return self.pdo(frame, RECEIVED, now_s).flatten();
        };
        self.heard_s = Some(now_s);
        event
    }

    fn heartbeat(&mut self, frame: &Frame) -> Option<Event> {
        let state = NmtState::from_byte(*frame.data().first()?)?;
        if state == NmtState::BootUp {
            self.values.retain(|(index, _), _| !COMMUNICATION.contains(index));
            self.unmapped.clear();
        }
        let is_new = self.state != Some(state) || state == NmtState::BootUp;
        self.state = Some(state);
        is_new.then_some(Event::Nmt(state))
    }

    /// Takes a frame as a PDO of one direction; `None` if it is none. Several PDOs may have its COB-ID.
    fn pdo(
        &mut self,
        frame: &Frame,
        (communication, mapping): (u16, u16),
        now_s: f64,
    ) -> Option<Option<Event>> {
        let is_own = |pdo: &u16| {
            let cob = self.parameter(communication + pdo, 1);
            cob & DISABLED == 0 && cob & 0x7FF == u32::from(frame.id())
        };
        let own: Vec<u16> = (0..PDOS).filter(is_own).collect();
        if own.is_empty() {
            return None;
        }
        let events = own.into_iter().filter_map(|pdo| self.mapped(frame, mapping + pdo, now_s));
        Some(events.collect::<Vec<_>>().pop())
    }

    /// Decodes a PDO by the mapping at this index.
    fn mapped(&mut self, frame: &Frame, mapping: u16, now_s: f64) -> Option<Event> {
        let entries = self.parameter(mapping, 0).min(8) as u8;
        let entries: Vec<u32> = (1..=entries).map(|entry| self.parameter(mapping, entry)).collect();
        let bytes = |entry: &u32| (entry & 0xFF) as usize / 8;
        let (length, mapped) = (frame.data().len(), entries.iter().map(bytes).sum());
        // A node ignores the rest of a longer received PDO (CiA 301).
        if length < mapped || length > mapped && mapping >= TRANSMITTED.1 {
            return self.unmapped.insert(frame.id()).then_some(Event::Unmapped { length, mapped });
        }
        let mut data = frame.data();
        for entry in entries {
            let Some((value, rest)) = data.split_at_checked(bytes(&entry)) else { break };
            data = rest;
            let index = (entry >> 16) as u16;
            if index >= FIRST_OBJECT {
                let known = Known { raw: number(value), bytes: value.len(), at_s: now_s };
                self.values.insert((index, (entry >> 8 & 0xFF) as u8), known);
            }
        }
        None
    }

    /// Takes a request of an SDO client.
    fn request(&mut self, frame: &Frame, now_s: f64) {
        let Some([command, low, high, sub, data @ ..]) = frame.full() else { return };
        let object = Object::at(u16::from_le_bytes([low, high]), sub);
        let (is_expedited, has_size) = (command & 2 != 0, command & 1 != 0);
        let unused = if has_size { usize::from(command >> 2 & 3) } else { 0 };
        match command >> 5 {
            1 if is_expedited => {
                let bytes = 4 - unused;
                let known = Known { raw: number(&data[..bytes]), bytes, at_s: now_s };
                self.asked = Some(Asked::Write(object, known));
            }
            2 => self.asked = Some(Asked::Read(object)),
            // Segments and blocks carry no known values.
            _ => self.asked = None,
        }
    }

    /// Takes an answer of the node's SDO server.
    fn answer(&mut self, frame: &Frame, now_s: f64) {
        let Some([command, low, high, sub, data @ ..]) = frame.full() else { return };
        let object = Object::at(u16::from_le_bytes([low, high]), sub);
        let known = match (command >> 5, self.asked) {
            (3, Some(Asked::Write(written, known))) if written == object => Some(known),
            (2, Some(Asked::Read(read))) if read == object && command & 2 != 0 => {
                let unused = if command & 1 != 0 { usize::from(command >> 2 & 3) } else { 0 };
                let bytes = 4 - unused;
                Some(Known { raw: number(&data[..bytes]), bytes, at_s: now_s })
            }
            _ => None,
        };
        self.asked = None;
        if let Some(known) = known {
            self.values.insert((object.index, object.sub), known);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_client::candump;

    fn write(node: &mut Node, (index, sub): (u16, u8), value: u32, bytes: u8) {
        let [low, high] = index.to_le_bytes();
        let [a, b, c, d] = value.to_le_bytes();
        let command = 0x23 | (4 - bytes) << 2;
        let id = u16::from(node.id());
        node.take(&Frame::new(0x600 + id, &[command, low, high, sub, a, b, c, d]), 1.0);
        node.take(&Frame::new(0x580 + id, &[0x60, low, high, sub, 0, 0, 0, 0]), 1.0);
    }

    #[test]
    fn the_default_mapping_is_known_from_the_start() {
        let mut node = Node::new(3);
        node.take(&Frame::new(0x283, &[0xC0, 0xBD, 0xF0, 0xFF, 0x40, 0x42, 0x0F, 0]), 0.5);
        assert_eq!((node.signed(0x6064), node.signed(0x606C)), (Some(-1_000_000), Some(1_000_000)));
        assert_eq!(node.time_s(0x6064, 0), Some(0.5));
        node.take(&Frame::new(0x383, &[0x18, 0xFC]), 0.5);
        assert_eq!(node.signed(0x6077), Some(-1000));
        node.take(&Frame::new(0x303, &[1, 0, 0, 0]), 0.5);
        assert_eq!(node.signed(0x607A), Some(1));
        // Frames of another node change nothing.
        node.take(&Frame::new(0x284, &[0; 8]), 0.6);
        assert_eq!(node.signed(0x6064), Some(-1_000_000));
    }

    #[test]
    fn a_mapping_that_a_host_writes_is_followed_until_the_node_starts_again() {
        // The compact mapping of docs/bus.md, as the knee hears it: one frame carries both targets.
        let mut knee = Node::new(2);
        write(&mut knee, (0x1401, 1), 0x8000_0302, 4);
        write(&mut knee, (0x1601, 0), 0, 1);
        write(&mut knee, (0x1601, 1), 0x0007_0020, 4);
        write(&mut knee, (0x1601, 2), 0x607A_0020, 4);
        write(&mut knee, (0x1601, 0), 2, 1);
        knee.take(&Frame::new(0x301, &[1, 0, 0, 0, 2, 0, 0, 0]), 1.0);
        assert_eq!(knee.signed(0x607A), None, "still disabled");
        write(&mut knee, (0x1401, 1), 0x301, 4);
        knee.take(&Frame::new(0x301, &[1, 0, 0, 0, 2, 0, 0, 0]), 1.0);
        assert_eq!(knee.signed(0x607A), Some(2));
        assert_eq!(knee.take(&Frame::new(0x702, &[0]), 2.0), Some(Event::Nmt(NmtState::BootUp)));
        knee.take(&Frame::new(0x301, &[1, 0, 0, 0, 3, 0, 0, 0]), 2.0);
        assert_eq!(knee.signed(0x607A), Some(2), "the default COB-ID is 302 again");
    }

    #[test]
    fn a_pdo_that_does_not_fit_its_mapping_is_reported_once_and_not_decoded() {
        let mut node = Node::new(1);
        let short = Frame::new(0x281, &[1, 2, 3, 4, 5, 6]);
        assert_eq!(node.take(&short, 1.0), Some(Event::Unmapped { length: 6, mapped: 8 }));
        assert_eq!((node.take(&short, 1.0), node.signed(0x6064), node.heard_s()), (None, None, Some(1.0)));
        // The rest of a longer received PDO is ignored.
        assert_eq!(node.take(&Frame::new(0x301, &[7, 0, 0, 0, 9]), 1.0), None);
        assert_eq!(node.signed(0x607A), Some(7));
    }

    #[test]
    fn a_started_node_has_its_default_emergency_again() {
        let mut node = Node::new(1);
        write(&mut node, (0x1014, 0), 0x90, 4);
        assert_eq!(node.take(&Frame::new(0x81, &[0; 8]), 1.0), None);
        assert_eq!(node.take(&Frame::new(0x90, &[0; 8]), 1.0), Some(Event::Emergency));
        node.take(&Frame::new(0x701, &[0]), 2.0);
        assert_eq!(node.take(&Frame::new(0x81, &[0; 8]), 2.0), Some(Event::Emergency));
    }

    #[test]
    fn values_of_sdos_count_once_they_are_confirmed() {
        let mut node = Node::new(1);
        node.take(&Frame::new(0x601, &[0x2F, 0x60, 0x60, 0, 8, 0, 0, 0]), 1.0);
        assert_eq!(node.raw(0x6060, 0), None);
        node.take(&Frame::new(0x581, &[0x80, 0x60, 0x60, 0, 0x11, 0, 9, 6]), 1.0);
        assert_eq!(node.raw(0x6060, 0), None, "it was refused");
        node.take(&Frame::new(0x601, &[0x2F, 0x60, 0x60, 0, 8, 0, 0, 0]), 1.0);
        node.take(&Frame::new(0x581, &[0x60, 0x60, 0x60, 0, 0, 0, 0, 0]), 1.0);
        assert_eq!(node.raw(0x6060, 0), Some(8));
        node.take(&Frame::new(0x601, &[0x40, 0, 0x21, 2, 0, 0, 0, 0]), 1.0);
        node.take(&Frame::new(0x581, &[0x4F, 0, 0x21, 2, 9, 0, 0, 0]), 1.0);
        assert_eq!(node.raw(0x2100, 2), Some(9));
        // A segment of a block looks like an answer, but answers no such request.
        node.take(&Frame::new(0x601, &[0xA0, 0x40, 0x21, 2, 127, 0, 0, 0]), 1.0);
        node.take(&Frame::new(0x581, &[0x43, 0, 0x21, 2, 7, 0, 0, 0]), 1.0);
        assert_eq!(node.raw(0x2100, 2), Some(9));
    }

    /// Recorded session of another host (CORC) with other nodes.
    #[test]
    fn a_recorded_hosts_set_up_is_understood() {
        let text = include_str!("../../../../../tests/data/corc_x2_session.candump");
        let mut nodes: Vec<Node> = (1..=4).map(Node::new).collect();
        let (mut frames, mut emergencies) = (0, 0);
        for line in text.lines() {
            let Some((time_s, frame)) = candump::parse(line).expect("a line of candump") else { continue };
            frames += 1;
            for node in &mut nodes {
                emergencies += usize::from(node.take(&frame, time_s) == Some(Event::Emergency));
            }
        }
        assert!(frames > 500 && emergencies == 0, "{frames} frames, {emergencies} emergencies");
        for node in &nodes {
            assert!(node.heard_s().is_some());
            // {6041}, {6064, 606C}, {6077}, {219A} at 180, 280, 380, 480 + node, by SYNC.
            let own = u32::from(node.id());
            let sent: Vec<[u32; 3]> = (0..4)
                .map(|pdo| {
                    [(0x1800, 1), (0x1A00, 1), (0x1800, 2)]
                        .map(|(index, sub)| node.parameter(index + pdo, sub))
                })
                .collect();
            let expected =
                [(0x180, 0x6041_0010), (0x280, 0x6064_0020), (0x380, 0x6077_0010), (0x480, 0x219A_0020)]
                    .map(|(cob, object)| [cob + own, object, 1]);
            assert_eq!(sent, expected, "node {own}");
            assert!(node.signed(0x607A).is_some() && node.raw(0x6040, 0).is_some(), "node {own}");
        }
    }
}
