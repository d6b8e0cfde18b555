//! Objects of a node: conversion between values and the bytes stored by the bus.
//!
//! A value is accepted if a node in its initial state accepts it, as on a board; this file has no rules of
//! its own.

use scarab::board::odrive_v3_6::settings::drives;
use scarab::bus::dictionary::{Object, Type, find};
use scarab::bus::drive::{Axis, AxisConstants, Mode};
use scarab::bus::table::{NAMES, ROWS};
use scarab::bus::{Abort, Identity, LONGEST, Node, NodeId, stored_entries, stored_objects, write_stored};
use scarab::units::{Ampere, NewtonMetre};
use scarab_identify::formats::leg_file::POSITION_BANDWIDTH;

use crate::parameter_file::{Joint, ObjectValue};

const LEAST: Object = Object::at(0x607D, 1);
const MOST: Object = Object::at(0x607D, 2);

fn words(object: Object) -> String {
    format!("{:#06X}:{}", object.index, object.sub).replace("0X", "0x")
}

fn name(object: Object) -> &'static str {
    let row = ROWS.iter().position(|row| row.holds(object));
    row.and_then(|row| NAMES.get(row)).copied().unwrap_or("")
}

/// Range of this type.
fn range(kind: Type) -> (i64, i64) {
    match kind {
        Type::I8 => (i8::MIN.into(), i8::MAX.into()),
        Type::I16 => (i16::MIN.into(), i16::MAX.into()),
        Type::I32 => (i32::MIN.into(), i32::MAX.into()),
        Type::U8 => (0, u8::MAX.into()),
        Type::U16 => (0, u16::MAX.into()),
        Type::U32 | Type::F32 | Type::Text | Type::Domain => (0, u32::MAX.into()),
    }
}

/// Number in these low bytes.
fn number(kind: Type, bits: u32) -> i64 {
    match kind {
        Type::I8 => i64::from(bits as i8),
        Type::I16 => i64::from(bits as i16),
        Type::I32 => i64::from(bits as i32),
        _ => i64::from(bits),
    }
}

/// Bytes that a board stores for these objects, in the table's order.
pub(super) fn to_bytes(objects: &[ObjectValue], joint: Joint) -> Result<Vec<u8>, String> {
    let mut known = Vec::new();
    for given in objects {
        let object = Object::at(given.index, given.subindex);
        let fault = |why: &str| format!("{}: {why}", words(object));
        let row = find(object).map_err(|_| fault("there is no such object"))?;
        match write_stored(object, given.value as u32, &mut [0; 8]) {
            Ok(_) => {}
            Err(Abort::ReadOnly) => return Err(fault("is read-only")),
            Err(_) => return Err(fault("is a command or belongs to the leg: never stored")),
        }
        if let Some(given) = given.name.as_deref().filter(|given| *given != name(object)) {
            return Err(fault(&format!("is `{}`, not `{given}`", name(object))));
        }
        let (least, most) = range(row.kind);
        if !(least..=most).contains(&given.value) {
            return Err(fault(&format!("{} is not from {least} to {most}", given.value)));
        }
        if known.iter().any(|(other, _)| *other == object) {
            return Err(fault("occurs twice"));
        }
        known.push((object, given.value));
    }
    let limit = |object, default: i32| {
        known.iter().find(|(other, _)| *other == object).map_or(i64::from(default), |(_, value)| *value)
    };
    let (least, most) = (limit(LEAST, i32::MIN), limit(MOST, i32::MAX));
    if least > most {
        return Err(format!("{} is {least}, above {} with {most}", words(LEAST), words(MOST)));
    }
    let mut bytes = [0; LONGEST];
    let mut length = 0;
    for (object, _) in stored_objects() {
        if let Some((_, value)) = known.iter().find(|(other, _)| *other == object) {
            length += write_stored(object, *value as u32, &mut bytes[length..])
                .map_err(|_| format!("more than the {LONGEST} bytes that a board stores for a node"))?;
        }
    }
    try_on_a_node(&bytes[..length], joint)?;
    Ok(bytes[..length].to_vec())
}

/// Checks that a node accepts them all.
fn try_on_a_node(bytes: &[u8], joint: Joint) -> Result<(), String> {
    const FIRST: NodeId = NodeId::new(1).expect("a number");
    let number = NodeId::new(1 + joint as u8).unwrap_or(FIRST);
    let mut node = Node::new(number, Identity::scarab(0, "simulated"));
    let mut axis = Axis::new(AxisConstants {
        rated_torque: NewtonMetre(1.0),
        rated_current: Ampere(1.0),
        modes: Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit()),
        position_bandwidth: POSITION_BANDWIDTH,
        current_bandwidth: drives::BANDWIDTH,
        ..AxisConstants::UNKNOWN
    });
    let refused = node.try_recall(bytes, &mut axis);
    refused.map_or(Ok(()), |object| {
        Err(format!("{} ({}): a node refuses this value", words(object), name(object)))
    })
}

/// Objects in the bytes of a node; entries missing in the table are named in the error.
pub(super) fn of_bytes(bytes: &[u8], joint: Joint) -> Result<Vec<ObjectValue>, String> {
    let objects: Vec<ObjectValue> = stored_entries(bytes)
        .map(|(object, bits)| ObjectValue {
            index: object.index,
            subindex: object.sub,
            name: Some(name(object).to_owned()),
            value: find(object).map_or(i64::from(bits), |row| number(row.kind, bits)),
        })
        .collect();
    let again = to_bytes(&objects, joint)?;
    if again.len() == bytes.len() { Ok(objects) } else { Err("bytes that are not an entry".into()) }
}

/// Whether the number is a bit pattern.
pub(super) fn is_pattern(object: &ObjectValue) -> bool {
    (0x1005..0x1016).contains(&object.index) || (0x1400..0x1C00).contains(&object.index)
}

/// Whether the value is of a wide unsigned type.
pub(super) fn is_wide(object: &ObjectValue) -> bool {
    find(Object::at(object.index, object.subindex)).is_ok_and(|row| row.kind == Type::U32)
}
