//! Stored parameters of a node (1010): encoding of the objects a host has changed, and their restoration.
//!
//! ```text
//! per object that differs from its default, in table order, little-endian:
//!     index (2), subindex, size, value (size)
//! ```
//!
//! Not stored: commands (controlword, targets, offsets, outputs), the error list, and the objects of the leg
//! (from 2100 on). PDOs are restored in the order a host would use: disable, map, enable. An entry that is no
//! longer accepted is skipped.

use super::abort::Abort;
use super::access::{Dictionary, PROFILE};
use super::dictionary::{Access, Object, Row, find};
use super::nmt::Reset;
use super::node::Node;
use super::node_id::NodeId;
use super::objects::Objects;
use super::table::{ROWS, is_of_leg};

/// Capacity for one node's stored parameters in bytes, as in the store.
pub const LONGEST: usize = 400;

/// Stored parameters of one node, encoded as in the module header.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredNode {
    bytes: [u8; LONGEST],
    length: usize,
}

impl StoredNode {
    /// Nothing stored: all objects have their defaults.
    pub const NOTHING: Self = Self { bytes: [0; LONGEST], length: 0 };

    /// Copies `bytes`; those beyond [`LONGEST`] are discarded.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Self {
        let mut stored = Self::NOTHING;
        for (to, from) in stored.bytes.iter_mut().zip(bytes) {
            *to = *from;
            stored.length += 1;
        }
        stored
    }

    /// Returns the encoded bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }
}

pub(super) const NODE_ID: Object = Object::at(0x2001, 0);
pub(super) const BIT_RATE: Object = Object::at(0x2002, 0);
/// Bit of a PDO's COB-ID: the PDO does not exist.
const OFF: u32 = 1 << 31;

/// Whether the row's objects are stored: writable, no command, and held by the node.
const fn is_stored(row: &Row) -> bool {
    let commands =
        matches!(row.index, 0x2020 | 0x6040 | 0x6071 | 0x607A | 0x60B1 | 0x60B2 | 0x60C1 | 0x60FE | 0x60FF);
    let others = matches!(row.index, 0x1003 | 0x1010 | 0x1011 | 0x1F50..=0x1F57 | 0x2194);
    matches!(row.access, Access::Both) && !commands && !others && !is_of_leg(row.index)
}

/// All objects that are stored, in the table's order.
pub fn stored_objects() -> impl Iterator<Item = (Object, &'static Row)> {
    ROWS.iter().filter(|row| is_stored(row)).flat_map(|row| {
        (0..u16::from(row.indices)).flat_map(move |index| {
            (0..row.subs).map(move |sub| (Object::at(row.index + index, row.sub + sub), row))
        })
    })
}

fn default(row: &Row, node: NodeId) -> u32 {
    row.default + if row.plus_node { u32::from(node.number()) } else { 0 }
}

/// Decodes the entries into object and value. The value is not sign-extended.
pub fn stored_entries(bytes: &[u8]) -> impl Iterator<Item = (Object, u32)> {
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
    stored_entries(bytes).find(|(other, _)| *other == object).map(|(_, value)| value)
}

/// Returns the stored node-ID (2001), if there is one.
pub(crate) fn stored_node_id(bytes: &[u8]) -> Option<NodeId> {
    number(bytes, NODE_ID).and_then(|number| NodeId::new(number as u8))
}

/// Returns the stored bit rate (2002) in kbit/s, if there is one.
pub(crate) fn stored_bit_rate(bytes: &[u8]) -> Option<u16> {
    number(bytes, BIT_RATE).map(|rate| rate as u16)
}

/// Encodes one entry; returns its length.
fn append(object: Object, size: u8, value: u32, out: &mut [u8]) -> Result<usize, Abort> {
    let [low, high] = object.index.to_le_bytes();
    let head = [low, high, object.sub, size];
    let bytes = value.to_le_bytes();
    let entry = head.iter().chain(bytes.iter().take(usize::from(size)));
    let length = head.len() + usize::from(size);
    let target = out.get_mut(..length).ok_or(Abort::Store)?;
    for (to, from) in target.iter_mut().zip(entry) {
        *to = *from;
    }
    Ok(length)
}

/// Encodes one entry outside a node, as a tool does; returns its length. Only the low bytes of `value` are
/// used.
///
/// # Errors
/// [`Abort`] of an unknown object, [`Abort::ReadOnly`], [`Abort::Access`] for an object that is never stored,
/// [`Abort::Store`] if the entry does not fit.
pub fn write_stored(object: Object, value: u32, out: &mut [u8]) -> Result<usize, Abort> {
    let row = find(object)?;
    match row.access {
        Access::Both if is_stored(row) => append(object, row.kind.size().unwrap_or(4), value, out),
        Access::Both => Err(Abort::Access),
        _ => Err(Abort::ReadOnly),
    }
}

/// Whether the index is a communication or mapping parameter of a PDO.
const fn is_pdo(index: u16) -> bool {
    matches!(index, 0x1400..=0x14FF | 0x1600..=0x16FF | 0x1800..=0x18FF | 0x1A00..=0x1AFF)
}

impl Node {
    /// Encodes all objects that differ from their defaults; returns the number of bytes.
    ///
    /// # Errors
    /// [`Abort::Store`] if they do not fit into `out`.
    pub(crate) fn store<O: Objects>(&mut self, objects: &mut O, out: &mut [u8]) -> Result<usize, Abort> {
        let node = self.id();
        let dictionary = Dictionary { communication: self.communication_mut(), objects };
        let mut length = 0;
        for (object, row) in stored_objects() {
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

    /// Encodes the objects into `stored`; on an error `stored` is empty.
    ///
    /// # Errors
    /// See [`Self::store`].
    pub(crate) fn store_into<O: Objects>(
        &mut self,
        objects: &mut O,
        stored: &mut StoredNode,
    ) -> Result<(), Abort> {
        stored.length = 0;
        stored.length = self.store(objects, &mut stored.bytes)?;
        Ok(())
    }

    /// Restores the objects after the start, or those that `reset` covers.
    pub(crate) fn recall<O: Objects>(&mut self, bytes: &[u8], reset: Reset, objects: &mut O) {
        let node = self.id();
        let mut dictionary = Dictionary { communication: self.communication_mut(), objects };
        let mut write = |object: Object, value: u32| {
            let is_anew = reset == Reset::Node || object.index < PROFILE;
            if let Ok(row) = dictionary.writable(object)
                && is_stored(row)
                && is_anew
            {
                let _ = dictionary.write(object, value);
            }
        };
        let pdos = || (0x1400..0x1404).chain(0x1800..0x1804_u16);
        let touched = |index: u16| {
            stored_entries(bytes).any(|(object, _)| is_pdo(object.index) && object.index & !0x200 == index)
        };
        let or_default = |object: Object| {
            number(bytes, object).or_else(|| find(object).ok().map(|row| default(row, node))).unwrap_or(0)
        };
        for index in pdos().filter(|index| touched(*index)) {
            write(Object::at(index, 1), or_default(Object::at(index, 1)) | OFF);
            write(Object::at(index + 0x200, 0), 0);
        }
        for (object, value) in stored_entries(bytes) {
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

    /// Restores all objects and returns the first that rejected its value. Applied to a new node, this checks
    /// whether a board would accept the bytes.
    pub fn try_recall<O: Objects>(&mut self, bytes: &[u8], objects: &mut O) -> Option<Object> {
        self.recall(bytes, Reset::Node, objects);
        let dictionary = Dictionary { communication: self.communication_mut(), objects };
        let differs = |object: Object, value: u32| {
            let size = find(object).ok().and_then(|row| row.kind.size()).unwrap_or(4);
            let mask = u32::MAX >> (32 - 8 * u32::from(size));
            !dictionary.read(object).is_ok_and(|taken| (taken ^ value) & mask == 0)
        };
        stored_entries(bytes).find(|(object, value)| differs(*object, *value)).map(|(object, _)| object)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::Board;
    use super::*;
    use crate::testing::TestRandom;

    fn stored(board: &mut Board) -> Vec<u8> {
        let mut bytes = [0; LONGEST];
        let length = board.nodes[0].store(&mut board.axes[0], &mut bytes).expect("it fits");
        bytes[..length].to_vec()
    }

    #[test]
    fn a_node_with_defaults_stores_nothing() {
        assert_eq!(stored(&mut Board::with_defaults(3)), []);
    }

    #[test]
    fn settings_are_restored_and_commands_are_not() {
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
        let bytes = stored(&mut board);
        assert_eq!((stored_node_id(&bytes), stored_bit_rate(&bytes)), (NodeId::new(9), None));
        let mut other = Board::started(1);
        let [node, _] = &mut other.nodes;
        node.recall(&bytes, Reset::Node, &mut other.axes[0]);
        for (index, sub, _, _) in compact {
            let expected = if index == 0x607A { Ok(0) } else { board.read(index, sub) };
            assert_eq!(other.read(index, sub), expected, "{index:x} {sub}");
        }
        assert_eq!(stored(&mut other), bytes);
    }

    #[test]
    fn foreign_bytes_cannot_set_the_controlword() {
        let mut random = TestRandom::new(1);
        for length in 0..200 {
            let bytes: Vec<u8> = (0..length).map(|_| random.byte()).collect();
            let mut board = Board::started(1);
            let [node, _] = &mut board.nodes;
            node.recall(&bytes, Reset::Node, &mut board.axes[0]);
            assert_eq!(board.read(0x6040, 0), Ok(0));
        }
        // The controlword is never restored.
        let mut board = Board::started(1);
        let [node, _] = &mut board.nodes;
        node.recall(&[0x40, 0x60, 0, 2, 15, 0], Reset::Node, &mut board.axes[0]);
        assert_eq!(board.read(0x6040, 0), Ok(0));
    }

    #[test]
    fn a_tool_encodes_like_the_node_and_refusals_name_the_object() {
        let mut board = Board::with_defaults(1);
        assert_eq!(board.write(0x1017, 0, 50, 2), Ok(()));
        assert_eq!(board.write(0x6007, 0, 1, 2), Ok(()));
        let mut bytes = [0; LONGEST];
        let first = write_stored(Object::at(0x1017, 0), 50, &mut bytes).expect("it fits");
        let second = write_stored(Object::at(0x6007, 0), 1, &mut bytes[first..]).expect("it fits");
        assert_eq!(&bytes[..first + second], stored(&mut board));
        for (index, sub, why) in [
            (0x5555, 0, Abort::NoObject),
            (0x1018, 9, Abort::NoSubindex),
            (0x6041, 0, Abort::ReadOnly),
            (0x607D, 0, Abort::ReadOnly),
            (0x6040, 0, Abort::Access),
        ] {
            assert_eq!(write_stored(Object::at(index, sub), 0, &mut bytes), Err(why), "{index:x} {sub}");
        }
        assert_eq!(write_stored(Object::at(0x1017, 0), 50, &mut bytes[..5]), Err(Abort::Store));

        let refused = |object: Object, value: u32| {
            let (mut bytes, mut board) = ([0; LONGEST], Board::started(1));
            let length = write_stored(object, value, &mut bytes).expect("it fits");
            let [node, _] = &mut board.nodes;
            node.try_recall(&bytes[..length], &mut board.axes[0])
        };
        assert_eq!(refused(Object::at(0x2002, 0), 250), None);
        assert_eq!(refused(Object::at(0x60C2, 2), -4_i32 as u32), None);
        assert_eq!(refused(Object::at(0x2002, 0), 300), Some(Object::at(0x2002, 0)));
        assert_eq!(refused(Object::at(0x2001, 0), 128), Some(Object::at(0x2001, 0)));
    }
}
