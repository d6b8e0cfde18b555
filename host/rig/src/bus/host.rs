//! Simulated host that moves one leg, frame by frame, like a program behind an adapter.
//!
//! ```text
//! once              NMT start, compact mapping, cyclic position, controlwords 6, 7, F
//! every millisecond SYNC and one frame with both joints' targets
//! at intervals      heartbeat, and the controlword again
//! ```
//!
//! Each kind of frame can be stopped (`Speaks`).

use core::f64::consts::TAU;
use std::collections::VecDeque;
use std::time::Duration;

use scarab::bus::Frame;
use scarab::hal::SERVO_RATE_HZ;
use scarab::leg::Permission;
use scarab_base::error::ToolError;
use scarab_client::bus::{Bus, Object, Patience, RequestError};
use scarab_client::master::Client;
use scarab_client::wire::Sent;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::board::{Board, TICK_NS};
use crate::bus::network::Network;
use crate::faulty_board::Rig;
use scarab::model::planar::{BASE, JOINTS};

/// Node-IDs of hip and knee.
pub(crate) const NODES: [u16; JOINTS] = [1, 2];
/// Node-ID of the host.
const NUMBER: u16 = 0x70;
const START: u16 = 0;
const SYNC: u16 = 0x80;
/// Servo ticks per second.
pub(crate) const SECOND: u64 = SERVO_RATE_HZ as u64;
/// Object of the following window, micro-radian, and the value with which a host requests storing.
pub(crate) const WINDOW: u16 = 0x6065;
pub(crate) const SAVE: u32 = u32::from_le_bytes(*b"save");
/// COB-ID of both joints' targets; hip and knee take their half each.
pub const TARGETS: u16 = 0x301;
const WORDS: u16 = 0x200;
const HEARTBEAT: u16 = 0x700;
/// Bit 31 of a COB-ID: disabled.
const UNUSED: u32 = 1 << 31;
/// Controlword "enable operation".
const ENABLED: u16 = 0xF;
/// Longest wait for an SDO answer.
const ANSWER: Duration = Duration::from_millis(10);
/// Servo ticks per cycle.
const CYCLE: u64 = 4;
/// Motion towards the middle of each joint's range and back: amplitude in rad, rate in Hz.
const WAY_RAD: f64 = 0.25;
const RATE_HZ: f64 = 0.7;

/// Frames that the host sends by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Speaks {
    /// SYNC.
    pub(crate) sync: bool,
    /// Targets, which the next SYNC makes valid.
    pub(crate) targets: bool,
    /// Repeated controlword.
    pub(crate) words: bool,
    /// Servo ticks between two heartbeats; 0 for none.
    pub(crate) heartbeat: u64,
}

impl Speaks {
    /// Starts or stops both frames of a cycle.
    pub(crate) fn set_cycle(&mut self, sends: bool) {
        (self.sync, self.targets) = (sends, sends);
    }
}

/// Writes to a joint's object dictionary that set the compact mapping (docs/bus.md): index, subindex, value,
/// size.
pub fn compact_mapping(joint: usize) -> Vec<(u16, u8, u32, u8)> {
    let node = NODES[joint];
    let mut targets = [0x0007_0020; JOINTS];
    targets[joint] = 0x607A_0020;
    let mut writes: Vec<_> = (1..4)
        .map(|index| (0x1800 + index, 1, UNUSED | u32::from(0x180 + 0x100 * index + node), 4))
        .collect();
    let feedback = [0x6041_0010, 0x6064_0020, 0x2010_0010];
    for (index, identifier, objects) in
        [(0x1800, u32::from(0x180 + node), &feedback[..]), (0x1401, TARGETS.into(), &targets)]
    {
        let mapping = index + 0x200;
        writes.extend([(index, 1, UNUSED | identifier, 4), (mapping, 0, 0, 1), (index, 2, 1, 1)]);
        writes.extend((1..).zip(objects).map(|(sub, object)| (mapping, sub, *object, 4)));
        writes.extend([(mapping, 0, objects.len() as u32, 1), (index, 1, identifier, 4)]);
    }
    writes
}

/// One leg, one bus, one host.
#[derive(Clone, Debug)]
pub(crate) struct Host {
    /// Bus with the board.
    pub(crate) network: Network<JOINTS, BASE>,
    /// Frames sent at present.
    pub(crate) speaks: Speaks,
    /// Servo ticks per cycle.
    pub(crate) cycle: u64,
    ticks: u64,
    /// Last reported joint positions, start and amplitude of the motion, all in micro-radian.
    positions: [i32; JOINTS],
    from: Option<[f64; JOINTS]>,
    way: [f64; JOINTS],
    /// End of the last heartbeat on the wire, and of the SYNC that made the last targets valid.
    sent_ns: [u64; 2],
    /// Whether targets wait for their SYNC.
    targets_wait: bool,
    /// End of the last cyclic frame to each node on the wire that took effect: SYNC or controlword.
    cyclic_ns: [u64; JOINTS],
    /// SDO answers that were not read yet.
    answers: VecDeque<Frame>,
    /// Emergency messages: node and code.
    emergencies: Vec<(u16, u16)>,
}

fn refused(words: String) -> ToolError {
    ToolError::Refused(words)
}

impl Host {
    /// Connects to one board; nothing is sent yet.
    pub fn new(board: Board<JOINTS, BASE>) -> Self {
        Self {
            network: Network::new(vec![board], 1_000_000),
            speaks: Speaks::default(),
            ticks: 0,
            positions: [0; JOINTS],
            from: None,
            way: [0.0; JOINTS],
            cycle: CYCLE,
            sent_ns: [0; 2],
            targets_wait: false,
            cyclic_ns: [0; JOINTS],
            answers: VecDeque::new(),
            emergencies: Vec::new(),
        }
    }

    /// Returns the board.
    pub fn board(&mut self) -> &mut Board<JOINTS, BASE> {
        let [board] = self.network.boards() else { unreachable!("made with one") };
        board
    }

    /// Firmware and plant of the leg.
    pub(crate) fn rig(&mut self) -> &mut Rig<JOINTS, BASE> {
        &mut self.board().rig
    }

    /// Whether the leg's drive is enabled.
    pub(crate) fn is_enabled(&mut self) -> bool {
        self.rig().state().permission() == Permission::Follow
    }

    /// Simulates one servo tick; each of its PWM periods is shown.
    pub(crate) fn tick(&mut self, watch: impl FnMut(&Rig<JOINTS, BASE>)) {
        if self.speaks.sync && self.ticks.is_multiple_of(self.cycle) {
            self.network.send(Frame::new(SYNC, &[]));
        }
        if self.speaks.targets && self.ticks.is_multiple_of(self.cycle) {
            let seconds = self.ticks as f64 * TICK_NS as f64 * 1e-9;
            let share = 0.5 - 0.5 * (TAU * RATE_HZ * seconds).cos();
            // Until the leg is enabled, the targets are the present positions.
            let targets = match self.from {
                None => self.positions,
                Some(from) => [0, 1].map(|joint| (from[joint] + share * self.way[joint]) as i32),
            };
            let targets = targets.map(i32::to_le_bytes).concat();
            self.network.send(Frame::new(TARGETS, &targets));
        }
        if self.speaks.words && self.ticks.is_multiple_of(4 * self.cycle) {
            NODES.into_iter().for_each(|node| self.command(node, ENABLED));
        }
        if self.speaks.heartbeat > 0 && self.ticks.is_multiple_of(self.speaks.heartbeat) {
            self.network.send(Frame::new(HEARTBEAT + NUMBER, &[5]));
        }
        let (sent_ns, targets_wait) = (&mut self.sent_ns, &mut self.targets_wait);
        let (answers, cyclic_ns) = (&mut self.answers, &mut self.cyclic_ns);
        let (emergencies, positions) = (&mut self.emergencies, &mut self.positions);
        let show = |sent: &Sent| {
            let id = sent.frame.id();
            match (sent.sender, id) {
                (0, SYNC) => *cyclic_ns = [sent.end_ns; JOINTS],
                (0, 0x201) => cyclic_ns[0] = sent.end_ns,
                (0, 0x202) => cyclic_ns[1] = sent.end_ns,
                _ => {}
            }
            match (sent.sender, id) {
                (0, TARGETS) => *targets_wait = true,
                (0, SYNC) if core::mem::take(targets_wait) => sent_ns[1] = sent.end_ns,
                (0, _) if id == HEARTBEAT + NUMBER => sent_ns[0] = sent.end_ns,
                (0, _) => {}
                (_, 0x81..=0xFF) => {
                    if let [low, high, ..] = sent.frame.data() {
                        emergencies.push((id & 0x7F, u16::from_le_bytes([*low, *high])));
                    }
                }
                (_, 0x181 | 0x182) => {
                    if let ([_, _, a, b, c, d, ..], Some(position)) =
                        (sent.frame.data(), positions.get_mut(usize::from(id - 0x181)))
                    {
                        *position = i32::from_le_bytes([*a, *b, *c, *d]);
                    }
                }
                (_, 0x581..=0x5FF) => answers.push_back(sent.frame),
                _ => {}
            }
        };
        self.network.tick_watched(show, watch);
        self.ticks += 1;
    }

    /// Simulates several ticks.
    pub fn run(&mut self, ticks: u64) {
        (0..ticks).for_each(|_| self.tick(|_| {}));
    }

    /// Sends a controlword.
    pub(crate) fn command(&mut self, node: u16, word: u16) {
        self.network.send(Frame::new(WORDS + node, &word.to_le_bytes()));
    }

    /// End of the last heartbeat on the wire, and of the SYNC that made the last targets valid.
    pub(crate) fn sent_ns(&self) -> [u64; 2] {
        self.sent_ns
    }

    /// End of the last cyclic frame to each node on the wire that took effect: SYNC or controlword.
    pub(crate) fn cyclic_ns(&self) -> [u64; JOINTS] {
        self.cyclic_ns
    }

    /// Steps the motion back by `ticks`, after a pause of the host.
    pub(crate) fn rewind(&mut self, ticks: u64) {
        self.ticks -= ticks;
    }

    /// Sets the targets to the present positions from now on.
    pub(crate) fn follow_positions(&mut self) {
        self.from = None;
    }

    /// Emergency messages so far: node and code.
    pub(crate) fn emergencies(&self) -> &[(u16, u16)] {
        &self.emergencies
    }

    /// Reads an object of at most four bytes.
    ///
    /// # Errors
    /// The node does not answer, or refuses.
    pub fn read(&mut self, node: u16, index: u16, sub: u8) -> Result<u32, ToolError> {
        let (node, object) = (node as u8, Object(index, sub));
        Client::over(self).try_read(node, object).map_err(|error| error.refused(node, object))
    }

    /// Writes an object of `size` bytes.
    ///
    /// # Errors
    /// The node does not answer, or refuses.
    pub fn write(&mut self, node: u16, index: u16, sub: u8, value: u32, size: u8) -> Result<(), ToolError> {
        let (node, object) = (node as u8, Object(index, sub));
        Client::over(self).try_write(node, object, value, size).map_err(|error| error.refused(node, object))
    }

    /// Writes an object of `size` bytes without subindex to both nodes.
    ///
    /// # Errors
    /// A node does not answer, or refuses.
    pub(crate) fn write_both(&mut self, index: u16, value: u32, size: u8) -> Result<(), ToolError> {
        NODES.into_iter().try_for_each(|node| self.write(node, index, 0, value, size))
    }

    /// Starts the nodes and configures the compact mapping: statusword, position and speed; both targets in
    /// one frame.
    ///
    /// # Errors
    /// A node refuses.
    pub(crate) fn begin(&mut self) -> Result<(), ToolError> {
        self.run(4);
        self.network.send(Frame::new(START, &[1, 0]));
        self.run(4);
        for (joint, node) in NODES.into_iter().enumerate() {
            for (index, sub, value, size) in compact_mapping(joint) {
                self.write(node, index, sub, value, size)?;
            }
            self.write(node, 0x6060, 0, 8, 1)?;
        }
        Ok(())
    }

    /// Enables the leg, then moves it back and forth until the host stops sending.
    ///
    /// # Errors
    /// A node refuses, or the leg is not enabled.
    pub(crate) fn move_leg(&mut self, leg: &LegFile) -> Result<(), ToolError> {
        self.speaks.set_cycle(true);
        self.run(4 * CYCLE);
        for word in [6, 7, ENABLED] {
            NODES.into_iter().for_each(|node| self.command(node, word));
            self.run(4 * CYCLE);
        }
        let from = self.positions.map(f64::from);
        for ((way, from), joint) in self.way.iter_mut().zip(from).zip(&leg.joints) {
            let [low, high] = joint.range_deg.map(f64::to_radians);
            *way = 1e6 * WAY_RAD * (0.5e6 * (low + high) - from).signum();
        }
        (self.ticks, self.from) = (0, Some(from));
        self.speaks.words = true;
        self.run(4 * CYCLE);
        if self.is_enabled() {
            return Ok(());
        }
        let (state, causes) = (self.rig().state(), self.rig().causes());
        Err(refused(format!(
            "its host cannot enable it: {state:?}, inhibit reasons {causes:x}, emergencies {:x?}",
            self.emergencies
        )))
    }
}

impl Bus for Host {
    fn send(&mut self, frame: &Frame) -> Result<(), RequestError> {
        self.network.send(*frame);
        Ok(())
    }

    /// Receives SDO answers; emergency messages are in [`Host::emergencies`].
    fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError> {
        loop {
            if let Some(frame) = self.answers.pop_front() {
                return Ok(Some(frame));
            }
            if self.now() >= until {
                return Ok(None);
            }
            self.run(1);
        }
    }

    fn now(&self) -> Duration {
        Duration::from_nanos(self.network.now_ns())
    }

    fn patience(&self) -> Patience {
        Patience::once(ANSWER)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::board::Label;
    use crate::pair::Context;
    use crate::parameter_file::memory::Memory;
    use scarab::leg::Wearing;
    use scarab_identify::formats::leg_file::DEFAULT_LEG;

    fn host(leg: &LegFile) -> Host {
        let context = Context::<JOINTS, BASE>::with_complete_drives(leg, 1).expect("a leg");
        Host::new(Board::new(leg, context, 1, Label::SINGLE, Memory::new(None)).expect("a board"))
    }

    #[test]
    fn a_failed_store_is_reported_and_not_recalled_by_a_reset() {
        let mut host = host(&LegFile::load(DEFAULT_LEG).expect("shipped"));
        host.begin().expect("nodes that answer");
        let mut ask = |window: u32, (object, word): (u16, &[u8; 4]), fails: bool| {
            host.emergencies.clear();
            host.write(1, WINDOW, 0, window, 4).expect("a window");
            host.board().memory().fail_after(fails.then_some(1));
            host.write(2, object, 1, u32::from_le_bytes(*word), 4).expect("a drive that is off");
            host.run(8);
            while host.board().flashing().is_under_way() {
                host.run(1);
            }
            host.run(8);
            host.board().memory().fail_after(None);
            let codes: Vec<u16> = host.emergencies.iter().map(|(_, code)| *code).collect();
            host.network.send(Frame::new(START, &[129, 0]));
            host.run(40);
            (codes, host.read(1, WINDOW, 0).expect("an answer"))
        };
        let (save, load) = ((0x1010, b"save"), (0x1011, b"load"));
        let codes = |code: u16| vec![0xFF0D, 0xFF0D, code, code];
        assert_eq!(ask(11_111, save, false), (codes(0), 11_111));
        assert_eq!(ask(22_222, save, true), (codes(0x5530), 11_111));
        assert_eq!(ask(33_333, load, true), (codes(0x5530), 11_111));
        assert_eq!(ask(44_444, load, false), (codes(0), 87_266));
    }

    /// Identifies the leg as empty (1) or worn (2); afterwards the drive is off.
    fn identify(host: &mut Host, wearing: u32) {
        const LONGEST_S: u32 = 300;
        host.write(1, 0x2100, 13, wearing, 1).expect("an idle leg");
        assert!(enable(host));
        host.write(1, 0x2100, 1, 1, 1).expect("an enabled leg");
        host.run(SECOND);
        // Idle, or following the host's targets.
        let idles = |host: &mut Host| matches!(host.read(1, 0x2100, 2), Ok(0 | 9));
        let ended = (0..LONGEST_S).any(|_| {
            host.run(SECOND);
            idles(host)
        });
        let verdict = host.read(1, 0x2100, 8).expect("a verdict");
        assert!(ended && verdict == 1, "not accepted: {verdict}, {:x?}", host.emergencies);
        NODES.into_iter().for_each(|node| host.command(node, 0));
        host.run(SECOND);
        assert!(!host.is_enabled());
    }

    #[test]
    fn models_of_the_empty_and_the_worn_leg_survive_a_restart() {
        let mut host = host(&LegFile::load(DEFAULT_LEG).expect("shipped"));
        host.network.send(Frame::new(START, &[1, 0]));
        host.run(40);
        let identified = [(1, Wearing::Empty), (2, Wearing::Worn)].map(|(value, wearing)| {
            identify(&mut host, value);
            *host.rig().leg.control().model_of(wearing).expect("accepted")
        });
        assert_ne!(identified[0], identified[1]);
        host.write(1, 0x1010, 1, u32::from_le_bytes(*b"save"), 4).expect("a drive that is off");
        host.run(8);
        while host.board().flashing().is_under_way() {
            host.run(1);
        }
        host.board().power_on();
        host.run(40);
        assert_eq!(host.read(1, 0x2100, 7).expect("a counter"), 2);
        let control = host.rig().leg.control();
        let restored = [Wearing::Empty, Wearing::Worn].map(|wearing| control.model_of(wearing).copied());
        assert_eq!(restored, identified.map(Some));
        assert_eq!(control.model(), Some(&identified[0]), "the feedforward");
    }

    #[test]
    fn a_host_moves_a_leg_and_the_leg_stays_when_it_stops() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let mut host = host(&leg);
        host.begin().expect("nodes that answer");
        host.move_leg(&leg).expect("a leg that follows");
        let position = |host: &mut Host| host.rig().world.anatomical_position();
        let from = position(&mut host);
        host.run(2857 - host.ticks);
        let there = position(&mut host);
        for (joint, (from, there)) in from.iter().zip(there).enumerate() {
            assert!((there - from).abs() > 0.9 * WAY_RAD, "joint {joint}: {from} {there}");
        }
        host.speaks.set_cycle(false);
        host.run(1000);
        let stands = position(&mut host);
        assert!(host.is_enabled());
        assert!(there.iter().zip(stands).all(|(there, stands)| (there - stands).abs() < 0.02));
    }

    /// Steps of a usual host towards enabled. Returns whether the leg is enabled.
    fn enable(host: &mut Host) -> bool {
        for word in [6, 7, ENABLED] {
            NODES.into_iter().for_each(|node| host.command(node, word));
            host.run(40);
        }
        host.is_enabled()
    }

    /// Sends each joint a set-point (micro-radian) in profile position mode.
    fn point(host: &mut Host, targets: [i32; JOINTS]) {
        for (node, target) in NODES.into_iter().zip(targets) {
            host.write(node, 0x607A, 0, target as u32, 4).expect("a target");
            host.command(node, ENABLED);
            host.command(node, ENABLED | 0x30);
        }
    }

    /// Enables the leg as soon as it has stopped swinging.
    fn enable_at_rest(host: &mut Host, words: &str) {
        for tries in 0.. {
            if enable(host) {
                break;
            }
            // A refused enable is explained by FF0E and ends when the leg stops swinging.
            let code = host.read(1, 0x603F, 0).expect("an error code");
            assert_eq!(code, 0xFF0E, "{words}: {:?} {:x?}", host.rig().state(), host.emergencies);
            assert!(host.emergencies.contains(&(1, 0xFF0E)), "{words}: {:x?}", host.emergencies);
            assert!(tries < 20, "{words}: {:x?}", host.emergencies);
            host.run(SECOND / 4);
        }
    }

    /// Moves to random poses; returns how many of them ended outside a joint's range.
    fn poses(leg: &LegFile, seed: u64, count: u32) -> u32 {
        let mut random = scarab_base::random::Random::new("poses", seed);
        let ranges = leg.joints.iter().map(|joint| joint.range_deg.map(f64::to_radians)).collect::<Vec<_>>();
        let micro = |joint: usize, share: f64| {
            let [low, high] = ranges[joint];
            (1e6 * (low + share * (high - low))) as i32
        };
        let mut host = host(leg);
        host.begin().expect("nodes that answer");
        for node in NODES {
            for (object, value, size) in
                [(0x6060, 1, 1), (0x6081, 1_500_000, 4), (0x6083, 8_000_000, 4), (0x6084, 8_000_000, 4)]
            {
                host.write(node, object, 0, value, size).expect("a setting");
            }
        }
        let mut fallen = 0;
        for pose in 0..count {
            let words = format!("seed {seed}, pose {pose}");
            // Earlier errors must not be taken for the reason of a refusal.
            NODES.into_iter().for_each(|node| host.write(node, 0x1003, 0, 0, 1).expect("a history"));
            host.emergencies.clear();
            enable_at_rest(&mut host, &words);
            let outside = |host: &mut Host| {
                let positions = host.rig().world.anatomical_position();
                (0..JOINTS).any(|joint| {
                    let [low, high] = ranges[joint];
                    positions[joint] < low - 0.0088 || positions[joint] > high + 0.0088
                })
            };
            fallen += u32::from(outside(&mut host));
            point(&mut host, [micro(0, 0.4), micro(1, 0.4)]);
            host.run(4 * SECOND);
            assert!(
                host.is_enabled() && !outside(&mut host),
                "{words}: {:?} {:x?}",
                host.rig().state(),
                host.emergencies
            );
            let positions = [0, 1].map(|joint| micro(joint, random.uniform(0.02, 0.98)));
            point(&mut host, positions);
            host.run(1 + random.below(5 * SECOND / 4));
            let stop = if random.coin() { 0 } else { 2 };
            NODES.into_iter().for_each(|node| host.command(node, stop));
            host.run(SECOND);
            if random.coin() {
                // The wearer sits down: a joint is pushed against its lower end stop.
                let (joint, torque) = (random.below(2) as usize, random.uniform(30.0, 90.0));
                host.rig().world.push(joint, -torque, 0.6);
            }
            host.run(2 * SECOND);
            assert!(!host.is_enabled());
        }
        fallen
    }

    #[test]
    fn a_host_can_enable_the_leg_again_after_each_of_eight_poses() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        // Legs must fall out of their range for the test to be valid.
        assert!(poses(&leg, 1, 8) >= 1);
    }

    #[test]
    #[ignore = "campaign: .ci/full"]
    fn a_host_can_enable_the_leg_again_after_each_of_100_poses() {
        use rayon::prelude::*;
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let fallen: u32 = (1..=4_u64).into_par_iter().map(|seed| poses(&leg, seed, 25)).sum();
        assert!(fallen >= 20, "{fallen}");
    }
}
