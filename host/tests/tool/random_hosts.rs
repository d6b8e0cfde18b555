//! Hosts without manners: random sessions on the bus of a whole leg, in simulated time.
//!
//! A session is a list of steps, as several hosts may send them in turn: objects with values inside and
//! outside their ranges, controlwords in any order, modes, PDOs, SYNC, NMT, LSS, heartbeats, saving and
//! loading, homing, set-points, identification, the operator's contacts, the plug. Some hosts come to a leg
//! that the operator has enabled. After every tick:
//!
//! ```text
//! range     an enabled joint is in its range, or no farther out than it can be stopped
//! cap       no torque above the joint's limit
//! targets   no commanded motion before a target of this session: none since the leg was last enabled
//! steps     no torque grows by a tenth of its limit in a tick, unless the host has just asked for it in the
//!           joint's mode (`asks_for_a_step`), or the leg is stopped
//! words     the statusword is that of the leg, and bit 12 of a cyclic mode means a target of this session
//! faults    the code of a fault is heard from both nodes, if they can send
//! again     at the end a well-behaved host enables the leg, or a reason is stated
//! ```
//!
//! A failing session is reduced to the fewest steps. `SCARAB_SESSIONS` requests another number of sessions.

use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseError, TestRng, TestRunner};
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use scarab::bus::Frame;
use scarab::hal::{Contacts, SERVO_RATE_HZ};
use scarab::leg::{Activity, DriveState};
use scarab::model::planar::{BASE, JOINTS};
use scarab_host::formats::kept_file::memory::Memory;
use scarab_host::formats::leg_file::{DEFAULT_LEG, LegFile};
use scarab_host::rig::bus::board::{Board, Label};
use scarab_host::rig::bus::network::Network;
use scarab_host::rig::options::{DriveModel, SimulationOptions};
use scarab_host::rig::pair::Context;

const NODES: [u16; JOINTS] = [1, 2];
/// Ranges of the default leg, rad.
const RANGES: [[f64; 2]; JOINTS] = [[0.037_873, 0.875_806], [0.119_555, 1.667_313]];
/// How far beyond its range an enabled joint may come until the monitor has stopped it, rad.
const BEYOND: f64 = 0.1;
/// Bits of 60FD that say why a leg is not enabled: an inhibit reason, no zeros, no calibration, a joint that
/// is outside its range, moves, or has no reading.
const REASONS: i32 = 0x7E_0000;
/// Speed of a joint that creeps within its friction, rad/s: a joint that is held comes to rest from it.
const CREEP: f32 = 5e-3;
const MILLISECOND: u32 = SERVO_RATE_HZ / 1000;
/// Time in which a fault must be heard, ticks.
const HEARD: u64 = 200 * MILLISECOND as u64;
/// Time for which a new value explains a step of the torque, ticks: a cyclic target that has jumped is
/// interpolated over its period, and the joint then follows.
const AFTER_VALUE: u64 = 500 * MILLISECOND as u64;

/// Objects that hosts write: index, subindex, bytes, whether it is a target or offset.
const OBJECTS: [(u16, u8, u8, bool); 37] = [
    (0x6071, 0, 2, true),
    (0x607A, 0, 4, true),
    (0x60B1, 0, 4, true),
    (0x60B2, 0, 2, true),
    (0x60FF, 0, 4, true),
    (0x6072, 0, 2, true),
    (0x2020, 1, 2, true),
    (0x2020, 2, 2, true),
    (0x6007, 0, 2, false),
    (0x605A, 0, 2, false),
    (0x6065, 0, 4, false),
    (0x6066, 0, 2, false),
    (0x6067, 0, 4, false),
    (0x6068, 0, 2, false),
    (0x606D, 0, 2, false),
    (0x606F, 0, 2, false),
    (0x607C, 0, 4, false),
    (0x607D, 1, 4, true),
    (0x607D, 2, 4, true),
    (0x6081, 0, 4, false),
    (0x6083, 0, 4, false),
    (0x6084, 0, 4, false),
    (0x6087, 0, 4, false),
    (0x6098, 0, 1, false),
    (0x60C2, 1, 1, false),
    (0x60C2, 2, 1, false),
    (0x2011, 0, 1, false),
    (0x2012, 0, 1, false),
    (0x2013, 0, 1, false),
    (0x2021, 1, 2, false),
    (0x1017, 0, 2, false),
    (0x2100, 1, 1, true),
    (0x2160, 1, 1, false),
    (0x60F2, 0, 2, false),
    (0x1010, 1, 4, false),
    (0x1011, 1, 4, false),
    (0x1029, 1, 1, false),
];
/// Values that begin a storing and a loading.
const SIGNATURES: [(u16, i32); 2] = [(0x1010, 0x6576_6173), (0x1011, 0x6461_6F6C)];

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

const MODES: [i8; 9] = [0, 1, 3, 4, 6, 8, 9, 10, -1];
const WORDS: [u16; 14] = [0, 2, 6, 7, 0xB, 0xF, 0x1F, 0x3F, 0x5F, 0x7F, 0x10F, 0x11F, 0x80, 0x8F];

#[derive(Clone, Debug)]
enum Step {
    /// SDO write to a node: place in [`OBJECTS`], value.
    Write(usize, usize, i32),
    /// Controlword by SDO, to one node or both.
    Word(usize, u16),
    /// 6, 7, F to both nodes.
    Enable,
    Mode(usize, i8),
    /// Target position near the joint: micro-radian from its actual position.
    Near(usize, i32),
    /// Homing to this offset, micro-radian.
    Home(usize, i32),
    /// A received PDO, from 1, with these bytes.
    Pdo(usize, u16, [u8; 4]),
    /// SYNCs at this distance, ticks.
    Sync(u8, u8),
    Nmt(u8, u8),
    /// LSS service, with its first byte of data.
    Lss(u8, u8),
    /// A host's heartbeat, after its time in milliseconds was written to the node.
    Watch(usize, u8),
    Contacts(bool, bool),
    Plug(bool),
    Wait(u16),
}

fn value() -> impl Strategy<Value = i32> {
    prop_oneof![
        4 => -400_000..1_500_000_i32,
        3 => -300..300_i32,
        1 => any::<i32>(),
        1 => prop::sample::select(vec![0, 1, -1, i32::MIN, i32::MAX, 0x7FFF, 0xFFFF]),
    ]
}

fn step() -> impl Strategy<Value = Step> {
    let joint = 0..JOINTS;
    let any_or_both = 0..=JOINTS;
    let word = || prop_oneof![9 => prop::sample::select(WORDS.to_vec()), 1 => any::<u16>()];
    prop_oneof![
        8 => (joint.clone(), 0..OBJECTS.len(), value()).prop_map(|(joint, place, value)| Step::Write(joint, place, value)),
        5 => (any_or_both.clone(), word()).prop_map(|(joint, word)| Step::Word(joint, word)),
        3 => Just(Step::Enable),
        4 => (any_or_both, prop::sample::select(MODES.to_vec())).prop_map(|(joint, mode)| Step::Mode(joint, mode)),
        3 => (joint.clone(), -60_000..60_000_i32).prop_map(|(joint, by)| Step::Near(joint, by)),
        1 => (joint.clone(), value()).prop_map(|(joint, offset)| Step::Home(joint, offset)),
        2 => (joint.clone(), 1..5_u16, any::<[u8; 4]>()).prop_map(|(joint, pdo, bytes)| Step::Pdo(joint, pdo, bytes)),
        1 => (prop::sample::select(vec![0x04, 0x04, 0x13, 0x40, 0x46, 0x5A, 0x5E]), 0..2_u8)
            .prop_map(|(service, byte)| Step::Lss(service, byte)),
        1 => (joint, 0..250_u8).prop_map(|(joint, time)| Step::Watch(joint, time)),
        1 => (1..40_u8, 1..20_u8).prop_map(|(count, apart)| Step::Sync(count, apart)),
        1 => (prop::sample::select(vec![1, 1, 1, 2, 128, 129, 130]), 0..3_u8)
            .prop_map(|(command, node)| Step::Nmt(command, node)),
        1 => (any::<bool>(), any::<bool>()).prop_map(|(enabling, start)| Step::Contacts(enabling, start)),
        1 => any::<bool>().prop_map(Step::Plug),
        4 => (1..1200_u16).prop_map(Step::Wait),
    ]
}

/// Steps, and whether the operator's contacts have enabled the leg before.
fn session() -> impl Strategy<Value = (bool, Vec<Step>)> {
    (any::<bool>(), prop::collection::vec(step(), 1..40))
}

/// A leg on its bus, and what was seen of it.
#[derive(Clone)]
struct Bench {
    network: Network<JOINTS, BASE>,
    ticks: u64,
    state: DriveState,
    torque: [f32; JOINTS],
    /// Tick of the last target, and whether one was sent since the leg was last enabled.
    target: Option<u64>,
    targets: bool,
    /// Mode last requested of each joint, and the tick until which a step of its torque is explained.
    modes: [i8; JOINTS],
    explained: [u64; JOINTS],
    /// Whether a torque or an offset was written for it since the leg was last enabled.
    pending: [bool; JOINTS],
    returns: [bool; JOINTS],
    /// Code that must be heard from each node, and the tick in which the leg had it.
    unheard: Option<(u16, u64)>,
    /// Code of each node's last emergency message, and its tick.
    heard: [(u16, u64); JOINTS],
    plugged: bool,
    answer: Option<[u8; 8]>,
}

impl Bench {
    fn new() -> Self {
        let leg = LegFile::load(DEFAULT_LEG).expect("a shipped leg");
        let options = SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::of_seed(1) };
        let context = Context::<JOINTS, BASE>::new(&leg, &options).expect("a leg");
        let board = Board::new(&leg, context, 1, Label::SINGLE, Memory::new(None)).expect("a board");
        let mut bench = Self {
            network: Network::new(vec![board], 1_000_000),
            ticks: 0,
            state: DriveState::NotReadyToSwitchOn,
            torque: [0.0; JOINTS],
            target: None,
            targets: false,
            modes: [0; JOINTS],
            explained: [0; JOINTS],
            pending: [false; JOINTS],
            returns: [false; JOINTS],
            unheard: None,
            heard: [(0, 0); JOINTS],
            plugged: true,
            answer: None,
        };
        bench.send(0, &[1, 0]);
        bench.run(40).expect("a start without a host");
        bench
    }

    fn send(&mut self, id: u16, data: &[u8]) {
        self.network.send(Frame::new(id, data));
    }

    fn hand(&mut self, enabling: bool, start: bool) {
        self.network.boards()[0].rig.hand = Contacts { enabling, start };
    }

    /// Enables the leg by the operator's contacts.
    fn enable_by_hand(&mut self) -> Result<(), String> {
        for enabling in [false, true] {
            self.hand(enabling, false);
            self.run(SERVO_RATE_HZ / 5)?;
        }
        if self.state.is_enabled() { Ok(()) } else { Err(format!("contacts: {:?}", self.state)) }
    }

    fn run(&mut self, ticks: u32) -> Result<(), String> {
        (0..ticks).try_for_each(|_| self.tick())
    }

    fn tick(&mut self) -> Result<(), String> {
        self.ticks += 1;
        let (heard, answer, ticks) = (&mut self.heard, &mut self.answer, self.ticks);
        self.network.tick(|sent| {
            let (id, data) = (sent.frame.id(), sent.frame.data());
            if sent.sender == 0 {
                return;
            }
            if (0x581..=0x582).contains(&id) {
                *answer = sent.frame.full();
            }
            if let Some(node) = NODES.iter().position(|node| id == 0x80 + node)
                && let [low, high, _, _, _, _, _, _] = *data
            {
                heard[node] = (u16::from_le_bytes([low, high]), ticks);
            }
        });
        self.look()
    }

    fn look(&mut self) -> Result<(), String> {
        let ticks = self.ticks;
        let rig = &self.network.boards()[0].rig;
        let Some(output) = &rig.output else { return Ok(()) };
        let decision = &output.servo.decision;
        let before = core::mem::replace(&mut self.state, decision.state);
        let torque = core::mem::replace(&mut self.torque, decision.torque.map(|torque| torque.0));
        if before.is_enabled() && !decision.state.is_enabled() {
            // A frame that is on its way belongs to the next session.
            self.targets = self.target.is_some_and(|at| ticks - at < 4);
            self.pending = self.pending.map(|written| written && self.targets);
        }
        let foreign = !matches!(rig.leg.control().activity(), Activity::Idle | Activity::Follow);
        let truth = rig.world.anatomical_position();
        let limits = rig.leg.control().limits();
        for joint in 0..JOINTS {
            let cap = limits.joints()[joint].torque_cap().0;
            let now = self.torque[joint];
            if now.abs() > 1.001 * cap {
                return Err(format!("cap: joint {joint} {now} of {cap} N m"));
            }
            if !decision.state.is_enabled() || !before.is_enabled() {
                continue;
            }
            let [low, high] = RANGES[joint];
            if truth[joint] < low - BEYOND || truth[joint] > high + BEYOND {
                return Err(format!("range: joint {joint} at {} rad", truth[joint]));
            }
            let speed = output.motion.velocity_rad_per_s[joint];
            if !self.targets && !foreign && !decision.returns[joint] && speed.abs() > CREEP {
                return Err(format!("targets: joint {joint} commanded at {speed} rad/s"));
            }
            let grows =
                now.abs() - torque[joint].abs() > 0.1 * cap || now * torque[joint] < -0.01 * cap * cap;
            // A joint that returns has less torque.
            let returns = core::mem::replace(&mut self.returns[joint], decision.returns[joint]);
            let explained = ticks < self.explained[joint] || foreign || returns != decision.returns[joint];
            if grows && !explained {
                return Err(format!("steps: joint {joint} from {} to {now} N m", torque[joint]));
            }
        }
        if let Some(fault) =
            decision.state.fault().filter(|fault| before.fault() != Some(*fault) && self.plugged)
        {
            self.unheard = Some((fault.code.number(), ticks));
        }
        if self.state.is_enabled() && !before.is_enabled() {
            self.explain_pending(0..JOINTS);
        }
        let Some((code, since)) = self.unheard else { return Ok(()) };
        let is_heard = |heard: &(u16, u64)| heard.0 == code && heard.1 >= since;
        if self.heard.iter().all(is_heard) {
            self.unheard = None;
        } else if ticks > since + HEARD {
            return Err(format!("faults: {code:04X} of tick {since}, heard {:04X?}", self.heard));
        }
        Ok(())
    }

    /// Writes an object by SDO; the answer comes within a few ticks.
    fn write(&mut self, joint: usize, (index, sub, bytes): (u16, u8, u8), value: i32) -> Result<(), String> {
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
        (0..JOINTS).filter(|place| joint == JOINTS || *place == joint).try_for_each(|joint| {
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
            let before = self.state;
            let Some(word) = self.read(joint, 0x6041)? else { continue };
            if before != self.state {
                continue;
            }
            let (state, word) = (self.state, word as u16);
            let powered = word & 0x806F == 0x27;
            let failed = matches!(word & 0x4F, 0x08 | 0x0F);
            let mode = self.read(joint, 0x6061)?.unwrap_or(0) as i8;
            let follows = powered && matches!(mode, -1 | 8..=10) && word & 0x1000 != 0;
            if powered != state.is_enabled()
                || failed != state.fault().is_some()
                || follows && !self.targets && before == self.state
            {
                return Err(format!("words: joint {joint} {word:04X} in mode {mode}, {state:?}"));
            }
        }
        Ok(())
    }

    fn step(&mut self, step: &Step) -> Result<(), String> {
        match *step {
            Step::Write(joint, place, value) => {
                let (index, sub, bytes, is_target) = OBJECTS[place];
                if is_target {
                    self.aim();
                }
                self.expect(joint, index);
                let signature = SIGNATURES.iter().find(|(object, _)| *object == index && value % 2 == 0);
                self.write(joint, (index, sub, bytes), signature.map_or(value, |(_, text)| *text))
            }
            Step::Word(joint, word) => self.word(joint, word),
            Step::Enable => [6, 7, 0xF].into_iter().try_for_each(|word| {
                self.word(JOINTS, word)?;
                self.run(8)
            }),
            Step::Mode(joint, mode) => {
                (0..JOINTS).filter(|place| joint == JOINTS || *place == joint).try_for_each(|joint| {
                    self.modes[joint] = mode;
                    self.explain_pending(joint..joint + 1);
                    self.write(joint, (0x6060, 0, 1), i32::from(mode))
                })
            }
            Step::Near(joint, by) => {
                let Some(place) = self.read(joint, 0x6064)? else { return Ok(()) };
                self.aim();
                self.expect(joint, 0x607A);
                self.write(joint, (0x607A, 0, 4), place.wrapping_add(by))
            }
            Step::Home(joint, offset) => {
                self.modes[joint] = 6;
                self.write(joint, (0x6060, 0, 1), 6)?;
                self.write(joint, (0x6098, 0, 1), 37)?;
                self.write(joint, (0x607C, 0, 4), offset)?;
                self.run(8)?;
                self.write(joint, (0x6040, 0, 2), 0x1F)?;
                self.write(joint, (0x6040, 0, 2), 0x0F)
            }
            Step::Pdo(joint, number, bytes) => {
                let (index, length) =
                    [(0x6040, 2), (0x607A, 4), (0x60FF, 4), (0x6071, 2)][usize::from(number) - 1];
                self.aim();
                self.expect(joint, index);
                self.send(0x100 + 0x100 * number + NODES[joint], &bytes[..length]);
                self.run(2)
            }
            Step::Sync(count, apart) => (0..count).try_for_each(|_| {
                self.send(0x80, &[]);
                self.run(u32::from(apart))
            }),
            Step::Nmt(command, node) => {
                // A node that resets or stops says nothing of an earlier fault.
                self.unheard = None;
                if command == 129 {
                    self.expect_defaults();
                }
                self.send(0, &[command, node]);
                self.run(8)
            }
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
                self.network.set_plugged(plugged);
                self.run(8)
            }
            Step::Wait(ticks) => {
                self.run(u32::from(ticks))?;
                self.words()
            }
        }
    }

    /// A well-behaved host enables the leg, or hears why it cannot.
    fn again(&mut self) -> Result<(), String> {
        self.unheard = None;
        self.plugged = true;
        self.network.set_plugged(true);
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
        if self.state.is_enabled() {
            return Ok(());
        }
        let inputs = [self.read(0, 0x60FD)?, self.read(1, 0x60FD)?];
        if inputs.iter().flatten().any(|inputs| inputs & REASONS != 0) {
            return Ok(());
        }
        Err(format!("again: {:?}, 60FD {inputs:X?}", self.state))
    }
}

fn judge(base: &[Bench; 2], (by_hand, steps): &(bool, Vec<Step>)) -> Result<(), String> {
    let mut bench = base[usize::from(*by_hand)].clone();
    steps.iter().try_for_each(|step| bench.step(step))?;
    bench.again()
}

fn sessions(count: u32, seed: u8) {
    let mut by_hand = Bench::new();
    let base = [by_hand.clone(), {
        by_hand.enable_by_hand().expect("a leg that the contacts enable");
        by_hand
    }];
    let count = std::env::var("SCARAB_SESSIONS").ok().and_then(|text| text.parse().ok()).unwrap_or(count);
    let config =
        Config { cases: count, max_shrink_iters: 400, failure_persistence: None, ..Config::default() };
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]);
    let found = TestRunner::new_with_rng(config, rng)
        .run(&session(), |session| judge(&base, &session).map_err(TestCaseError::fail));
    if let Err(why) = found {
        panic!("{why}");
    }
}

#[test]
fn no_random_session_breaks_an_invariant() {
    sessions(200, 44);
}

#[test]
#[ignore = "campaign: .ci/full"]
fn twenty_thousand_random_sessions_break_no_invariant() {
    (45..53).into_par_iter().for_each(|seed| sessions(2_500, seed));
}
