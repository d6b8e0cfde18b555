//! What the object dictionary's rows are made of, and how one is found.
//!
//! Why a table without values: every value already has its place, in the node or in the leg; a dictionary that kept
//! copies would have to be kept true. A row says what an object is, the node and [`Objects`](super::Objects) say
//! what its value is. The names are a table of their own, so that an image which never tells a name does not hold them.

use super::abort::Abort;
use super::table::ROWS;

/// Where an object's value is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub: u8,
}

impl Object {
    /// One of them.
    #[must_use]
    pub const fn at(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }
}

/// The type of a value; the numbers are CiA 301's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Type {
    /// INTEGER8
    I8 = 0x02,
    /// INTEGER16
    I16 = 0x03,
    /// INTEGER32
    I32 = 0x04,
    /// UNSIGNED8
    U8 = 0x05,
    /// UNSIGNED16
    U16 = 0x06,
    /// UNSIGNED32
    U32 = 0x07,
    /// REAL32
    F32 = 0x08,
    /// VISIBLE_STRING
    Text = 0x09,
    /// DOMAIN
    Domain = 0x0F,
}

impl Type {
    /// Bytes of a number; `None` where the length is the value's own.
    #[must_use]
    pub const fn size(self) -> Option<u8> {
        match self {
            Self::I8 | Self::U8 => Some(1),
            Self::I16 | Self::U16 => Some(2),
            Self::I32 | Self::U32 | Self::F32 => Some(4),
            Self::Text | Self::Domain => None,
        }
    }
}

/// What a host may do with an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Always reads as its default.
    Const,
    /// Can be read.
    Read,
    /// Can be read and written.
    Both,
}

/// Into which PDOs an object may be mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// None.
    No,
    /// What the node receives.
    Receive,
    /// What the node sends.
    Transmit,
    /// Both.
    Any,
}

/// One or more objects that differ in index or subindex only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// The first index.
    pub index: u16,
    /// How many indices follow each other.
    pub indices: u8,
    /// The first subindex.
    pub sub: u8,
    /// How many subindices follow each other.
    pub subs: u8,
    /// Type of the value.
    pub kind: Type,
    /// What a host may do.
    pub access: Access,
    /// Into which PDOs.
    pub mapping: Mapping,
    /// The node's number is added to the default.
    pub plus_node: bool,
    /// The value after the start; of what is measured, 0.
    pub default: u32,
}

impl Row {
    /// Whether the object is one of the row's.
    #[must_use]
    pub const fn holds(&self, object: Object) -> bool {
        object.index.wrapping_sub(self.index) < self.indices as u16
            && object.sub.wrapping_sub(self.sub) < self.subs
    }
}

/// The row of an object.
///
/// # Errors
/// [`Abort::NoObject`], or [`Abort::NoSubindex`] where the index is known.
pub fn find(object: Object) -> Result<&'static Row, Abort> {
    let mut known = false;
    for row in ROWS {
        if row.holds(object) {
            return Ok(row);
        }
        known |= object.index.wrapping_sub(row.index) < u16::from(row.indices);
    }
    Err(if known { Abort::NoSubindex } else { Abort::NoObject })
}

#[cfg(test)]
mod tests {
    use super::super::table::{GROUPS, NAMES};
    use super::*;

    /// All objects of a row.
    fn objects(row: &Row) -> impl Iterator<Item = Object> + use<'_> {
        (0..u16::from(row.indices))
            .flat_map(move |index| (0..row.subs).map(move |sub| Object::at(row.index + index, row.sub + sub)))
    }

    #[test]
    fn every_object_is_in_exactly_one_row_and_has_a_name() {
        assert_eq!(ROWS.len(), NAMES.len());
        for (place, row) in ROWS.iter().enumerate() {
            for object in objects(row) {
                assert_eq!(ROWS.iter().filter(|other| other.holds(object)).count(), 1, "{object:x?}");
                assert_eq!(find(object), Ok(row));
            }
            assert!(!NAMES[place].is_empty() && NAMES[place].is_ascii());
        }
    }

    #[test]
    fn subindex_0_of_what_has_more_is_a_number_of_entries_or_a_counted_array() {
        for row in ROWS.iter().filter(|row| row.sub > 0) {
            for index in row.index..row.index + u16::from(row.indices) {
                let head = find(Object::at(index, 0)).expect("a number of entries");
                assert_eq!(head.kind, Type::U8, "{index:x}");
                let last = ROWS
                    .iter()
                    .filter(|other| other.holds(Object::at(index, other.sub)))
                    .map(|other| u32::from(other.sub + other.subs - 1))
                    .max();
                if head.access == Access::Const {
                    assert_eq!(Some(head.default), last, "{index:x}");
                }
            }
        }
    }

    #[test]
    fn every_index_with_several_parts_has_a_name_of_its_own() {
        for row in ROWS {
            for index in row.index..row.index + u16::from(row.indices) {
                let groups =
                    GROUPS.iter().filter(|(first, count, ..)| index.wrapping_sub(*first) < *count).count();
                let has_parts = find(Object::at(index, 1)).is_ok();
                assert_eq!(groups, usize::from(has_parts), "{index:x}");
            }
        }
    }

    #[test]
    fn what_is_not_there_is_told_from_what_has_no_such_part() {
        assert_eq!(find(Object::at(0x5555, 0)), Err(Abort::NoObject));
        assert_eq!(find(Object::at(0x1018, 9)), Err(Abort::NoSubindex));
        assert_eq!(find(Object::at(0x1404, 1)), Err(Abort::NoObject));
    }
}
