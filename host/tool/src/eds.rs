//! Electronic data sheet of a joint's node, generated from the node's own object table.
//!
//! Why generated: host software trusts the sheet, not the node, and a manual sheet is wrong after the next
//! change. Values that only a live node has (measurements, serial number, versions) have no default.
//!
//! Source: CiA 306-1 (CAN electronic data sheet). `host/tool/tests/tool/eds.rs` checks it by a live node.

use std::collections::BTreeMap;
use std::fmt::{self, Write};

use scarab::bus::Identity;
use scarab::bus::commissioning::StepResult;
use scarab::bus::dictionary::{Access, Mapping, Row, Type};
use scarab::bus::table::{GROUPS, NAMES, ROWS};
use scarab::leg::{Parameter, Reason};
use scarab::safety::InhibitReason;

/// Date and time of the last change to the dictionary, in the form of CiA 306. Constants instead of a clock:
/// the data sheets of one version are the same whenever they are written.
const CHANGED: [&str; 2] = ["11-28-2026", "06:00AM"];

/// One subindex of an object.
struct Part {
    row: &'static Row,
    name: &'static str,
}

/// Data sheet of a joint's node.
pub fn text(joint: &str) -> String {
    let mut out = String::new();
    // Writing into a string does not fail.
    let _ = write_all(&mut out, joint);
    out
}

/// Objects with their parts by subindex.
fn objects() -> BTreeMap<u16, BTreeMap<u8, Part>> {
    let mut objects: BTreeMap<u16, BTreeMap<u8, Part>> = BTreeMap::new();
    for (row, name) in ROWS.iter().zip(NAMES) {
        for index in row.index..row.index + u16::from(row.indices) {
            for sub in row.sub..row.sub + row.subs {
                objects.entry(index).or_default().insert(sub, Part { row, name });
            }
        }
    }
    objects
}

fn write_all(out: &mut String, joint: &str) -> fmt::Result {
    let (identity, [date, time]) = (Identity::scarab(0, "").for_joint(usize::from(joint == "knee")), CHANGED);
    writeln!(
        out,
        "[FileInfo]\nFileName=scarab-{joint}.eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\nDescription=Scarab joint drive, {joint}\n\
         CreationDate={date}\nCreationTime={time}\nCreatedBy=Scarab {version}\n\
         ModificationDate={date}\nModificationTime={time}\nModifiedBy=Scarab {version}\n",
        version = env!("CARGO_PKG_VERSION")
    )?;
    writeln!(
        out,
        "[DeviceInfo]\nVendorName=Scarab\nVendorNumber={:#010X}\nProductName=Scarab {joint}\nProductNumber={:#010X}\nRevisionNumber={:#010X}\n\
         BaudRate_10=0\nBaudRate_20=0\nBaudRate_50=0\nBaudRate_125=1\nBaudRate_250=1\nBaudRate_500=1\nBaudRate_800=0\nBaudRate_1000=1\n\
         SimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\nDynamicChannelsSupported=0\nGroupMessaging=0\nNrOfRXPDO=4\nNrOfTXPDO=4\n\
         LSS_Supported=1\n",
        identity.vendor, identity.product, identity.revision
    )?;
    // Dummy entries for received PDOs: INTEGER8 to UNSIGNED32.
    writeln!(out, "[DummyUsage]")?;
    for kind in 1..=7 {
        writeln!(out, "Dummy{kind:04}={}", u8::from(kind > 1))?;
    }
    let objects = objects();
    let list = |out: &mut String, title: &str, chosen: &dyn Fn(u16) -> bool| {
        let indices: Vec<u16> = objects.keys().copied().filter(|index| chosen(*index)).collect();
        writeln!(out, "\n[{title}]\nSupportedObjects={}", indices.len())?;
        for (number, index) in (1..).zip(indices) {
            writeln!(out, "{number}={index:#06X}")?;
        }
        Ok(())
    };
    let is_mandatory = |index| matches!(index, 0x1000 | 0x1001 | 0x1018);
    list(out, "MandatoryObjects", &is_mandatory)?;
    list(out, "OptionalObjects", &|index| !is_mandatory(index) && !(0x2000..0x6000).contains(&index))?;
    list(out, "ManufacturerObjects", &|index| (0x2000..0x6000).contains(&index))?;
    for (index, parts) in &objects {
        write_object(out, *index, parts, &identity)?;
    }
    let comments = comments();
    writeln!(out, "\n[Comments]\nLines={}", comments.len())?;
    for (number, comment) in (1..).zip(comments) {
        writeln!(out, "Line{number}={comment}")?;
    }
    Ok(())
}

/// Numbers, bits and units that the names do not say.
fn comments() -> Vec<String> {
    let mut lines: Vec<String> = [
        "1F51:1 write 0 stop, 1 start or confirm, 2 restart, 3 clear; read 0 stopped, 1 running",
        "1F57:1 bit 0 under way, bits 1 to 7 error, 8 stopped, 9 cleared, 10 on trial (docs/update.md)",
        "2020:1 and :3 stiffness, unit 0.1 N m/rad; :2 and :4 damping, unit 0.01 N m s/rad",
        "2021:1 to :3 bandwidths of the position loop, unit 0.01 Hz; :4 to :6 of the current loop, Hz",
        "2021:1 and :4 0 selects the largest, :3 and :6",
        "2100:1 write 1 start, 2 cancel, 3 use the offered update, 4 begin assistance, 5 end it",
        "2100:2 0 idle, 1 approach, 2 excite, 3 settle, 4 solve, 5 approach of a validation motion, 6 that motion",
        "2100:2 7 judge, 8 track, 9 follow, 10 to 12 assist: fade in, act, fade out; :3 motion, from 1",
        "2100:4 plan: 0 one-time, 1 sequential; :7 number of models stored on this board",
        "2100:8 verdict: 0 none, 1 accepted, 2 refused; :12 1 the model no longer fits, 2 an update is offered",
        "2100:13 leg of the next identification: 0 unknown, 1 empty, 2 worn",
        "2110 to 2112 parameters of the joint: value, sigma (kg m^2, kg m, kg, N m, N m s/rad; NaN unknown), status",
        "2112 0 no result, 1 identified, 2 grouped, 3 weak, 4 prior",
        "2120 to 2124 base parameters: value, sigma, carrier, flags, least squares; equal at both nodes",
        "2122 joint << 8 | parameter, both from 1; 2123 bits: 0 known, 1 grouped, 2 dropped",
        "2130 to 2132 unit N m, 2133 rows; motion 1 identified from, 2 to 4 predicted",
        "2140:1 write 1 to hold the waiting samples, 0 to release them; read their number",
        "2140:2 24 bytes a sample: tick, segment (UNSIGNED32), angles (rad), torques (N m) of hip and knee (REAL32)",
        "2140:2 segment: 0 none, 1 identified from, 2 tracked, 3 to 5 predicted",
        "2150:1 to :4 per mille; greatest 1000, 800, 1000, 500; :4 from -500 on, negative resists",
        "2160:2 bits: 0 calibrated, 1 joints have their zeros, 2 calibrating, 3 enabling switch closed",
        "2160:4 axis that the calibration refused, from 1; :5 reason, :6 detail (docs/bus.md)",
        "2170:2 and :3 unit 0.1 degrees Celsius, -32768 unknown; :4 to :6 unit 0.01 A; :7 and :8 ns",
    ]
    .map(String::from)
    .into();
    lines.extend(
        (1..).zip(Parameter::ALL).map(|(sub, parameter)| format!("2110 to 2112, sub {sub}: {parameter:?}")),
    );
    lines.extend((0..).zip(Reason::ALL).map(|(bit, reason)| format!("2100:9 bit {bit}: {}", reason.name())));
    lines.extend(StepResult::ALL.map(|result| format!("2160:3 value {}: {}", result as u8, result.words())));
    lines.extend(InhibitReason::ALL.map(|cause| {
        let words = cause.code().map_or("", |code| code.words());
        format!("2170:1 bit {}: {} {words}", cause as u8, cause.name()).trim_end().to_owned()
    }));
    lines
}

fn write_object(
    out: &mut String,
    index: u16,
    parts: &BTreeMap<u8, Part>,
    identity: &Identity,
) -> fmt::Result {
    let group = GROUPS.iter().find(|(first, count, ..)| (*first..first + count).contains(&index));
    let Some((first, count, name, is_array)) = group else {
        for part in parts.values() {
            writeln!(out, "\n[{index:04X}]\nParameterName={}", part.name)?;
            write_variable(out, index, 0, part, identity)?;
        }
        return Ok(());
    };
    let number = if *count > 1 { format!(" {}", index - first + 1) } else { String::new() };
    let kind = if *is_array { 8 } else { 9 };
    writeln!(
        out,
        "\n[{index:04X}]\nParameterName={name}{number}\nObjectType=0x{kind}\nSubNumber={}",
        parts.len()
    )?;
    for (sub, part) in parts {
        let is_one_of_many = parts.values().filter(|other| other.name == part.name).count() > 1;
        let number = if is_one_of_many { format!(" {sub}") } else { String::new() };
        writeln!(out, "\n[{index:04X}sub{sub:X}]\nParameterName={}{number}", part.name)?;
        write_variable(out, index, *sub, part, identity)?;
    }
    Ok(())
}

fn write_variable(out: &mut String, index: u16, sub: u8, part: &Part, identity: &Identity) -> fmt::Result {
    let row = part.row;
    let access = match row.access {
        Access::Const => "const",
        Access::Read => "ro",
        Access::Both => "rw",
        Access::Write => "wo",
    };
    writeln!(out, "ObjectType=0x7\nDataType={:#06X}\nAccessType={access}", row.kind as u8)?;
    let default = match (index, sub) {
        (0x1018, 1) => Some(identity.vendor),
        (0x1018, 2) => Some(identity.product),
        (0x1018, 3) => Some(identity.revision),
        (0x1200, _) => Some(row.default),
        _ if row.access == Access::Read || row.kind.size().is_none() => None,
        _ => Some(row.default),
    };
    if let Some(default) = default {
        let node = if row.plus_node { "$NODEID+" } else { "" };
        let number = match row.kind {
            Type::I8 => (default as i8).to_string(),
            Type::I16 => (default as i16).to_string(),
            Type::I32 => (default as i32).to_string(),
            _ => format!("{default:#0digits$X}", digits = 2 + 2 * usize::from(row.kind.size().unwrap_or(4))),
        };
        writeln!(out, "DefaultValue={node}{number}")?;
    }
    writeln!(out, "PDOMapping={}", u8::from(row.mapping != Mapping::No))
}

#[cfg(test)]
mod tests {
    use scarab::checksum::Checksum;

    use super::*;

    #[test]
    fn the_date_is_that_of_the_last_change_to_the_dictionary() {
        let text = text("hip");
        assert_eq!(text, super::text("hip"));
        assert!(text.contains("\nCreationDate=11-28-2026\nCreationTime=06:00AM\n"));
        let objects = text.split_once("[DummyUsage]").expect("its sections").1;
        let sum = objects.bytes().fold(Checksum::EMPTY, |sum, byte| sum.word(u32::from(byte)));
        // Another dictionary: set CHANGED to the day of the change and write its sum here.
        assert_eq!(format!("{sum:?}"), SUM);
    }

    const SUM: &str = "Checksum(1988092911)";
}
