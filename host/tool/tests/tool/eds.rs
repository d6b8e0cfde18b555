//! Electronic data sheets compared with a live node, object by object.

use std::collections::BTreeMap;

use scarab::bus::drive::{Axis, AxisConstants};
use scarab::bus::{Frame, Identity, Node, NodeId};
use scarab::units::{Ampere, NewtonMetre};

use crate::command::Folder;

const NODE: u8 = 2;

/// Node of a joint without a leg.
struct Live {
    node: Node,
    axis: Axis,
}

impl Live {
    fn new(joint: usize) -> Self {
        let constants = AxisConstants {
            rated_torque: NewtonMetre(40.0),
            rated_current: Ampere(20.0),
            modes: 0,
            ..AxisConstants::UNKNOWN
        };
        let node = NodeId::new(NODE).expect("a number");
        let mut live = Self {
            node: Node::new(node, Identity::scarab(1, "3.6").for_joint(joint)),
            axis: Axis::new(constants),
        };
        assert_eq!(live.node.poll(0, &mut live.axis), Some(Frame::new(0x702, &[0])));
        live
    }

    /// Reads an object by SDO upload: its command, and the four bytes of data.
    fn read(&mut self, index: u16, sub: u8) -> (u8, u32) {
        let [low, high] = index.to_le_bytes();
        let request = Frame::new(0x602, &[0x40, low, high, sub, 0, 0, 0, 0]);
        self.node.on_frame(&request, 0, &mut self.axis);
        let answer = self.node.poll(0, &mut self.axis).and_then(|frame| frame.full()).expect("an answer");
        (answer[0], u32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]]))
    }
}

/// Keys and values of each section.
fn sections(text: &str) -> BTreeMap<String, BTreeMap<String, String>> {
    let mut sections: BTreeMap<String, BTreeMap<String, String>> = BTreeMap::new();
    let mut name = String::new();
    for line in text.lines().filter(|line| !line.is_empty()) {
        if let Some(title) = line.strip_prefix('[') {
            name = title.trim_end_matches(']').to_owned();
            assert!(sections.insert(name.clone(), BTreeMap::new()).is_none(), "[{name}] occurs twice");
        } else {
            let (key, value) = line.split_once('=').expect("key=value");
            sections.get_mut(&name).expect("a section").insert(key.into(), value.into());
        }
    }
    sections
}

fn number(text: &str) -> u32 {
    let (plus, rest) = match text.strip_prefix("$NODEID+") {
        Some(rest) => (u32::from(NODE), rest),
        None => (0, text),
    };
    let value = match rest.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => rest.parse::<i64>().map(|value| value as u32),
    };
    value.unwrap_or_else(|_| panic!("{text}: not a number")) + plus
}

#[test]
fn the_sheet_lists_exactly_the_node_s_objects_with_size_and_default() {
    let folder = Folder::new();
    let out = folder.path("sheets");
    let run = folder.scarab("eds --out @sheets").ends_with(0);
    for (position, joint) in ["hip", "knee"].into_iter().enumerate() {
        let path = out.join(format!("scarab-{joint}.eds"));
        run.prints(&format!("electronic data sheet: {}\n", path.display()));
        let sheet = sections(&std::fs::read_to_string(&path).expect("just written"));
        let mut live = Live::new(position);
        let mut listed = Vec::new();
        for list in ["MandatoryObjects", "OptionalObjects", "ManufacturerObjects"] {
            let list = &sheet[list];
            assert_eq!(list.len(), number(&list["SupportedObjects"]) as usize + 1);
            listed.extend(
                list.iter().filter(|(key, _)| *key != "SupportedObjects").map(|(_, value)| number(value)),
            );
        }
        listed.sort_unstable();
        for index in 0x1000..=0x6FFF_u16 {
            // The sheet lists exactly the objects that the node has.
            let is_there = live.read(index, 0) != (0x80, 0x0602_0000);
            assert_eq!(listed.binary_search(&u32::from(index)).is_ok(), is_there, "{index:x}");
            assert_eq!(sheet.contains_key(&format!("{index:04X}")), is_there, "{index:x}");
            for sub in 0..=u8::MAX {
                if !is_there {
                    break;
                }
                let has_parts = sheet[&format!("{index:04X}")].contains_key("SubNumber");
                let name = if has_parts { format!("{index:04X}sub{sub:X}") } else { format!("{index:04X}") };
                let (command, value) = live.read(index, sub);
                let is_part = (command, value) != (0x80, 0x0609_0011);
                let part = if has_parts || sub == 0 { sheet.get(&name) } else { None };
                assert_eq!(part.is_some(), is_part, "{index:x} {sub}");
                let Some(part) = part else { continue };
                let size = match number(&part["DataType"]) {
                    2 | 5 => 1,
                    3 | 6 => 2,
                    4 | 7 | 8 => 4,
                    _ => continue,
                };
                // Objects of a leg cannot be read from a joint alone, and no error has been recorded yet.
                let refused = match index {
                    0x1F50..0x1F58 => Some(0x0602_0000),
                    0x1003 | 0x2100..=0x2193 => Some(0x0800_0024),
                    _ => None,
                };
                if command == 0x80 && refused.is_some() {
                    assert_eq!(Some(value), refused, "{index:x} {sub}");
                    continue;
                }
                assert_eq!(command, 0x43 | (4 - size) << 2, "{index:x} {sub}");
                if let Some(default) = part.get("DefaultValue") {
                    let mask = u32::MAX >> (32 - 8 * u32::from(size));
                    assert_eq!(value, number(default) & mask, "{index:x} {sub}");
                }
            }
        }
    }
}
