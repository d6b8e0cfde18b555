//! What a host changed of a node's objects, as bytes that outlive the power (1010), and back.
//!
//! ```text
//! of each object that is not as after the start:   index (2), subindex, size, value (size)      little-endian, in the table's order
//! ```
//!
//! Not kept: what commands (controlword, targets, offsets, outputs), the list of errors, and what belongs to the leg (2100 and on).
//! PDOs are taken back as a host would set them up: switched off, mapped, switched on. An entry that is no longer accepted is passed
//! over, the others count.

use super::abort::Abort;
use super::access::{Dictionary, PROFILE};
use super::dictionary::{Access, Object, Row, find};
use super::nmt::Reset;
use super::node::Node;
use super::node_id::NodeId;
use super::objects::Objects;
use super::table::ROWS;

/// Room for what is kept of a node, as the store has it.
pub const LONGEST: usize = 400;

/// What is kept of a node: bytes as in this module's head.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptNode {
    bytes: [u8; LONGEST],
    length: usize,
}

impl KeptNode {
    /// A node as after the start.
    pub const NOTHING: Self = Self { bytes: [0; LONGEST], length: 0 };

    /// These bytes; what is beyond [`LONGEST`] is left out.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        let mut kept = Self::NOTHING;
        for (to, from) in kept.bytes.iter_mut().zip(bytes) {
            *to = *from;
            kept.length += 1;
        }
        kept
    }

    /// The bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

const NODE_ID: Object = Object::at(0x2001, 0);
const BIT_RATE: Object = Object::at(0x2002, 0);
/// Of a PDO's identifier: it does not exist.
const OFF: u32 = 1 << 31;

/// Commands, and what is not the node's.
const fn is_kept(row: &Row) -> bool {
    let commands = matches!(row.index, 0x6040 | 0x6071 | 0x607A | 0x60B1 | 0x60B2 | 0x60C1 | 0x60FE | 0x60FF);
    let others = matches!(row.index, 0x1003 | 0x1010 | 0x1011 | 0x2100..=0x2198);
    matches!(row.access, Access::Both) && !commands && !others
}

/// Every object that is kept, in the table's order.
pub fn kept_objects() -> impl Iterator<Item = (Object, &'static Row)> {
    ROWS.iter().filter(|row| is_kept(row)).flat_map(|row| {
        (0..u16::from(row.indices)).flat_map(move |index| {
            (0..row.subs).map(move |sub| (Object::at(row.index + index, row.sub + sub), row))
        })
    })
}

fn default(row: &Row, node: NodeId) -> u32 {
    row.default + if row.plus_node { u32::from(node.number()) } else { 0 }
}

/// Object and value of each entry; only the value's own bytes are set, whatever its sign.
pub fn kept_entries(bytes: &[u8]) -> impl Iterator<Item = (Object, u32)> {
    let mut rest = bytes;
    core::iter::from_fn(move || {
        let (&[low, high, sub, size], after) = rest.split_first_chunk()?;
        let (value, after) = after.split_at_checked(usize::from(size))?;
        rest = after;
        let mut word = [0; 4];
        for (to, from) in word.iter_mut().zip(value) {
            *to = *from;
        }
        Some((Object::at(u16::from_le_bytes([low, high]), sub), u32::from_le_bytes(word)))
    })
}

fn number(bytes: &[u8], object: Object) -> Option<u32> {
    kept_entries(bytes).find(|(other, _)| *other == object).map(|(_, value)| value)
}

/// The node's number that a host had kept (2001), if it did.
#[must_use]
pub fn kept_node_id(bytes: &[u8]) -> Option<NodeId> {
    number(bytes, NODE_ID).and_then(|number| NodeId::new(number as u8))
}

/// The bit rate that a host had kept (2002), kbit/s, if it did.
#[must_use]
pub fn kept_bit_rate(bytes: &[u8]) -> Option<u16> {
    number(bytes, BIT_RATE).map(|rate| rate as u16)
}

/// One entry in bytes; how many they are.
fn append(object: Object, size: u8, value: u32, out: &mut [u8]) -> Result<usize, Abort> {
    let [low, high] = object.index.to_le_bytes();
    let head = [low, high, object.sub, size];
    let bytes = value.to_le_bytes();
    let entry = head.iter().chain(bytes.iter().take(usize::from(size)));
    let length = head.len() + usize::from(size);
    let room = out.get_mut(..length).ok_or(Abort::Store)?;
    for (to, from) in room.iter_mut().zip(entry) {
        *to = *from;
    }
    Ok(length)
}

/// One entry of what a node keeps, written by somebody else than the node; how many bytes it is. Of the value the low bytes count.
///
/// # Errors
/// That there is no such object, [`Abort::ReadOnly`], [`Abort::Access`] for one that is never kept, [`Abort::Store`] where it does not fit.
pub fn write_kept(object: Object, value: u32, out: &mut [u8]) -> Result<usize, Abort> {
    let row = find(object)?;
    match row.access {
        Access::Both if is_kept(row) => append(object, row.kind.size().unwrap_or(4), value, out),
        Access::Both => Err(Abort::Access),
        _ => Err(Abort::ReadOnly),
    }
}

/// A communication parameter of a PDO, and its mapping's index.
const fn is_pdo(index: u16) -> bool {
    matches!(index, 0x1400..=0x14FF | 0x1600..=0x16FF | 0x1800..=0x18FF | 0x1A00..=0x1AFF)
}

impl Node {
    /// What is to be kept; how many of the bytes it takes.
    ///
    /// # Errors
    /// [`Abort::Store`] where it does not fit.
    pub fn keep<O: Objects>(&mut self, objects: &mut O, out: &mut [u8]) -> Result<usize, Abort> {
        let node = self.id();
        let dictionary = Dictionary { communication: self.communication_mut(), objects };
        let mut length = 0;
        for (object, row) in kept_objects() {
            let Ok(value) = dictionary.value(object) else { continue };
            let size = row.kind.size().unwrap_or(4);
            let mask = u32::MAX >> (32 - 8 * u32::from(size));
            if (value ^ default(row, node)) & mask == 0 {
                continue;
            }
            length += append(object, size, value, out.get_mut(length..).ok_or(Abort::Store)?)?;
        }
        Ok(length)
    }

    /// The same, for the store. Where it does not fit nothing is kept.
    ///
    /// # Errors
    /// As [`Self::keep`].
    pub fn keep_into<O: Objects>(&mut self, objects: &mut O, kept: &mut KeptNode) -> Result<(), Abort> {
        kept.length = 0;
        kept.length = self.keep(objects, &mut kept.bytes)?;
        Ok(())
    }

    /// Takes back what was kept: after the start, or of what a reset had begin anew.
    pub fn recall<O: Objects>(&mut self, bytes: &[u8], reset: Reset, objects: &mut O) {
        let node = self.id();
        let mut dictionary = Dictionary { communication: self.communication_mut(), objects };
        let mut write = |object: Object, value: u32| {
            let is_anew = reset == Reset::Node || object.index < PROFILE;
            if let Ok(row) = dictionary.writable(object)
                && is_kept(row)
                && is_anew
            {
                let _ = dictionary.write(object, value);
            }
        };
        let pdos = || (0x1400..0x1404).chain(0x1800..0x1804_u16);
        let touched = |index: u16| {
            kept_entries(bytes).any(|(object, _)| is_pdo(object.index) && object.index & !0x200 == index)
        };
        let or_default = |object: Object| {
            number(bytes, object).or_else(|| find(object).ok().map(|row| default(row, node))).unwrap_or(0)
        };
        for index in pdos().filter(|index| touched(*index)) {
            write(Object::at(index, 1), or_default(Object::at(index, 1)) | OFF);
            write(Object::at(index + 0x200, 0), 0);
        }
        for (object, value) in kept_entries(bytes) {
            let later = match object.index {
                0x1400..=0x14FF | 0x1800..=0x18FF => object.sub == 1,
                0x1600..=0x16FF | 0x1A00..=0x1AFF => object.sub == 0,
                _ => false,
            };
            if !later {
                write(object, value);
            }
        }
        for index in pdos().filter(|index| touched(*index)) {
            let count = Object::at(index + 0x200, 0);
            write(count, or_default(count));
            write(Object::at(index, 1), or_default(Object::at(index, 1)));
        }
    }

    /// Takes back what was kept; the first object that did not take its value, if one did not. A node as after the start tells so whether a
    /// board would take it.
    pub fn try_recall<O: Objects>(&mut self, bytes: &[u8], objects: &mut O) -> Option<Object> {
        self.recall(bytes, Reset::Node, objects);
        let dictionary = Dictionary { communication: self.communication_mut(), objects };
        let differs = |object: Object, value: u32| {
            let size = find(object).ok().and_then(|row| row.kind.size()).unwrap_or(4);
            let mask = u32::MAX >> (32 - 8 * u32::from(size));
            !dictionary.read(object).is_ok_and(|taken| (taken ^ value) & mask == 0)
        };
        kept_entries(bytes).find(|(object, value)| differs(*object, *value)).map(|(object, _)| object)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::tests::Board;
    use super::*;

    fn kept(board: &mut Board) -> std::vec::Vec<u8> {
        let mut bytes = [0; LONGEST];
        let length = board.nodes[0].keep(&mut board.axes[0], &mut bytes).expect("it fits");
        bytes[..length].to_vec()
    }

    #[test]
    fn nothing_is_kept_of_a_node_that_is_as_after_the_start() {
        assert_eq!(kept(&mut Board::started(3)), []);
    }

    #[test]
    fn what_a_host_set_up_comes_back_and_what_it_commanded_does_not() {
        let mut board = Board::started(1);
        let compact = [
            (0x1800, 1, 0x8000_0181, 4),
            (0x1A00, 0, 0, 1),
            (0x1A00, 1, 0x6041_0010, 4),
            (0x1A00, 2, 0x6064_0020, 4),
            (0x1A00, 3, 0x2010_0010, 4),
            (0x1A00, 0, 3, 1),
            (0x1800, 2, 1, 1),
            (0x1800, 1, 0x181, 4),
            (0x1802, 1, 0x8000_0381, 4),
            (0x1016, 1, 80 << 16 | 100, 4),
            (0x1017, 0, 50, 2),
            (0x6007, 0, 1, 2),
            (0x6060, 0, 8, 1),
            (0x6065, 0, 50_000, 4),
            (0x2001, 0, 9, 1),
            (0x607A, 0, 123_456, 4),
        ];
        for (index, sub, value, size) in compact {
            assert_eq!(board.write(index, sub, value, size), Ok(()), "{index:x} {sub}");
        }
        let bytes = kept(&mut board);
        assert_eq!((kept_node_id(&bytes), kept_bit_rate(&bytes)), (NodeId::new(9), None));
        let mut other = Board::started(1);
        let [node, _] = &mut other.nodes;
        node.recall(&bytes, Reset::Node, &mut other.axes[0]);
        for (index, sub, _, _) in compact {
            let expected = if index == 0x607A { Ok(0) } else { board.read(index, sub) };
            assert_eq!(other.read(index, sub), expected, "{index:x} {sub}");
        }
        assert_eq!(kept(&mut other), bytes);
    }

    #[test]
    fn bytes_that_are_none_of_ours_change_nothing_but_what_they_name() {
        let mut state = 1_u32;
        for length in 0..200 {
            let bytes: std::vec::Vec<u8> = (0..length)
                .map(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    (state >> 24) as u8
                })
                .collect();
            let mut board = Board::started(1);
            let [node, _] = &mut board.nodes;
            node.recall(&bytes, Reset::Node, &mut board.axes[0]);
            assert_eq!(board.read(0x6040, 0), Ok(0));
        }
        // The controlword is not taken back, whoever wrote it there.
        let mut board = Board::started(1);
        let [node, _] = &mut board.nodes;
        node.recall(&[0x40, 0x60, 0, 2, 15, 0], Reset::Node, &mut board.axes[0]);
        assert_eq!(board.read(0x6040, 0), Ok(0));
    }

    #[test]
    fn what_a_tool_writes_is_what_the_node_would_and_what_is_refused_is_named() {
        let mut board = Board::started(1);
        assert_eq!(board.write(0x1017, 0, 50, 2), Ok(()));
        assert_eq!(board.write(0x6007, 0, 1, 2), Ok(()));
        let mut bytes = [0; LONGEST];
        let first = write_kept(Object::at(0x1017, 0), 50, &mut bytes).expect("it fits");
        let second = write_kept(Object::at(0x6007, 0), 1, &mut bytes[first..]).expect("it fits");
        assert_eq!(&bytes[..first + second], kept(&mut board));
        for (index, sub, why) in [
            (0x5555, 0, Abort::NoObject),
            (0x1018, 9, Abort::NoSubindex),
            (0x6041, 0, Abort::ReadOnly),
            (0x607D, 0, Abort::ReadOnly),
            (0x6040, 0, Abort::Access),
        ] {
            assert_eq!(write_kept(Object::at(index, sub), 0, &mut bytes), Err(why), "{index:x} {sub}");
        }
        assert_eq!(write_kept(Object::at(0x1017, 0), 50, &mut bytes[..5]), Err(Abort::Store));

        let told = |object: Object, value: u32| {
            let (mut bytes, mut board) = ([0; LONGEST], Board::started(1));
            let length = write_kept(object, value, &mut bytes).expect("it fits");
            let [node, _] = &mut board.nodes;
            node.try_recall(&bytes[..length], &mut board.axes[0])
        };
        assert_eq!(told(Object::at(0x2002, 0), 250), None);
        assert_eq!(told(Object::at(0x60C2, 2), -4_i32 as u32), None);
        assert_eq!(told(Object::at(0x2002, 0), 300), Some(Object::at(0x2002, 0)));
        assert_eq!(told(Object::at(0x2001, 0), 128), Some(Object::at(0x2001, 0)));
    }

    #[test]
    fn more_than_there_is_room_for_is_refused() {
        let mut board = Board::started(1);
        assert_eq!(board.write(0x1017, 0, 50, 2), Ok(()));
        assert_eq!(board.nodes[0].keep(&mut board.axes[0], &mut [0; 5]), Err(Abort::Store));
    }
}
