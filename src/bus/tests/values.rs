//! The table against a live node: every listed object exists and has its default.

use super::*;
use crate::bus::dictionary::{Access, Object, Type};
use crate::bus::table::is_of_leg;

fn objects() -> impl Iterator<Item = (Object, &'static dictionary::Row)> {
    table::ROWS.iter().flat_map(|row| {
        (0..u16::from(row.indices)).flat_map(move |index| {
            (0..row.subs).map(move |sub| (Object::at(row.index + index, row.sub + sub), row))
        })
    })
}

/// Value from the identity, the constants or the leg, instead of the table's default.
fn is_live(object: Object) -> bool {
    matches!(object.index, 0x1008..=0x100A | 0x1018 | 0x6075 | 0x6076 | 0x607F | 0x6080 | 0x608F | 0x6091 | 0x6502)
        || is_of_the_leg(object)
        || matches!((object.index, object.sub), (0x2021, 2 | 3 | 5 | 6))
        // Initial state of the drive.
        || matches!(object.index, 0x6041)
        || object.index == 0x1003 && object.sub > 0
}

/// Object of the leg or the board, which a joint alone does not have; see `identification::tests`.
fn is_of_the_leg(object: Object) -> bool {
    (matches!(object.index, 0x1F50..0x1F58) || is_of_leg(object.index)) && object.sub > 0
}

#[test]
fn every_object_has_the_default_of_the_table() {
    for (object, row) in objects().filter(|(object, _)| !is_live(*object)) {
        let mut board = Board::with_defaults(5);
        let expected = row.default + if row.plus_node { 5 } else { 0 };
        assert_eq!(board.read(object.index, object.sub), Ok(expected), "{object:x?}");
    }
}

#[test]
fn every_object_follows_its_access_rights() {
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
            // The mapping of an existing PDO is read-only.
            (Access::Both, 0x1600..=0x16FF | 0x1A00..=0x1AFF) => Err(0x0601_0000),
            (Access::Both, _) => Ok(()),
            _ => Err(0x0601_0002),
        };
        assert_eq!(written, expected, "{object:x?}");
        // Object 2120:0 accepts any size.
        if row.access == Access::Both && index != 0x2120 {
            let other = if size == 4 { 2 } else { 4 };
            let wrong = if other < size { Err(0x0607_0013) } else { Err(0x0607_0012) };
            assert_eq!(board.write(index, sub, 0, other), wrong, "{object:x?}");
        }
    }
}

#[test]
fn objects_of_another_maker_are_accepted() {
    let mut board = Board::started(1);
    // Recorded software writes its tracking window there, an INTEGER32.
    assert_eq!(board.write(0x2120, 0, 50_000, 4), Ok(()));
    assert_eq!(board.read(0x2120, 0), Ok(13));
    assert_eq!(board.write(0x2121, 0, 13, 1), Err(0x0601_0002));
    // Mapped with the controlword by versions of 2022 to 2025, with either length.
    for (entry, value) in
        [(0x2194_0020, 0xDDCC_BBAA), (0x2194_0010, 0xBBAA), (0x60FE_0120, 0xDDCC_BBAA), (0x60FE_0110, 0xBBAA)]
    {
        let mut board = Board::started(1);
        let (set, off) = (0x1400, 0x8000_0201);
        for (index, sub, value, size) in [
            (set, 1, off, 4),
            (0x1600, 0, 0, 1),
            (0x1600, 1, 0x6040_0010, 4),
            (0x1600, 2, entry, 4),
            (0x1600, 0, 2, 1),
            (set, 1, 0x201, 4),
        ] {
            assert_eq!(board.write(index, sub, value, size), Ok(()), "{index:x} {sub} {entry:x}");
        }
        board.run(1);
        board.receive(0, &[1, 0]);
        board.receive(0x201, &[6, 0, 0xAA, 0xBB, 0xCC, 0xDD]);
        let outputs = [(0x2194, 0), (0x60FE, 1)].map(|(index, sub)| board.read(index, sub));
        assert_eq!((board.read(0x6040, 0), outputs), (Ok(6), [Ok(value); 2]), "{entry:x}");
    }
}

#[test]
fn profile_objects_have_the_units_of_cia_402() {
    use crate::bus::drive::LoopBandwidths;
    use crate::units::{Hertz, NewtonMetrePerAmpere, RadianPerSecond, Volt};
    let constants = AxisConstants {
        rated_torque: NewtonMetre(85.0),
        rated_current: Ampere(50.0),
        torque_per_ampere: NewtonMetrePerAmpere(1.5),
        speed: RadianPerSecond(4.5),
        counts_per_turn: 8192,
        ratio: 50.0,
        modes: 0,
        position_bandwidth: Hertz(3.0),
        current_bandwidth: Hertz(1000.0),
        impedance: [800.0, 31.5],
    };
    let mut axis = Axis::new(constants);
    axis.update(&JointStatus { torque: NewtonMetre(-30.0), bus: Volt(47.9), ..JointStatus::NONE });
    let read = |index, sub| axis.read(Object::at(index, sub)).expect("a value");
    assert_eq!(read(0x6078, 0) as i16, -400, "20 of 50 A");
    assert!((47_899..=47_900).contains(&read(0x6079, 0)), "mV");
    // 4.5 rad/s times 50 is 2148.6 revolutions per minute.
    assert_eq!((read(0x6080, 0), read(0x607F, 0)), (2148, 4_500_000));
    assert_eq!((read(0x608F, 1), read(0x6091, 1)), (8192, 50_000));
    assert_eq!((read(0x2020, 3), read(0x2020, 4)), (8000, 3150));
    assert_eq!([1, 2, 3, 4, 5, 6].map(|sub| read(0x2021, sub)), [0, 150, 300, 0, 500, 1000]);
    assert_eq!(axis.bandwidths(), LoopBandwidths::default());
    for (sub, values) in [(1, [149, 301, 150, 300, 0, 225]), (4, [499, 1001, 500, 1000, 0, 750])] {
        for (number, value) in values.into_iter().enumerate() {
            let written = axis.write(Object::at(0x2021, sub), value);
            assert_eq!(written, if number < 2 { Err(Abort::Range) } else { Ok(()) }, "{value}");
        }
    }
    let set = LoopBandwidths { position: Some(Hertz(2.25)), current: Some(Hertz(750.0)) };
    assert_eq!(axis.bandwidths(), set);
}
