//! What hosts have commanded a joint, as far as a witness can know it.
//!
//! A command counts from when it is sent until the leg is disabled, moves by itself or has lost its host. The
//! mode is known once the node has confirmed it.

use super::{MAPPED, Object};

/// Received PDOs of a node.
pub(super) const PDOS: usize = 4;
/// The controlword and the mode.
pub(super) const WORD: u16 = 0x6040;
pub(super) const MODE: u16 = 0x6060;
/// Largest time in which a frame that was sent acts, ticks.
const ON_ITS_WAY: u64 = 4;
/// Default mapping of the received PDOs.
const DEFAULT_MAPS: [Object; PDOS] =
    [Object(WORD, 0, 2), Object(0x607A, 0, 4), Object(0x60FF, 0, 4), Object(0x6071, 0, 2)];

/// Kind of a command.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Command {
    /// Target or offset: index and subindex.
    Value(u16, u8),
    /// Rising bit 4 of the controlword.
    Start,
    /// Operation is to be enabled.
    Enable,
    /// The target is the position in which the joint rests.
    Stay,
}

/// Commands of a joint.
pub(super) struct Commanded {
    /// Mode; `None` while that is uncertain.
    pub(crate) mode: Option<i8>,
    /// Commands, each with the tick in which it was sent.
    sent: Vec<(Command, u64)>,
    /// Whether each event that makes its targets void is known.
    pub(crate) is_certain: bool,
    /// Whether 6072 may be too small to hold the pose.
    pub(crate) may_sag: bool,
    /// Whether the halt bit is set for certain.
    halts: bool,
    /// Whether a host may have taken control of the leg.
    pub(crate) may_be_hosted: bool,
    /// Whether another mapping may be loaded at a reset.
    pub(crate) may_have_saved: bool,
    /// Whether the node may reject a SYNC.
    may_reject_sync: bool,
    /// Whether the node may be stopped when its host is lost, and then reports nothing.
    pub(crate) may_stop: bool,
    /// Objects of each received PDO, and whether they are certain.
    maps: [(Vec<Object>, bool); PDOS],
    /// Whether each received PDO is synchronous, and the bytes that may wait for a SYNC.
    is_synchronous: [Option<bool>; PDOS],
    waiting: [Option<([u8; 8], u64)>; PDOS],
}

/// Whether writing an object is a target or an offset.
const fn is_target(index: u16) -> bool {
    matches!(index, 0x6071 | 0x607A | 0x60B1 | 0x60B2 | 0x60FF | 0x2020)
}

impl Commanded {
    pub fn new() -> Self {
        Self {
            mode: Some(0),
            sent: Vec::new(),
            is_certain: true,
            may_sag: false,
            halts: false,
            may_be_hosted: false,
            may_have_saved: false,
            may_reject_sync: false,
            may_stop: false,
            maps: DEFAULT_MAPS.map(|object| (vec![object], true)),
            is_synchronous: [Some(false); PDOS],
            waiting: [None; PDOS],
        }
    }

    /// An object is on its way.
    pub fn write(&mut self, index: u16, sub: u8, tick: u64) {
        self.may_sag |= index == 0x6072;
        self.may_reject_sync |= matches!(index, 0x1005 | 0x1019);
        self.may_stop |= index == 0x1029;
        if is_target(index) {
            self.end_stay(tick);
            self.note(Command::Value(index, sub), tick);
        }
        if let (0x1400..=0x1403, 2) = (index, sub) {
            self.is_synchronous[usize::from(index - 0x1400)] = None;
        }
    }

    /// The node has confirmed the value of an object.
    pub(crate) fn confirm(&mut self, index: u16, sub: u8, value: i32) {
        self.is_certain |= index == 0x60FF;
        self.halts |= index == WORD && value & 0x100 != 0;
        if let (0x1400..=0x1403, 2) = (index, sub) {
            let pdo = usize::from(index - 0x1400);
            (self.is_synchronous[pdo], self.waiting[pdo]) = (Some(value as u8 <= 240), None);
        }
    }

    /// A controlword is on its way. A start by bit 4 belongs to profile position mode.
    pub(crate) fn word(&mut self, word: u16, tick: u64) {
        if word & 0x10 != 0 && self.may_be_in(1) {
            self.note(Command::Start, tick);
        }
        if word & 0x8F == 0xF {
            self.note(Command::Enable, tick);
        }
        self.is_certain &= word & 0x10 == 0 || !self.may_be_in(6);
        self.halts = false;
        self.may_be_hosted |= word != 0;
    }

    /// Targets that name the present position of a joint at rest are on their way.
    pub(crate) fn stay(&mut self, tick: u64) {
        self.note(Command::Stay, tick);
    }

    /// A new target ends a stay. The other targets that it named may act in other modes from now on.
    fn end_stay(&mut self, tick: u64) {
        if self.stays() {
            self.sent.retain(|(command, _)| *command != Command::Stay);
            self.note(Command::Value(0x607A, 0), tick);
            self.note(Command::Value(0x60FF, 0), tick);
        }
    }

    /// Whether the target may be the position in which the joint rests; it may still approach it.
    pub(crate) fn stays(&self) -> bool {
        self.has(Command::Stay)
    }

    /// The node has confirmed a mode, or may have another one.
    pub(crate) fn set_mode(&mut self, mode: Option<i8>) {
        self.mode = mode;
        if !self.may_be_in(1) {
            self.sent.retain(|(command, _)| *command != Command::Start);
        }
    }

    fn may_be_in(&self, mode: i8) -> bool {
        self.mode.is_none_or(|known| known == mode)
    }

    fn has(&self, command: Command) -> bool {
        self.sent.iter().any(|(other, _)| *other == command)
    }

    fn note(&mut self, command: Command, tick: u64) {
        self.sent.retain(|(other, _)| *other != command);
        self.sent.push((command, tick));
    }

    /// Commands that were sent before this tick are void, but those that were on their way.
    pub(crate) fn void(&mut self, tick: u64, delay: u32) {
        let is_recent = |at: u64| at + ON_ITS_WAY + u64::from(delay) > tick;
        // The state that a request to enable brings about is seen late, its end at once by a boot-up message.
        let is_asked = |at: u64| at + 2 * ON_ITS_WAY + 4 * u64::from(delay) > tick;
        self.sent.retain(|(command, at)| is_recent(*at) || *command == Command::Enable && is_asked(*at));
        for waiting in &mut self.waiting {
            waiting.take_if(|(_, at)| !is_recent(*at));
        }
    }

    /// The joint was homed: its targets would name other positions.
    pub(crate) fn home(&mut self) {
        self.sent.retain(|(command, _)| *command == Command::Enable);
    }

    /// The host was lost, `delay` ticks ago at most: its commands are void.
    pub(crate) fn lose(&mut self, tick: u64, delay: u32) {
        self.is_certain = false;
        self.void(tick, delay);
    }

    /// The leg was enabled: a start from before does not count.
    pub(crate) fn enable(&mut self, tick: u64, delay: u32) {
        let is_recent = |at: u64| at + ON_ITS_WAY + 2 * u64::from(delay) > tick;
        self.sent.retain(|(command, at)| *command != Command::Start || is_recent(*at));
    }

    /// Whether a host has asked to enable the leg since it was disabled.
    pub(crate) fn has_asked(&self) -> bool {
        self.has(Command::Enable)
    }

    /// Whether a target or an offset was written.
    pub(crate) fn has_any(&self) -> bool {
        self.sent.iter().any(|(command, _)| *command != Command::Enable)
    }

    /// Whether a target that the mode needs was written.
    pub(crate) fn may_move_in(&self, mode: i8) -> bool {
        let has = |index, sub| self.has(Command::Value(index, sub));
        match mode {
            1 => self.has(Command::Start),
            3 | 9 => has(0x60FF, 0),
            4 | 10 => has(0x6071, 0),
            8 => has(0x607A, 0),
            -1 => (has(0x607A, 0) || self.stays()) && has(0x2020, 1) && has(0x2020, 2),
            _ => false,
        }
    }

    /// Whether a host may move the joint.
    pub(crate) fn may_move(&self) -> bool {
        // A halt lets the torque of profile torque mode fade.
        let is_halted = self.halts && !self.may_be_in(4);
        !is_halted && self.mode.map_or_else(|| self.has_any(), |mode| self.may_move_in(mode))
    }

    /// Whether a received PDO may hold the mode.
    pub(crate) fn maps_mode(&self) -> bool {
        self.maps.iter().flat_map(|(objects, _)| objects).any(|object| object.0 == MODE)
    }

    /// A received PDO is mapped: for certain, or perhaps.
    pub(crate) fn map(&mut self, pdo: usize, objects: [Object; 2], is_certain: bool) {
        let map = &mut self.maps[pdo];
        if is_certain {
            map.0.clear();
        }
        map.0.extend(objects);
        map.1 = is_certain;
        self.waiting[pdo] = None;
    }

    /// The node has started again: with its default mapping, or a saved one.
    pub(crate) fn reset(&mut self, tick: u64, delay: u32) {
        self.set_mode(None);
        self.lose(tick, delay);
        for (map, object) in self.maps.iter_mut().zip(DEFAULT_MAPS) {
            let saved = if self.may_have_saved { MAPPED.as_slice() } else { &[] };
            *map = ([&[object], saved].concat(), !self.may_have_saved);
        }
        self.is_synchronous = [Some(false).filter(|_| !self.may_have_saved); PDOS];
    }

    /// A received PDO is on its way. Returns the objects that it may write now.
    pub(crate) fn receive(&mut self, pdo: usize, bytes: [u8; 8], tick: u64) -> Vec<u16> {
        let is_synchronous = self.is_synchronous[pdo];
        self.waiting[pdo] = Some((bytes, tick)).filter(|_| is_synchronous != Some(false));
        if is_synchronous == Some(true) { Vec::new() } else { self.act(pdo, bytes, tick) }
    }

    /// A SYNC is on its way. Returns the objects that it may write.
    pub(crate) fn synchronise(&mut self, tick: u64) -> Vec<u16> {
        let waiting = self.waiting;
        if !self.may_reject_sync {
            self.waiting = [None; PDOS];
        }
        let acting = waiting.into_iter().enumerate().filter_map(|(pdo, waiting)| Some((pdo, waiting?.0)));
        acting.flat_map(|(pdo, bytes)| self.act(pdo, bytes, tick)).collect()
    }

    /// Whether a mode may wait for a SYNC.
    pub(crate) fn mode_waits(&self) -> bool {
        let mut pdos = self.waiting.iter().zip(&self.maps);
        pdos.any(|(waiting, map)| waiting.is_some() && map.0.iter().any(|object| object.0 == MODE))
    }

    fn act(&mut self, pdo: usize, bytes: [u8; 8], tick: u64) -> Vec<u16> {
        let (objects, is_certain) = self.maps[pdo].clone();
        if !is_certain && objects.iter().any(|object| object.0 == MODE) {
            self.set_mode(None);
        }
        let mut rest = bytes.as_slice();
        for Object(index, sub, length) in objects.iter().copied() {
            let value;
            (value, rest) = rest.split_at(usize::from(length).min(rest.len()));
            self.write(index, sub, tick);
            // A node that is not Operational ignores the frame.
            self.is_certain &= index != 0x60FF;
            match (index, value) {
                (WORD, [low, high]) if is_certain => self.word(u16::from_le_bytes([*low, *high]), tick),
                (WORD, _) => bytes.into_iter().for_each(|byte| self.word(u16::from(byte), tick)),
                (MODE, _) => self.set_mode(None),
                _ => {}
            }
        }
        objects.iter().map(|object| object.0).collect()
    }
}
