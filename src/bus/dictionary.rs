//! Row format of the object dictionary, and the search for a row.
//!
//! Why a table without values: every value already exists in the node or in the leg, and copies would have to
//! be synchronised. A row describes an object; the node and [`Objects`](super::Objects) hold its value. The
//! names are a separate table, so an image that never reads them does not contain them.

use super::abort::Abort;
use super::table::ROWS;

/// Address of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Subindex.
    pub sub: u8,
}

impl Object {
    /// Creates an address.
    pub const fn at(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }
}

/// Type of a value; the numbers are CiA 301's.
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
    /// Size of a number in bytes; `None` if the length varies.
    pub const fn size(self) -> Option<u8> {
        match self {
            Self::I8 | Self::U8 => Some(1),
            Self::I16 | Self::U16 => Some(2),
            Self::I32 | Self::U32 | Self::F32 => Some(4),
            Self::Text | Self::Domain => None,
        }
    }
}

/// Access rights of a host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Constant; always reads as the default.
    Const,
    /// Read-only.
    Read,
    /// Read and write.
    Both,
    /// Write-only.
    Write,
}

/// PDO directions into which an object may be mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Not mappable.
    No,
    /// PDOs that the node receives.
    Receive,
    /// PDOs that the node sends.
    Transmit,
    /// Both directions.
    Any,
}

/// One or more objects that differ in index or subindex only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// First index.
    pub index: u16,
    /// Number of consecutive indices.
    pub indices: u8,
    /// First subindex.
    pub sub: u8,
    /// Number of consecutive subindices.
    pub subs: u8,
    /// Type of the value.
    pub kind: Type,
    /// Access rights of a host.
    pub access: Access,
    /// PDO directions into which the object may be mapped.
    pub mapping: Mapping,
    /// Whether the node-ID is added to the default.
    pub plus_node: bool,
    /// Value after the start; 0 for measured values.
    pub default: u32,
}

impl Row {
    /// Returns whether the row contains the object.
    pub const fn holds(&self, object: Object) -> bool {
        object.index.wrapping_sub(self.index) < self.indices as u16
            && object.sub.wrapping_sub(self.sub) < self.subs
    }
}

/// Finds the row of an object.
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

    /// Objects of a row.
    fn objects(row: &Row) -> impl Iterator<Item = Object> + use<'_> {
        (0..u16::from(row.indices))
            .flat_map(move |index| (0..row.subs).map(move |sub| Object::at(row.index + index, row.sub + sub)))
    }

    #[test]
    fn every_object_is_in_exactly_one_row_and_has_a_name() {
        assert_eq!(ROWS.len(), NAMES.len());
        for (index, row) in ROWS.iter().enumerate() {
            for object in objects(row) {
                assert_eq!(ROWS.iter().filter(|other| other.holds(object)).count(), 1, "{object:x?}");
                assert_eq!(find(object), Ok(row));
            }
            assert!(!NAMES[index].is_empty() && NAMES[index].is_ascii());
        }
    }

    #[test]
    fn subindex_0_holds_the_number_of_entries() {
        for row in ROWS.iter().filter(|row| row.sub > 0) {
            for index in row.index..row.index + u16::from(row.indices) {
                let head = find(Object::at(index, 0)).expect("a number of entries");
                assert_eq!(head.kind, Type::U8, "{index:x}");
                let own = ROWS.iter().filter(|other| other.holds(Object::at(index, other.sub)));
                let last = own.map(|other| u32::from(other.sub + other.subs - 1)).max();
                if head.access == Access::Const {
                    assert_eq!(Some(head.default), last, "{index:x}");
                }
            }
        }
    }

    #[test]
    fn every_index_with_several_subindices_has_a_name() {
        for row in ROWS {
            for index in row.index..row.index + u16::from(row.indices) {
                let groups =
                    GROUPS.iter().filter(|(first, count, ..)| index.wrapping_sub(*first) < *count).count();
                let has_parts = find(Object::at(index, 1)).is_ok();
                assert_eq!(groups, usize::from(has_parts), "{index:x}");
            }
        }
    }
}
