//! A node of the bus as a silent listener knows it: object values that its frames have shown.
//!
//! ```text
//! mapped object in a PDO                 value
//! expedited SDO write, once confirmed    value, also of PDO parameters
//! expedited SDO read, once answered      value
//! boot-up message                        PDO parameters are the defaults again
//! ```
//!
//! A listener sends nothing, so values that nobody sends or reads stay unknown. PDO parameters that the node
//! had stored before are unknown too: their defaults are assumed until a host writes or reads them.

use std::collections::BTreeMap;

use scarab::bus::Frame;
use scarab::bus::dictionary::{Object, find};

/// PDOs per direction.
const PDOS: u16 = 4;
const RECEIVED: (u16, u16) = (0x1400, 0x1600);
const TRANSMITTED: (u16, u16) = (0x1800, 0x1A00);
/// Bit of a PDO's COB-ID that disables it.
const DISABLED: u32 = 1 << 31;
/// Objects of PDO parameters.
const PDO_PARAMETERS: core::ops::Range<u16> = 0x1400..0x1C00;
/// Indices below are dummy entries.
const FIRST_OBJECT: u16 = 0x1000;

/// NMT state in a heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NmtState {
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
    const fn of(byte: u8) -> Option<Self> {
        match byte & 0x7F {
            0 => Some(Self::BootUp),
            4 => Some(Self::Stopped),
            5 => Some(Self::Operational),
            127 => Some(Self::PreOperational),
            _ => None,
        }
    }

    /// Words.
    #[must_use]
    pub const fn words(self) -> &'static str {
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
pub enum Event {
    /// Emergency message of the node.
    Emergency,
    /// Another NMT state in its heartbeat.
    Nmt(NmtState),
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
#[derive(Clone, Debug)]
pub struct Node {
    id: u8,
    values: BTreeMap<(u16, u8), Known>,
    asked: Option<Asked>,
    state: Option<NmtState>,
    is_seen: bool,
}

/// Number in the first four bytes, little-endian.
fn number(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}

impl Node {
    /// A node of this ID, of which nothing is known.
    #[must_use]
    pub fn new(id: u8) -> Self {
        Self { id, values: BTreeMap::new(), asked: None, state: None, is_seen: false }
    }

    /// Node-ID.
    #[must_use]
    pub fn id(&self) -> u8 {
        self.id
    }

    /// Whether the node has sent anything.
    #[must_use]
    pub fn is_seen(&self) -> bool {
        self.is_seen
    }

    /// NMT state of its last heartbeat.
    #[must_use]
    pub fn state(&self) -> Option<NmtState> {
        self.state
    }

    fn known(&self, index: u16, sub: u8) -> Option<Known> {
        self.values.get(&(index, sub)).copied()
    }

    /// Raw value of an object, if known.
    #[must_use]
    pub fn raw(&self, index: u16, sub: u8) -> Option<u32> {
        self.known(index, sub).map(|known| known.raw)
    }

    /// Value of a signed object, if known.
    #[must_use]
    pub fn signed(&self, index: u16) -> Option<i32> {
        let known = self.known(index, 0)?;
        let unused = 32 - 8 * known.bytes.clamp(1, 4) as u32;
        Some((known.raw << unused) as i32 >> unused)
    }

    /// Value of a REAL32 object, if known and a number.
    #[must_use]
    pub fn real(&self, index: u16, sub: u8) -> Option<f32> {
        self.raw(index, sub).map(f32::from_bits).filter(|value| value.is_finite())
    }

    /// Time at which a value was last seen, s.
    #[must_use]
    pub fn time_s(&self, index: u16, sub: u8) -> Option<f64> {
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
    pub fn take(&mut self, frame: &Frame, now_s: f64) -> Option<Event> {
        let own = u16::from(self.id);
        let id = frame.id();
        if id == 0x600 + own {
            self.request(frame, now_s);
        } else if id == 0x580 + own {
            self.is_seen = true;
            self.answer(frame, now_s);
        } else if id == 0x700 + own {
            self.is_seen = true;
            return self.heartbeat(frame);
        } else if u32::from(id) == self.parameter(0x1014, 0) {
            self.is_seen = true;
            return Some(Event::Emergency);
        } else if self.pdo(frame, TRANSMITTED, now_s) {
            self.is_seen = true;
        } else {
            self.pdo(frame, RECEIVED, now_s);
        }
        None
    }

    fn heartbeat(&mut self, frame: &Frame) -> Option<Event> {
        let state = NmtState::of(*frame.data().first()?)?;
        if state == NmtState::BootUp {
            self.values.retain(|(index, _), _| !PDO_PARAMETERS.contains(index));
        }
        let is_new = self.state != Some(state) || state == NmtState::BootUp;
        self.state = Some(state);
        is_new.then_some(Event::Nmt(state))
    }

    /// Takes a frame as a PDO of one direction; returns whether it was one.
    fn pdo(&mut self, frame: &Frame, (communication, mapping): (u16, u16), now_s: f64) -> bool {
        let is_own = |pdo: &u16| {
            let cob = self.parameter(communication + pdo, 1);
            cob & DISABLED == 0 && cob & 0x7FF == u32::from(frame.id())
        };
        let Some(pdo) = (0..PDOS).find(is_own) else { return false };
        let mut data = frame.data();
        let entries = self.parameter(mapping + pdo, 0).min(8) as u8;
        for entry in 1..=entries {
            let mapped = self.parameter(mapping + pdo, entry);
            let bytes = (mapped & 0xFF) as usize / 8;
            let Some((value, rest)) = data.split_at_checked(bytes) else { break };
            data = rest;
            let index = (mapped >> 16) as u16;
            if index >= FIRST_OBJECT {
                let known = Known { raw: number(value), bytes, at_s: now_s };
                self.values.insert((index, (mapped >> 8 & 0xFF) as u8), known);
            }
        }
        true
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
    use crate::formats::candump;

    fn write(node: &mut Node, object: u32, value: u32, bytes: u8) {
        let [sub, low, high] = [object as u8, (object >> 8) as u8, (object >> 16) as u8];
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
        write(&mut knee, 0x1401_01, 0x8000_0302, 4);
        write(&mut knee, 0x1601_00, 0, 1);
        write(&mut knee, 0x1601_01, 0x0007_0020, 4);
        write(&mut knee, 0x1601_02, 0x607A_0020, 4);
        write(&mut knee, 0x1601_00, 2, 1);
        knee.take(&Frame::new(0x301, &[1, 0, 0, 0, 2, 0, 0, 0]), 1.0);
        assert_eq!(knee.signed(0x607A), None, "still disabled");
        write(&mut knee, 0x1401_01, 0x301, 4);
        knee.take(&Frame::new(0x301, &[1, 0, 0, 0, 2, 0, 0, 0]), 1.0);
        assert_eq!(knee.signed(0x607A), Some(2));
        assert_eq!(knee.take(&Frame::new(0x702, &[0]), 2.0), Some(Event::Nmt(NmtState::BootUp)));
        knee.take(&Frame::new(0x301, &[1, 0, 0, 0, 3, 0, 0, 0]), 2.0);
        assert_eq!(knee.signed(0x607A), Some(2), "the default COB-ID is 302 again");
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
            assert!(node.is_seen());
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
