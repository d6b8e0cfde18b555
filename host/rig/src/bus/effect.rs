//! Effect of a host's frame, found with a copy of each node, so that any mapping and SDO transfer is covered.
//!
//! Why: a frame that waited too long must not start a motion, and a stop must never be lost.

use scarab::bus::dictionary::Object;
use scarab::bus::{Abort, Frame, Lost, Node, Objects};

const NMT: u16 = 0;
const SYNC: u16 = 0x80;
/// Little-endian index of object 1005, the COB-ID of SYNC.
const SYNC_OBJECT: [u8; 2] = [0x05, 0x10];
const CONTROLWORD: u16 = 0x6040;
/// Controlword "enable operation", the only one that enables, starts or continues a motion.
const ENABLE: u32 = 0xF;
/// Targets and offsets of all modes.
const TARGETS: [u16; 5] = [0x607A, 0x60FF, 0x6071, 0x60B1, 0x60B2];
/// Command of the identification; "cancel" is a stop.
const IDENTIFICATION: (u16, u8) = (0x2100, 1);
const CANCEL: u32 = 2;
/// Limit of a node's frames before its answer.
const MOST_FRAMES: usize = 32;

/// Effect of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effect {
    /// NMT command, or a controlword that disables, stops or resets.
    Stop,
    /// Target, controlword that enables or continues, or SYNC that makes a waiting target effective.
    SetPoint,
    /// Neither stop nor set-point.
    Other,
}

/// Objects that only record what is written.
#[derive(Default)]
struct Recorder {
    stops: bool,
    moves: bool,
}

impl Objects for Recorder {
    fn read(&self, _: Object) -> Result<u32, Abort> {
        Ok(0)
    }

    fn write(&mut self, object: Object, value: u32) -> Result<(), Abort> {
        let Object { index, sub } = object;
        let cancels = value & 0xFF == CANCEL;
        match index {
            CONTROLWORD if value & ENABLE != ENABLE => self.stops = true,
            CONTROLWORD => self.moves = true,
            _ if (index, sub) == IDENTIFICATION && cancels => self.stops = true,
            _ => self.moves |= TARGETS.contains(&index) || (index, sub) == IDENTIFICATION,
        }
        Ok(())
    }

    fn lost(&mut self, _: Lost) {}

    fn reset(&mut self) {}
}

/// Returns the COB-ID of a node's SYNC.
fn sync_of(mut node: Node, now_us: u64) -> u16 {
    let (number, [low, high]) = (u16::from(node.id().number()), SYNC_OBJECT);
    let mut objects = Recorder::default();
    let request = Frame::new(0x600 + number, &[0x40, low, high, 0, 0, 0, 0, 0]);
    let _ = node.on_frame(&request, now_us, &mut objects);
    for _ in 0..MOST_FRAMES {
        let Some(frame) = node.poll(now_us, &mut objects) else { break };
        if let (true, [_, _, _, _, a, b, ..]) = (frame.id() == 0x580 + number, frame.data()) {
            return u16::from_le_bytes([*a, *b]) & 0x7FF;
        }
    }
    SYNC
}

impl Effect {
    /// Returns the effect of a frame on these nodes.
    pub(crate) fn from_frame<'a>(frame: &Frame, nodes: impl Iterator<Item = &'a Node>, now_us: u64) -> Self {
        if frame.id() == NMT {
            // Other lengths are no command.
            return if frame.data().len() == 2 { Self::Stop } else { Self::Other };
        }
        let mut found = Recorder::default();
        for node in nodes {
            let sync = sync_of(*node, now_us);
            // A node with a SYNC counter accepts only SYNC frames with a counter; any other node accepts
            // those without.
            let syncs = [Frame::new(sync, &[]), Frame::new(sync, &[1])];
            let mut node = *node;
            let synchronise = |node: &mut Node, objects: &mut Recorder| {
                syncs.iter().for_each(|sync| _ = node.on_frame(sync, now_us, objects));
            };
            if frame.id() != sync {
                // Values already waiting for a SYNC are not an effect of this frame.
                synchronise(&mut node, &mut Recorder::default());
            }
            let _ = node.on_frame(frame, now_us, &mut found);
            synchronise(&mut node, &mut found);
        }
        match found {
            Recorder { stops: true, .. } => Self::Stop,
            Recorder { moves: true, .. } => Self::SetPoint,
            Recorder { .. } => Self::Other,
        }
    }
}

#[cfg(test)]
mod tests {
    use scarab::bus::{Identity, NodeId};

    use super::*;

    /// Node 1, started.
    fn node() -> Node {
        let number = NodeId::new(1).expect("a number");
        let mut node = Node::new(number, Identity::scarab(1, "test"));
        let _ = node.poll(0, &mut Recorder::default());
        receive(&mut node, 0, &[1, 0]);
        node
    }

    fn receive(node: &mut Node, id: u16, data: &[u8]) {
        let _ = node.on_frame(&Frame::new(id, data), 0, &mut Recorder::default());
    }

    /// Writes an object of the node and discards the answer.
    fn write(node: &mut Node, index: u16, sub: u8, value: u32, size: u8) {
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
        receive(node, 0x601, &[0x23 | (4 - size) << 2, low, high, sub, a, b, c, d]);
        while let Some(frame) = node.poll(0, &mut Recorder::default()) {
            assert!(frame.id() != 0x581 || frame.data()[0] == 0x60, "{frame:?}");
        }
    }

    fn effect_of(node: &Node, id: u16, data: &[u8]) -> Effect {
        Effect::from_frame(&Frame::new(id, data), [node].into_iter(), 0)
    }

    #[test]
    fn stops_and_set_points_are_recognised_in_pdos_and_sdos() {
        let node = node();
        for (word, effect) in [
            (0x00, Effect::Stop),
            (0x02, Effect::Stop),
            (0x06, Effect::Stop),
            (0x07, Effect::Stop),
            (0x80, Effect::Stop),
            (0x0F, Effect::SetPoint),
            (0x3F, Effect::SetPoint),
            (0x10F, Effect::SetPoint),
        ] {
            let [low, high] = u16::to_le_bytes(word);
            assert_eq!(effect_of(&node, 0x201, &[low, high]), effect, "PDO, {word:x}");
            let download = [0x2B, 0x40, 0x60, 0, low, high, 0, 0];
            assert_eq!(effect_of(&node, 0x601, &download), effect, "SDO, {word:x}");
        }
        assert_eq!(effect_of(&node, 0, &[129, 0]), Effect::Stop);
        assert_eq!(effect_of(&node, 0, &[129, 0, 0]), Effect::Other);
        assert_eq!(effect_of(&node, 0x80, &[]), Effect::Other);
        // Reading, a heartbeat, and the controlword of another node have no effect here.
        for (id, data) in [(0x601, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0][..]), (0x750, &[5]), (0x202, &[15, 0])]
        {
            assert_eq!(effect_of(&node, id, data), Effect::Other, "{id:x}");
        }
        // Identification: start, cancel.
        assert_eq!(effect_of(&node, 0x601, &[0x2F, 0, 0x21, 1, 1, 0, 0, 0]), Effect::SetPoint);
        assert_eq!(effect_of(&node, 0x601, &[0x2F, 0, 0x21, 1, 2, 0, 0, 0]), Effect::Stop);
    }

    #[test]
    fn the_configured_mapping_and_sync_are_used() {
        let mut node = node();
        // Target and controlword in one frame with COB-ID 345, effective at SYNC 6A0.
        write(&mut node, 0x1005, 0, 0x6A0, 4);
        write(&mut node, 0x1400, 1, 1 << 31 | 0x345, 4);
        write(&mut node, 0x1600, 0, 0, 1);
        write(&mut node, 0x1400, 2, 1, 1);
        write(&mut node, 0x1600, 1, 0x607A_0020, 4);
        write(&mut node, 0x1600, 2, 0x6040_0010, 4);
        write(&mut node, 0x1600, 0, 2, 1);
        write(&mut node, 0x1400, 1, 0x345, 4);
        assert_eq!(effect_of(&node, 0x345, &[1, 2, 3, 4, 0, 0]), Effect::Stop);
        assert_eq!(effect_of(&node, 0x345, &[1, 2, 3, 4, 15, 0]), Effect::SetPoint);
        assert_eq!(effect_of(&node, 0x201, &[0, 0]), Effect::Other);
        assert_eq!(effect_of(&node, 0x6A0, &[]), Effect::Other);
        // A waiting controlword is an effect of the SYNC, not of the next frame.
        receive(&mut node, 0x345, &[1, 2, 3, 4, 15, 0]);
        assert_eq!(effect_of(&node, 0x6A0, &[]), Effect::SetPoint);
        assert_eq!(effect_of(&node, 0x80, &[]), Effect::Other);
        receive(&mut node, 0x345, &[1, 2, 3, 4, 0, 0]);
        assert_eq!(effect_of(&node, 0x6A0, &[]), Effect::Stop);
        assert_eq!(effect_of(&node, 0x601, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0]), Effect::Other);
    }
}
