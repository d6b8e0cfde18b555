//! What must hold on a leg whose hosts send a random session.
//!
//! ```text
//! range     an enabled joint is in its range, or no farther out than it can be stopped
//! cap       no torque above the joint's limit
//! targets   no commanded motion before a target of this session: none since the leg was last enabled
//! steps     no torque changes by a tenth of its limit in a tick, unless the host has just asked for it in
//!           the joint's mode (`asks_for_a_step`), or a stop or the monitor takes it away
//! stops     a 0 in the controlword by SDO turns the leg off
//! words     the statusword is that of the leg, and bit 12 of a cyclic mode means a target of this session
//! faults    the code of a fault is heard from both nodes, if they can send
//! again     at the end a well-behaved host enables and moves the leg, or a reason is stated
//! ```

use scarab::bus::Frame;
use scarab::hal::{Contacts, SERVO_RATE_HZ};
use scarab::model::planar::{BASE, JOINTS};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use super::{HostSession, Object, Step};
use crate::options::SimulationOptions;
use crate::pair::Context;

const NODES: [u16; JOINTS] = [1, 2];
/// Received PDOs of a node.
const PDOS: usize = 4;
/// How far beyond its range an enabled joint may come until the monitor has stopped it, rad.
const BEYOND: f64 = 0.1;
/// Bits of 60FD that say why a leg is not enabled: an inhibit reason, no zeros, no calibration, a joint that
/// is outside its range, moves, or has no reading.
const REASONS: i32 = 0x7E_0000;
/// Largest motion of a joint that is held, rad, and the time after which it has come to rest, ticks.
const HELD: f64 = 0.01;
const COMES_TO_REST: u64 = 500 * MILLISECOND as u64;
/// Speed that an enabled leg must follow, micro-radian/s.
const FOLLOWED: i32 = 100_000;
/// Limit beyond those of every leg, micro-radian, also per second.
const TURNS: i32 = 20_000_000;
/// Time in which a host takes over a leg that has just been enabled, or a new word or mode acts, ticks.
const TAKES_OVER: u64 = 5 * MILLISECOND as u64;
/// Ticks until the nodes have started.
const START: u32 = 40;
/// Speed of a joint that creeps within its friction, rad/s: a joint that is held comes to rest from it.
const CREEP: f32 = 5e-3;
const MILLISECOND: u32 = SERVO_RATE_HZ / 1000;
/// Time in which a fault must be heard, ticks.
const HEARD: u64 = 200 * MILLISECOND as u64;
/// Time for which a new value explains a step of the torque, ticks: a cyclic target that has jumped is
/// interpolated over its period, and the joint then follows.
const AFTER_VALUE: u64 = 500 * MILLISECOND as u64;

/// Whether a new value of an object may change the torque at once in a mode. Profiles, homing, a new mode
/// and a halt may not: they start from the joint's place, velocity and torque.
const fn asks_for_a_step(mode: i8, index: u16) -> bool {
    match index {
        0x607A | 0x607D => matches!(mode, 8 | -1),
        0x60FF => mode == -1,
        // 6087 may be as steep as a host wants.
        0x6071 | 0x6087 => matches!(mode, 4 | 10 | -1),
        0x60B1 => matches!(mode, 8 | 9),
        0x60B2 => matches!(mode, 8..=10),
        0x2020 => mode == -1,
        0x6072 => true,
        _ => false,
    }
}

/// The joint that a step means, or all.
fn meant(joint: usize) -> impl Iterator<Item = usize> {
    (0..JOINTS).filter(move |other| joint == JOINTS || *other == joint)
}

/// Limits of a joint.
#[derive(Clone, Copy, Debug)]
pub struct JointBounds {
    /// Ends of its range, anatomical, rad.
    range: [f64; 2],
    /// Greatest torque, N m.
    cap: f64,
}

impl JointBounds {
    /// Limits of this leg's joints.
    ///
    /// # Errors
    /// The firmware cannot move this leg.
    pub fn from_leg(leg: &LegFile) -> Result<[Self; JOINTS], ToolError> {
        let context = Context::<JOINTS, BASE>::new(leg, &SimulationOptions::with_seed(1))?;
        Ok(core::array::from_fn(|joint| Self {
            range: leg.joints[joint].range_deg.map(f64::to_radians),
            cap: context.configuration.joints[joint].limits().torque_cap().0.into(),
        }))
    }
}

/// State of a leg in a servo tick.
#[derive(Clone, Copy, Debug)]
pub struct LegState {
    /// Whether it follows its commands.
    pub is_enabled: bool,
    /// Code of its fault, until reset.
    pub fault: Option<u16>,
    /// Torque of each joint, N m.
    pub torque: [f64; JOINTS],
    /// Angle of each joint, anatomical, rad.
    pub position: [f64; JOINTS],
    /// Commanded speed of each joint, rad/s; zero where the leg does not show it.
    pub speed: [f32; JOINTS],
    /// Joints that return into their range.
    pub returns: [bool; JOINTS],
    /// Joints whose torque the safety monitor bounds, by range or speed.
    pub bounded: [bool; JOINTS],
    /// Whether an identification or a session of assistance moves it.
    pub moves_itself: bool,
}

impl LegState {
    /// An enabled leg that holds its pose without torque.
    pub const AT_REST: Self = Self {
        is_enabled: true,
        fault: None,
        torque: [0.0; JOINTS],
        position: [0.0; JOINTS],
        speed: [0.0; JOINTS],
        returns: [false; JOINTS],
        bounded: [false; JOINTS],
        moves_itself: false,
    };
}

/// A leg with its bus and its operator.
pub trait HostedLeg {
    /// Longest delay between a state and its record or message, ticks.
    const DELAY: u32;

    /// Multiple of its limit that a torque may reach: overshoot of a current loop.
    const OVERSHOOT: f64;

    /// Sends a host's frame.
    fn send(&mut self, frame: Frame);

    /// Sets the operator's contacts.
    fn hold(&mut self, contacts: Contacts);

    /// Connects the bus plug, or pulls it.
    fn plug(&mut self, plugged: bool);

    /// Runs a servo tick, with each frame that the leg sends. `None` before its first tick.
    ///
    /// # Errors
    /// The leg cannot be run on.
    fn tick(&mut self, heard: &mut dyn FnMut(&Frame)) -> Result<Option<LegState>, String>;
}

/// A leg, and what was seen of it.
struct Play<L> {
    leg: L,
    bounds: [JointBounds; JOINTS],
    ticks: u64,
    is_enabled: bool,
    fault: Option<u16>,
    torque: [f64; JOINTS],
    position: [f64; JOINTS],
    /// Tick of the last target, and whether one was sent since the leg was last enabled.
    target: Option<u64>,
    targets: bool,
    /// Mode last requested of each joint, and the tick until which a step of its torque is explained.
    modes: [i8; JOINTS],
    explained: [u64; JOINTS],
    /// Whether a torque or an offset was written for it since the leg was last enabled.
    pending: [bool; JOINTS],
    returns: [bool; JOINTS],
    bounded: [bool; JOINTS],
    /// Tick until which a new mode or a controlword may stop a joint.
    stops: [u64; JOINTS],
    /// Tick from which a joint must be at rest but for [`COMES_TO_REST`], and its position then.
    pose: [(u64, f64); JOINTS],
    /// Tick before the leg was enabled.
    enabled_at: u64,
    /// Least commanded speed since then, rad/s: a joint that moved only slows down.
    slows: [f32; JOINTS],
    /// Objects that each received PDO of a joint may hold, by its present mapping or an earlier one.
    maps: [[Vec<u16>; PDOS]; JOINTS],
    /// The last PDO to each joint, which the next SYNC may make effective.
    waits: [Option<usize>; JOINTS],
    /// Code that must be heard from each node, and the tick in which the leg had it.
    unheard: Option<(u16, u64)>,
    /// Code of each node's last emergency message, and its tick.
    heard: [(u16, u64); JOINTS],
    plugged: bool,
    answer: Option<[u8; 8]>,
}

impl<L: HostedLeg> Play<L> {
    fn new(leg: L, bounds: [JointBounds; JOINTS]) -> Self {
        Self {
            leg,
            bounds,
            ticks: 0,
            is_enabled: false,
            fault: None,
            torque: [0.0; JOINTS],
            position: [0.0; JOINTS],
            target: None,
            targets: false,
            modes: [0; JOINTS],
            explained: [0; JOINTS],
            pending: [false; JOINTS],
            returns: [false; JOINTS],
            bounded: [false; JOINTS],
            stops: [0; JOINTS],
            pose: [(0, 0.0); JOINTS],
            enabled_at: 0,
            slows: [f32::INFINITY; JOINTS],
            maps: core::array::from_fn(|_| [0x6040, 0x607A, 0x60FF, 0x6071].map(|index| vec![index])),
            waits: [None; JOINTS],
            unheard: None,
            heard: [(0, 0); JOINTS],
            plugged: true,
            answer: None,
        }
    }

    fn send(&mut self, id: u16, data: &[u8]) {
        self.leg.send(Frame::new(id, data));
    }

    fn hand(&mut self, enabling: bool, start: bool) {
        self.leg.hold(Contacts { enabling, start });
    }

    fn run(&mut self, ticks: u32) -> Result<(), String> {
        (0..ticks).try_for_each(|_| self.tick())
    }

    fn tick(&mut self) -> Result<(), String> {
        self.ticks += 1;
        let (heard, answer, ticks) = (&mut self.heard, &mut self.answer, self.ticks);
        let seen = self.leg.tick(&mut |frame| {
            let (id, data) = (frame.id(), frame.data());
            if (0x581..=0x582).contains(&id) {
                *answer = frame.full();
            }
            if let Some(node) = NODES.iter().position(|node| id == 0x80 + node)
                && let [low, high, _, _, _, _, _, _] = *data
            {
                heard[node] = (u16::from_le_bytes([low, high]), ticks);
            }
        })?;
        let Some(seen) = seen else { return Ok(()) };
        let was_enabled = core::mem::replace(&mut self.is_enabled, seen.is_enabled);
        self.check_joints(&seen, was_enabled)?;
        self.check_fault(seen.fault)?;
        if seen.is_enabled && !was_enabled {
            self.explain_pending(0..JOINTS);
        }
        Ok(())
    }

    fn check_joints(&mut self, seen: &LegState, was_enabled: bool) -> Result<(), String> {
        let ticks = self.ticks;
        let torque = core::mem::replace(&mut self.torque, seen.torque);
        self.position = seen.position;
        if was_enabled && !seen.is_enabled {
            // A frame that is on its way belongs to the next session.
            self.targets = self.target.is_some_and(|at| ticks - at < 4);
            self.pending = self.pending.map(|written| written && self.targets);
        }
        for joint in 0..JOINTS {
            let JointBounds { range: [low, high], cap } = self.bounds[joint];
            let (before, now, position) = (torque[joint], seen.torque[joint], seen.position[joint]);
            if now.abs() > L::OVERSHOOT * cap {
                return Err(format!("cap: joint {joint} {now} of {cap} N m"));
            }
            if !seen.is_enabled || !was_enabled {
                (self.pose[joint].0, self.enabled_at) = (ticks, ticks);
                continue;
            }
            // A joint that moves when it is enabled is braked, then slows down along its profile.
            let is_fresh = ticks < self.enabled_at + TAKES_OVER;
            if is_fresh {
                self.slows[joint] = f32::INFINITY;
            }
            let out = (low - position).max(position - high);
            if out > BEYOND {
                return Err(format!("range: joint {joint} at {position} rad"));
            }
            let (speed, returns) = (seen.speed[joint], seen.returns[joint]);
            let is_held = !self.targets && !seen.moves_itself && !returns;
            if is_held && speed.abs() > CREEP && speed.abs() > self.slows[joint] {
                return Err(format!("targets: joint {joint} commanded at {speed} rad/s"));
            }
            let (since, from) = &mut self.pose[joint];
            if !is_held {
                *since = ticks;
            }
            if ticks < *since + COMES_TO_REST {
                *from = position;
            } else if (position - *from).abs() > HELD {
                return Err(format!("targets: joint {joint} went from {from} to {position} rad"));
            }
            // A joint that returns has less torque.
            let returned = core::mem::replace(&mut self.returns[joint], returns);
            // A monitor that acts or ends takes torque away, and so does a stop of a driven joint.
            let bounded = core::mem::replace(&mut self.bounded[joint], seen.bounded[joint]);
            let takes = bounded || seen.bounded[joint] || ticks < self.stops[joint];
            let is_less = takes && now.abs() < before.abs() && now * before >= -0.01 * cap * cap;
            let explained = ticks < self.explained[joint]
                || seen.moves_itself
                || returned != returns
                || is_less
                || is_fresh;
            if (now - before).abs() > 0.1 * cap && !explained {
                return Err(format!("steps: joint {joint} from {before} to {now} N m"));
            }
            self.slows[joint] = self.slows[joint].min(speed.abs());
        }
        Ok(())
    }

    fn check_fault(&mut self, fault: Option<u16>) -> Result<(), String> {
        let before = core::mem::replace(&mut self.fault, fault);
        if let Some(fault) = fault.filter(|fault| before != Some(*fault) && self.plugged) {
            self.unheard = Some((fault, self.ticks));
        }
        let Some((code, since)) = self.unheard else { return Ok(()) };
        if self.heard.iter().all(|heard| heard.0 == code && heard.1 + u64::from(L::DELAY) >= since) {
            self.unheard = None;
        } else if self.ticks > since + HEARD {
            return Err(format!("faults: {code:04X} of tick {since}, heard {:04X?}", self.heard));
        }
        Ok(())
    }

    /// Writes an object by SDO; the answer comes within a few ticks.
    fn write(&mut self, joint: usize, (index, sub, bytes): (u16, u8, u8), value: i32) -> Result<(), String> {
        if matches!(index, 0x6040 | 0x6060) {
            self.stops = [self.ticks + TAKES_OVER; JOINTS];
        }
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
        let mut data = [0x23 | (4 - bytes) << 2, low, high, sub, a, b, c, d];
        data[4 + usize::from(bytes)..].fill(0);
        self.send(0x600 + NODES[joint], &data);
        self.run(3)
    }

    fn read(&mut self, joint: usize, index: u16) -> Result<Option<i32>, String> {
        let [low, high] = index.to_le_bytes();
        self.answer = None;
        self.send(0x600 + NODES[joint], &[0x40, low, high, 0, 0, 0, 0, 0]);
        self.run(6)?;
        let answer = self.answer.filter(|answer| answer[0] & 0xE0 == 0x40 && answer[1..3] == [low, high]);
        Ok(answer.map(|answer| i32::from_le_bytes([answer[4], answer[5], answer[6], answer[7]])))
    }

    fn word(&mut self, joint: usize, word: u16) -> Result<(), String> {
        meant(joint).try_for_each(|joint| {
            if word & 0x110 != 0 {
                self.aim();
            }
            self.write(joint, (0x6040, 0, 2), i32::from(word))
        })
    }

    fn aim(&mut self) {
        (self.target, self.targets) = (Some(self.ticks), true);
    }

    /// A new value of an object is on its way to a joint.
    fn expect(&mut self, joint: usize, index: u16) {
        self.pending[joint] |= matches!(index, 0x6071 | 0x60B1 | 0x60B2);
        if asks_for_a_step(self.modes[joint], index) {
            self.explained[joint] = self.ticks + AFTER_VALUE;
        }
    }

    /// Objects of a PDO are on their way to a joint.
    fn expect_pdo(&mut self, joint: usize, pdo: usize) {
        let objects = core::mem::take(&mut self.maps[joint][pdo]);
        objects.iter().for_each(|index| self.expect(joint, *index));
        if objects.iter().any(|index| matches!(index, 0x6040 | 0x6060)) {
            self.stops = [self.ticks + TAKES_OVER; JOINTS];
        }
        if objects.contains(&0x6060) {
            self.explained[joint] = self.ticks + AFTER_VALUE;
        }
        self.maps[joint][pdo] = objects;
    }

    /// Sends a received PDO, numbered from 1.
    fn pdo(&mut self, joint: usize, number: u16, bytes: &[u8; 8]) {
        let pdo = usize::from(number) - 1;
        // A word that begins a motion: set-point, homing, a velocity after a halt.
        let begins = bytes.windows(2).any(|word| word[0] & 0x10 != 0 || word[1] & 1 != 0);
        if begins || self.maps[joint][pdo].iter().any(|index| !matches!(index, 0x6040 | 0x6060)) {
            self.aim();
        }
        self.expect_pdo(joint, pdo);
        self.waits[joint] = Some(pdo);
        self.send(0x100 + 0x100 * number + NODES[joint], bytes);
    }

    fn map(&mut self, joint: usize, number: u16, objects: [Object; 2]) -> Result<(), String> {
        let pdo = number - 1;
        let cob = i32::from(0x100 + 0x100 * number + NODES[joint]);
        let entries = objects.map(|Object(index, sub, bytes, _)| {
            i32::from(index) << 16 | i32::from(sub) << 8 | i32::from(8 * bytes)
        });
        self.maps[joint][usize::from(pdo)].extend(objects.map(|object| object.0));
        self.write(joint, (0x1400 + pdo, 1, 4), cob | i32::MIN)?;
        self.write(joint, (0x1600 + pdo, 0, 1), 0)?;
        self.write(joint, (0x1600 + pdo, 1, 4), entries[0])?;
        self.write(joint, (0x1600 + pdo, 2, 4), entries[1])?;
        self.write(joint, (0x1600 + pdo, 0, 1), 2)?;
        self.write(joint, (0x1400 + pdo, 1, 4), cob)
    }

    /// Reads the modes of joints whose mode a PDO may have changed.
    fn learn_modes(&mut self) -> Result<(), String> {
        for joint in 0..JOINTS {
            if self.maps[joint].iter().flatten().any(|index| *index == 0x6060)
                && let Some(mode) = self.read(joint, 0x6060)?
            {
                let before = core::mem::replace(&mut self.modes[joint], mode as i8);
                if before != mode as i8 {
                    self.explain_pending(joint..joint + 1);
                }
            }
        }
        Ok(())
    }

    /// A reset is on its way: 6072 is whole again, in the ticks until the leg is stopped too.
    fn expect_defaults(&mut self) {
        (0..JOINTS).for_each(|joint| self.expect(joint, 0x6072));
    }

    /// What was written before begins to act: the leg is enabled, or the mode is new.
    fn explain_pending(&mut self, joints: impl Iterator<Item = usize>) {
        for joint in joints.filter(|joint| self.pending[*joint] && matches!(self.modes[*joint], 4 | 8..=10)) {
            self.explained[joint] = self.ticks + AFTER_VALUE;
        }
    }

    /// Compares the statuswords with the leg.
    fn words(&mut self) -> Result<(), String> {
        for joint in 0..JOINTS {
            let before = (self.is_enabled, self.fault);
            let Some(word) = self.read(joint, 0x6041)? else { continue };
            let Some(mode) = self.read(joint, 0x6061)? else { continue };
            self.run(L::DELAY)?;
            if before != (self.is_enabled, self.fault) {
                continue;
            }
            let (word, mode) = (word as u16, mode as i8);
            let powered = word & 0x806F == 0x27;
            let failed = matches!(word & 0x4F, 0x08 | 0x0F);
            let follows = powered && matches!(mode, -1 | 8..=10) && word & 0x1000 != 0;
            if powered != self.is_enabled || failed != self.fault.is_some() || follows && !self.targets {
                return Err(format!("words: joint {joint} {word:04X} in mode {mode}, {before:?}"));
            }
        }
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), String> {
        match *step {
            Step::Write(joint, Object(index, sub, bytes, is_target), value) => {
                if is_target {
                    self.aim();
                }
                self.expect(joint, index);
                self.write(joint, (index, sub, bytes), value)
            }
            Step::Word(joint, 0) => self.disable(joint),
            Step::Word(joint, word) => self.word(joint, word),
            Step::Enable => [6, 7, 0xF].into_iter().try_for_each(|word| {
                self.word(JOINTS, word)?;
                self.run(8)
            }),
            Step::Mode(joint, mode) => meant(joint).try_for_each(|joint| {
                self.modes[joint] = mode;
                self.explain_pending(joint..joint + 1);
                self.write(joint, (0x6060, 0, 1), i32::from(mode))
            }),
            Step::Near(joint, by) => self.near(joint, by),
            Step::Home(joint, offset) => self.home(joint, offset),
            Step::Pdo(joint, number, bytes) => {
                self.pdo(joint, number, &bytes);
                self.run(2)?;
                self.learn_modes()
            }
            Step::Map(joint, number, objects) => self.map(joint, number, objects),
            Step::Cycle(words, count, apart) => self.cycle(words, count, apart),
            Step::Sync(count, apart) => self.sync(count, apart),
            Step::Nmt(command, node) => self.nmt(command, node),
            Step::Lss(service, byte) => {
                self.send(0x7E5, &[service, byte, 0, 0, 0, 0, 0, 0]);
                self.run(8)
            }
            Step::Watch(joint, time) => {
                self.write(joint, (0x1016, 1, 4), 0x7F << 16 | i32::from(time))?;
                self.send(0x77F, &[5]);
                self.run(2)
            }
            Step::Contacts(enabling, start) => {
                self.hand(enabling, start);
                if start {
                    self.aim();
                }
                self.run(SERVO_RATE_HZ / 20)
            }
            Step::Plug(plugged) => {
                (self.plugged, self.unheard) = (plugged, None);
                self.leg.plug(plugged);
                self.run(8)
            }
            Step::Wait(ticks) => {
                self.run(u32::from(ticks))?;
                self.words()
            }
        }
    }

    /// Commands a joint to a place so far from its present one.
    fn near(&mut self, joint: usize, by: i32) -> Result<(), String> {
        let Some(position) = self.read(joint, 0x6064)? else { return Ok(()) };
        self.aim();
        self.expect(joint, 0x607A);
        self.write(joint, (0x607A, 0, 4), position.wrapping_add(by))
    }

    fn nmt(&mut self, command: u8, node: u8) -> Result<(), String> {
        // A node that resets or stops says nothing of an earlier fault.
        self.unheard = None;
        if command == 129 {
            self.expect_defaults();
        }
        self.send(0, &[command, node]);
        self.run(8)
    }

    /// Writes a controlword of 0; once it is confirmed, the leg is off.
    fn disable(&mut self, joint: usize) -> Result<(), String> {
        self.answer = None;
        self.word(joint, 0)?;
        self.run(TAKES_OVER as u32 + L::DELAY)?;
        let confirmed = self.answer.is_some_and(|answer| answer[..3] == [0x60, 0x40, 0x60]);
        if confirmed && self.is_enabled {
            return Err("stops: a 0 is confirmed, and the leg stays enabled".into());
        }
        Ok(())
    }

    fn home(&mut self, joint: usize, offset: i32) -> Result<(), String> {
        self.modes[joint] = 6;
        self.write(joint, (0x6060, 0, 1), 6)?;
        self.write(joint, (0x6098, 0, 1), 37)?;
        self.write(joint, (0x607C, 0, 4), offset)?;
        self.run(8)?;
        self.write(joint, (0x6040, 0, 2), 0x1F)?;
        self.write(joint, (0x6040, 0, 2), 0x0F)
    }

    fn cycle(&mut self, words: [u16; JOINTS], count: u8, apart: u8) -> Result<(), String> {
        for _ in 0..count {
            for (joint, word) in words.into_iter().enumerate() {
                let [low, high] = word.to_le_bytes();
                self.pdo(joint, 1, &[low, high, 0, 0, 0, 0, 0, 0]);
            }
            self.run(u32::from(apart))?;
        }
        self.learn_modes()
    }

    fn sync(&mut self, count: u8, apart: u8) -> Result<(), String> {
        for joint in 0..JOINTS {
            if let Some(pdo) = self.waits[joint].take() {
                self.expect_pdo(joint, pdo);
            }
        }
        for _ in 0..count {
            self.send(0x80, &[]);
            self.run(u32::from(apart))?;
        }
        self.learn_modes()
    }

    /// The enabled leg moves when a well-behaved host commands a velocity, towards the middle of its range.
    fn follows(&mut self) -> Result<(), String> {
        // A joint that moves when it is enabled first comes to rest.
        self.run(COMES_TO_REST as u32 / 2)?;
        let before = self.position;
        let sign: [i32; JOINTS] = core::array::from_fn(|joint| {
            let [low, high] = self.bounds[joint].range;
            if before[joint] < (low + high) / 2.0 { 1 } else { -1 }
        });
        for joint in 0..JOINTS {
            self.modes[joint] = 3;
            self.write(joint, (0x6060, 0, 1), 3)?;
            // Limits that another host may have saved.
            for (index, sub, value) in [
                (0x607D, 1, -TURNS),
                (0x607D, 2, TURNS),
                (0x607D, 1, -TURNS),
                (0x6081, 0, TURNS),
                (0x6083, 0, TURNS),
            ] {
                self.write(joint, (index, sub, 4), value)?;
            }
            self.expect(joint, 0x6072);
            self.write(joint, (0x6072, 0, 2), 1000)?;
            self.aim();
            self.write(joint, (0x60FF, 0, 4), FOLLOWED * sign[joint])?;
        }
        self.run(SERVO_RATE_HZ / 4)?;
        let moves = |joint: usize| f64::from(sign[joint]) * (self.position[joint] - before[joint]) > HELD;
        if self.is_enabled && !(0..JOINTS).all(moves) || !self.is_enabled && self.fault.is_none() {
            return Err(format!("again: enabled, moves from {before:?} to {:?} rad", self.position));
        }
        Ok(())
    }

    /// A well-behaved host enables the leg, or hears why it cannot.
    fn again(&mut self) -> Result<(), String> {
        self.unheard = None;
        self.plugged = true;
        self.leg.plug(true);
        self.hand(true, false);
        self.send(0x7E5, &[4, 0, 0, 0, 0, 0, 0, 0]);
        self.expect_defaults();
        self.send(0, &[129, 0]);
        self.run(SERVO_RATE_HZ * 3 / 5)?;
        self.send(0, &[1, 0]);
        self.run(40)?;
        for word in [0, 0x80, 0, 6, 7, 0xF] {
            self.word(JOINTS, word)?;
            // A reset takes 24 ms, and a brake its time.
            self.run(SERVO_RATE_HZ / 20)?;
        }
        if self.is_enabled {
            return self.follows();
        }
        let inputs = [self.read(0, 0x60FD)?, self.read(1, 0x60FD)?];
        if inputs.iter().flatten().any(|inputs| inputs & REASONS != 0) {
            return Ok(());
        }
        Err(format!("again: {:?}, 60FD {inputs:X?}", self.fault))
    }
}

/// Plays a session on a leg.
///
/// # Errors
/// What did not hold.
pub fn check_session<L: HostedLeg>(
    leg: L,
    bounds: [JointBounds; JOINTS],
    session: &HostSession,
) -> Result<(), String> {
    let mut play = Play::new(leg, bounds);
    play.send(0, &[1, 0]);
    play.run(START)?;
    session.steps.iter().try_for_each(|step| play.step(step))?;
    play.again()
}

/// Whether two complaints are of the same kind.
#[must_use]
pub fn is_like(why: &str, other: &str) -> bool {
    why.split(':').next() == other.split(':').next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_identify::formats::leg_file::DEFAULT_LEG;

    /// Tick in which a fake leg begins to err.
    const ERRS: u64 = 5000;

    type Errs = fn(&mut LegState);

    /// An enabled leg that errs from a tick on, and answers SDO requests. A velocity moves its joints.
    struct FakeLeg {
        ticks: u64,
        travel: f64,
        moves: bool,
        errs: Errs,
        answer: Option<Frame>,
    }

    impl HostedLeg for FakeLeg {
        const DELAY: u32 = 0;
        const OVERSHOOT: f64 = 1.0;

        fn send(&mut self, frame: Frame) {
            self.moves |= frame.data().starts_with(&[0x23, 0xFF, 0x60]);
            if let [service, low, high, ..] = *frame.data() {
                let value = if low == 0x41 { 0x27 } else { 0 };
                let answer = [if service == 0x40 { 0x4B } else { 0x60 }, low, high, 0, value, 0, 0, 0];
                self.answer = Some(Frame::new(frame.id() - 0x80, &answer));
            }
        }

        fn hold(&mut self, _: Contacts) {}

        fn plug(&mut self, _: bool) {}

        fn tick(&mut self, heard: &mut dyn FnMut(&Frame)) -> Result<Option<LegState>, String> {
            self.ticks += 1;
            self.answer.take().iter().for_each(heard);
            self.travel += if self.moves { 2.5e-5 } else { 0.0 };
            let position = [0.5 - self.travel, 0.5 + self.travel];
            let mut state = LegState { torque: [20.0; JOINTS], position, ..LegState::AT_REST };
            if self.ticks >= ERRS {
                (self.errs)(&mut state);
            }
            Ok(Some(state))
        }
    }

    #[test]
    fn each_check_of_a_session_can_fail() {
        let errs: [(&str, Errs); 8] = [
            ("", |_| {}),
            ("cap", |state| state.torque[1] = -1000.0),
            ("range", |state| state.position[0] = 2.0),
            ("targets", |state| state.speed[1] = 0.1),
            ("targets", |state| state.position[1] = 0.52),
            ("steps", |state| state.torque[0] = 5.0),
            ("faults", |state| state.fault = Some(0x8611)),
            ("words", |state| state.is_enabled = false),
        ];
        let leg = LegFile::load(DEFAULT_LEG).expect("a shipped leg");
        let bounds = JointBounds::from_leg(&leg).expect("a leg that can be moved");
        for (kind, errs) in errs {
            let leg = FakeLeg { ticks: 0, travel: 0.0, moves: false, errs, answer: None };
            let steps = vec![Step::Wait(4900), Step::Wait(1000)];
            let found = check_session(leg, bounds, &HostSession { by_hand: true, steps });
            assert_eq!(found.err().as_deref().unwrap_or("").split(':').next(), Some(kind));
        }
        // A leg that no stop turns off.
        let leg = FakeLeg { ticks: 0, travel: 0.0, moves: false, errs: |_| {}, answer: None };
        let found = check_session(leg, bounds, &HostSession { by_hand: true, steps: vec![Step::Word(1, 0)] });
        assert!(found.is_err_and(|why| why.starts_with("stops:")));
        // A leg that no host can enable, without a reason.
        let leg = FakeLeg {
            ticks: ERRS,
            travel: 0.0,
            moves: false,
            errs: |state| state.is_enabled = false,
            answer: None,
        };
        let found = check_session(leg, bounds, &HostSession { by_hand: true, steps: Vec::new() });
        assert!(found.is_err_and(|why| why.starts_with("again:")));
    }
}
