//! Test board: two nodes and a leg that follows every request. Tests of the whole bus are in the submodules.

mod fuzz;
mod mapping;
mod session;
mod values;

use super::drive::{Axis, AxisConstants, Coupling, JointStatus, Mode};
use super::*;
use crate::leg::{DriveEvent, DriveState, PowerRequest};
use crate::units::{Ampere, NewtonMetre};

/// 5003 bytes: not a multiple of the segment or block size.
pub(crate) const LONG: usize = 5003;
const BYTES: [u8; LONG] = {
    let mut bytes = [0; LONG];
    let mut index = 0;
    while index < LONG {
        bytes[index] = b'!' + (index * 7 % 89) as u8;
        index += 1;
    }
    bytes
};
pub(crate) const LONG_TEXT: &str = match core::str::from_utf8(&BYTES) {
    Ok(text) => text,
    Err(_) => "",
};

pub(crate) const IDENTITY: Identity =
    Identity { product: 0x5CA2, revision: 1, texts: ["Scarab", "3.6", LONG_TEXT], ..Identity::scarab(7, "") };

/// Constants of a joint with every mode.
pub(crate) fn constants() -> AxisConstants {
    AxisConstants {
        rated_torque: NewtonMetre(40.0),
        rated_current: Ampere(20.0),
        modes: Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit()),
        ..AxisConstants::UNKNOWN
    }
}

pub(crate) fn axis() -> Axis {
    Axis::new(constants())
}

/// COB-ID and code of the emergency messages.
pub(crate) fn codes<'a>(frames: impl IntoIterator<Item = &'a Frame>) -> Vec<(u16, u16)> {
    let emergencies = frames.into_iter().filter(|frame| matches!(frame.id(), 0x81..=0xFF));
    emergencies.map(|frame| (frame.id(), u16::from_le_bytes([frame.data()[0], frame.data()[1]]))).collect()
}

/// Value or abort code of an SDO answer.
pub(crate) fn value(answer: [u8; 8]) -> Result<u32, u32> {
    let [command, .., a, b, c, d] = answer;
    let value = u32::from_le_bytes([a, b, c, d]);
    if command == 0x80 { Err(value) } else { Ok(value) }
}

/// Two nodes, two joints, one drive.
pub(crate) struct Board {
    pub(crate) nodes: [Node; 2],
    pub(crate) axes: [Axis; 2],
    pub(crate) drive: DriveState,
    pub(crate) now_us: u64,
    coupling: Coupling,
    /// Whether the leg refuses requests that enable it.
    pub(crate) refuses: bool,
}

impl Board {
    pub fn new(first: u8) -> Self {
        let node = |number| Node::new(NodeId::new(number).expect("a node's number"), IDENTITY);
        Self {
            nodes: [node(first), node(first + 1)],
            axes: [axis(); 2],
            drive: DriveState::NotReadyToSwitchOn,
            now_us: 0,
            coupling: Coupling::default(),
            refuses: false,
        }
    }

    /// Board after the boot-up messages and one tick of the leg, with the default of every object.
    pub(crate) fn with_defaults(first: u8) -> Self {
        let mut board = Self::new(first);
        assert_eq!(board.tick().len(), 2);
        board
    }

    /// Started board whose emergency messages do not wait for each other (1015).
    pub(crate) fn started(first: u8) -> Self {
        let mut board = Self::with_defaults(first);
        for node in &mut board.nodes {
            node.communication_mut().emergency.inhibit = 0;
        }
        board
    }

    /// Puts a frame on the bus.
    pub(crate) fn receive(&mut self, id: u16, data: &[u8]) {
        for (node, axis) in self.nodes.iter_mut().zip(&mut self.axes) {
            node.on_frame(&Frame::new(id, data), self.now_us, axis);
        }
    }

    /// Advances 250 us: one tick of the leg, then all frames of the nodes.
    pub fn tick(&mut self) -> Vec<Frame> {
        self.now_us += 250;
        self.drive = self.drive.after(DriveEvent::Tick, 4);
        for axis in &mut self.axes {
            let command = axis.command();
            let mode = command.target.mode().map_or(0, |mode| mode as i8);
            let requests_seen = command.request_count;
            axis.update(&JointStatus { drive: self.drive, mode, requests_seen, ..JointStatus::NONE });
        }
        let [hip, knee] = &mut self.axes;
        if let Some(request) = self.coupling.power([hip, knee], self.drive, self.refuses) {
            let enables = matches!(
                request,
                PowerRequest::Shutdown | PowerRequest::SwitchOn | PowerRequest::EnableOperation
            );
            if !(self.refuses && enables) {
                self.drive = self.drive.after(DriveEvent::Requested(request), 4);
            }
        }
        for (node, axis) in self.nodes.iter_mut().zip(&self.axes) {
            node.on_drive(axis.error());
        }
        self.frames()
    }

    pub(crate) fn frames(&mut self) -> Vec<Frame> {
        let mut frames = Vec::new();
        for (node, axis) in self.nodes.iter_mut().zip(&mut self.axes) {
            frames.extend(core::iter::from_fn(|| node.poll(self.now_us, axis)).take(1000));
        }
        assert!(frames.len() < 1000, "a node sends without end");
        frames
    }

    pub(crate) fn run(&mut self, ticks: u32) -> Vec<Frame> {
        (0..ticks).flat_map(|_| self.tick()).collect()
    }

    /// Sends an SDO request to the first node and returns its answer.
    pub(crate) fn ask(&mut self, request: [u8; 8]) -> Option<[u8; 8]> {
        let id = self.nodes[0].id();
        self.receive(id.on(0x600), &request);
        let [node, _] = &mut self.nodes;
        // Other frames are discarded.
        while let Some(frame) = node.poll(self.now_us, &mut self.axes[0]) {
            if frame.id() == id.on(0x580) {
                return frame.full();
            }
        }
        None
    }

    pub(crate) fn read(&mut self, index: u16, sub: u8) -> Result<u32, u32> {
        let [low, high] = index.to_le_bytes();
        let answer = self.ask([0x40, low, high, sub, 0, 0, 0, 0]).expect("an answer");
        assert_eq!(answer[1..4], [low, high, sub]);
        value(answer)
    }

    /// Writes a number with the given size.
    pub(crate) fn write(&mut self, index: u16, sub: u8, number: u32, size: u8) -> Result<(), u32> {
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), number.to_le_bytes());
        let answer = self.ask([0x23 | (4 - size) << 2, low, high, sub, a, b, c, d]).expect("an answer");
        value(answer).map(|_| ())
    }
}
