//! The table against the live node: what it says that is there is there, and begins as it says.

use super::*;
use crate::bus::dictionary::{Access, Object, Type};

fn objects() -> impl Iterator<Item = (Object, &'static dictionary::Row)> {
    table::ROWS.iter().flat_map(|row| {
        (0..u16::from(row.indices)).flat_map(move |index| {
            (0..row.subs).map(move |sub| (Object::at(row.index + index, row.sub + sub), row))
        })
    })
}

/// Given by identity, constants, or the leg, and no default of the table's.
fn is_live(object: Object) -> bool {
    matches!(object.index, 0x1008..=0x100A | 0x1018 | 0x6075 | 0x6076 | 0x6502)
        || is_of_the_leg(object)
        // Where a drive stands before anything.
        || matches!(object.index, 0x6041)
        || object.index == 0x1003 && object.sub > 0
}

/// Told by the leg, which a joint alone does not have: `identification::tests`.
fn is_of_the_leg(object: Object) -> bool {
    (0x2100..0x219A).contains(&object.index) && object.sub > 0
}

#[test]
fn every_object_begins_as_the_table_says() {
    for (object, row) in objects().filter(|(object, _)| !is_live(*object)) {
        let mut board = Board::started(5);
        let expected = row.default + if row.plus_node { 5 } else { 0 };
        assert_eq!(board.read(object.index, object.sub), Ok(expected), "{object:x?}");
    }
}

#[test]
fn every_object_is_read_and_written_as_its_access_says() {
    for (object, row) in objects().filter(|(object, _)| !is_of_the_leg(*object)) {
        let Object { index, sub } = object;
        let mut board = Board::started(5);
        let size = row.kind.size().unwrap_or(4);
        let before = board.read(index, sub);
        if row.kind != Type::Text && !(index == 0x1003 && sub > 0) {
            assert!(before.is_ok(), "{object:x?}");
        }
        let written = board.write(index, sub, before.unwrap_or(0), size);
        let expected = match (row.access, index) {
            (Access::Both, 0x1010 | 0x1011) => Err(0x0800_0020),
            // A PDO that exists does not have its mapping written.
            (Access::Both, 0x1600..=0x16FF | 0x1A00..=0x1AFF) => Err(0x0601_0000),
            (Access::Both, _) => Ok(()),
            _ => Err(0x0601_0002),
        };
        assert_eq!(written, expected, "{object:x?}");
        if row.access == Access::Both {
            let other = if size == 4 { 2 } else { 4 };
            let wrong = if other < size { Err(0x0607_0013) } else { Err(0x0607_0012) };
            assert_eq!(board.write(index, sub, 0, other), wrong, "{object:x?}");
        }
    }
}
