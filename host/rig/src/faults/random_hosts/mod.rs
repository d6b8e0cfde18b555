//! Random sessions of hosts on the bus of a leg.
//!
//! A session is a list of steps, as several hosts may send them in turn: objects with values inside and
//! outside their ranges, controlwords in any order, modes, PDOs and their mapping, SYNC, NMT, LSS,
//! saving and loading, heartbeats, homing, set-points, identification, the operator's contacts, the plug.
//! [`check_session`] plays it on a leg and checks what must hold after every tick; [`HostSession::reduced`]
//! finds the steps that fail.

mod commanded;
mod play;
mod witness;

use std::fmt;

use scarab::model::planar::JOINTS;

use scarab_base::random::Random;

pub use witness::{HostedLeg, JointBounds, LegState, check_session, is_like};

/// Most steps of a session.
const MOST_STEPS: u64 = 40;

/// Object that hosts write: index, subindex, bytes.
#[derive(Clone, Copy)]
pub(super) struct Object(u16, u8, u8);

impl fmt::Debug for Object {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(text, "{:04X}:{}", self.0, self.1)
    }
}

impl Object {
    /// Values that have an effect, where few have one.
    const fn usual_values(&self) -> &'static [i32] {
        match (self.0, self.1) {
            (0x1005, _) => &[0x80, 0x190],
            // "save", "load".
            (0x1010, _) => &[0x6576_6173],
            (0x1011, _) => &[0x6461_6F6C],
            (0x1019, _) => &[0, 10],
            // By the next SYNC, and at once.
            (0x1400..=0x1403, 2) => &[1, 255],
            (0x1400..=0x1403, _) => &[0, 5, 20, 200],
            // Stop, clear. Others may restart the board.
            (0x1F51, _) => &[0, 3],
            (0x1029, _) => &[0, 1, 2],
            (0x2011..=0x2013, _) => &[0, 1],
            // The leg's own bandwidths; units of 0.01 Hz and Hz.
            (0x2021, 1) => &[0, 300, 600],
            (0x2021, _) => &[0, 500, 1000],
            (0x2100, 1) => &[0, 1, 2, 3, 4, 5],
            (0x2100, _) => &[0, 1, 2],
            (0x2150, _) => &[0, 100, 500],
            // The reference (2) believes the operator's pose.
            (0x2160, _) => &[1, 3],
            (0x6007, _) => &[0, 1, 2, 3],
            (0x605A, _) => &[0, 2],
            (0x6098, _) => &[0, 35, 37],
            (0x60C2, 1) => &[1, 2, 10],
            (0x60C2, _) => &[-3],
            (0x60F2, _) => &[0, 1, 2],
            _ => &[],
        }
    }

    /// Draws a value: one of the usual ones mostly, if there are any.
    fn draw_value(&self, random: &mut Random) -> i32 {
        let usual = self.usual_values();
        let takes_any = !matches!(self.0, 0x1F51 | 0x2160);
        if usual.is_empty() || takes_any && random.below(4) == 0 {
            value(random)
        } else {
            any_of(random, usual)
        }
    }
}

/// Objects with values inside and outside their ranges.
const OBJECTS: [Object; 56] = [
    Object(0x6071, 0, 2),
    Object(0x607A, 0, 4),
    Object(0x60B1, 0, 4),
    Object(0x60B2, 0, 2),
    Object(0x60FF, 0, 4),
    Object(0x6072, 0, 2),
    Object(0x2020, 1, 2),
    Object(0x2020, 2, 2),
    Object(0x6007, 0, 2),
    Object(0x605A, 0, 2),
    Object(0x6065, 0, 4),
    Object(0x6066, 0, 2),
    Object(0x6067, 0, 4),
    Object(0x6068, 0, 2),
    Object(0x606D, 0, 2),
    Object(0x606F, 0, 2),
    Object(0x607C, 0, 4),
    Object(0x607D, 1, 4),
    Object(0x607D, 2, 4),
    Object(0x6081, 0, 4),
    Object(0x6083, 0, 4),
    Object(0x6084, 0, 4),
    Object(0x6087, 0, 4),
    Object(0x6098, 0, 1),
    Object(0x60C2, 1, 1),
    Object(0x60C2, 2, 1),
    Object(0x2011, 0, 1),
    Object(0x2012, 0, 1),
    Object(0x2013, 0, 1),
    Object(0x2021, 1, 2),
    Object(0x1017, 0, 2),
    Object(0x2100, 1, 1),
    Object(0x2160, 1, 1),
    Object(0x60F2, 0, 2),
    Object(0x1010, 1, 4),
    Object(0x1011, 1, 4),
    Object(0x1029, 1, 1),
    Object(0x1F51, 1, 1),
    Object(0x606E, 0, 2),
    Object(0x6070, 0, 2),
    Object(0x2021, 4, 2),
    Object(0x2150, 1, 2),
    Object(0x1400, 2, 1),
    Object(0x1401, 2, 1),
    Object(0x1402, 2, 1),
    Object(0x1403, 2, 1),
    Object(0x1005, 0, 4),
    Object(0x1019, 0, 1),
    Object(0x1400, 5, 2),
    Object(0x1401, 5, 2),
    Object(0x1402, 5, 2),
    Object(0x1403, 5, 2),
    Object(0x2100, 13, 1),
    Object(0x2150, 2, 2),
    Object(0x2150, 3, 2),
    Object(0x2150, 4, 2),
];
/// Objects that hosts map into received PDOs.
const MAPPED: [Object; 10] = [
    Object(0x6040, 0, 2),
    Object(0x6060, 0, 1),
    Object(0x607A, 0, 4),
    Object(0x60FF, 0, 4),
    Object(0x6071, 0, 2),
    Object(0x6072, 0, 2),
    Object(0x60B1, 0, 4),
    Object(0x60B2, 0, 2),
    Object(0x2020, 1, 2),
    Object(0x2020, 2, 2),
];
const CONTROLWORD: Object = Object(0x6040, 0, 2);
const MODE: Object = Object(0x6060, 0, 1);
const MODES: [i8; 9] = [0, 1, 3, 4, 6, 8, 9, 10, -1];
const WORDS: [u16; 14] = [0, 2, 6, 7, 0xB, 0xF, 0x1F, 0x3F, 0x5F, 0x7F, 0x10F, 0x11F, 0x80, 0x8F];
const LSS_SERVICES: [u8; 7] = [0x04, 0x04, 0x13, 0x40, 0x46, 0x5A, 0x5E];
const NMT_COMMANDS: [u8; 7] = [1, 1, 1, 2, 128, 129, 130];
const VALUES: [i32; 7] = [0, 1, -1, i32::MIN, i32::MAX, 0x7FFF, 0xFFFF];

/// One step. A joint of [`JOINTS`] means every joint.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    /// SDO write to a node.
    Write(usize, Object, i32),
    /// Controlword by SDO.
    Word(usize, u16),
    /// 6, 7, F to both nodes.
    Enable,
    Mode(usize, i8),
    /// Target position near the joint: micro-radian from its actual position.
    Near(usize, i32),
    /// Every target names the present position, speed 0 and torque 0.
    Stay(usize),
    /// Limits that exclude a joint by this angle, micro-radian, are written while the leg is off. The leg is
    /// enabled in this mode, and every target then names the present position.
    Exclude(usize, i32, i8),
    /// Homing to this offset, micro-radian.
    Home(usize, i32),
    /// A received PDO, from 1, with these bytes.
    Pdo(usize, u16, [u8; 8]),
    /// Objects of a received PDO, from 1.
    Map(usize, u16, [Object; 2]),
    /// Controlword and mode, the mode last or first, in one received PDO, from 1, which is mapped for them.
    WordAndMode(usize, u16, u16, i8, bool),
    /// Bit 4 rises in this mode, with a target so far from the joint, micro-radian, and stays. Then the mode
    /// is profile position.
    StartElsewhere(usize, i32, i8),
    /// The first PDO to every node with a controlword for each, so many times at this distance, ticks.
    Cycle([u16; JOINTS], u8, u8),
    /// SYNCs at this distance, ticks, with a counter or without.
    Sync(u8, u8, bool),
    /// Both nodes are enabled by a host that sends its PDOs and SYNC at this distance, ticks. Then SYNC ends,
    /// and the PDOs go on.
    StopSync(u8),
    /// An enabled joint is commanded to this velocity, with this limit for profiles, micro-radian/s.
    Velocity(usize, i32, i32),
    /// A joint in cyclic velocity mode is loaded by an offset, in units of 6076, and set in motion at this
    /// speed, micro-radian/s. Then it is halted, or its mode ends.
    Load(usize, i32, i32, bool),
    /// A joint moves at this speed, micro-radian/s, or by two set-points in profile position mode. Then its
    /// host is lost, and the leg stays enabled.
    LoseHost(usize, i32, bool),
    Nmt(u8, u8),
    /// LSS service, with its first byte of data.
    Lss(u8, u8),
    /// A host's heartbeat, after its time in milliseconds was written to the node, as entry 1 or 2.
    Watch(usize, u8, u8),
    Contacts(bool, bool, u8),
    Plug(bool),
    /// Ticks without a frame, then the statuswords are compared.
    Wait(u16),
}

fn any_of<T: Copy>(random: &mut Random, values: &[T]) -> T {
    values[random.below(values.len() as u64) as usize]
}

/// Uniform integer from `low` on, below `end`.
fn between(random: &mut Random, low: i32, end: i32) -> i32 {
    low + random.below(low.abs_diff(end).into()) as i32
}

fn value(random: &mut Random) -> i32 {
    match random.below(9) {
        0..4 => between(random, -400_000, 1_500_000),
        4..7 => between(random, -300, 300),
        7 => random.below(1 << 32) as u32 as i32,
        _ => any_of(random, &VALUES),
    }
}

impl Step {
    fn draw(random: &mut Random) -> Self {
        let joint = random.below(JOINTS as u64) as usize;
        let some = random.below(JOINTS as u64 + 1) as usize;
        let byte = |random: &mut Random| random.below(256) as u8;
        match random.below(46) {
            0..8 => {
                let object = any_of(random, &OBJECTS);
                Self::Write(joint, object, object.draw_value(random))
            }
            8 => Self::Word(some, random.below(1 << 16) as u16),
            9..13 => Self::Word(some, any_of(random, &WORDS)),
            13..16 => Self::Enable,
            16..20 => Self::Mode(some, any_of(random, &MODES)),
            20..23 => Self::Near(joint, between(random, -60_000, 60_000)),
            23 => Self::Home(joint, value(random)),
            24..26 => Self::Pdo(joint, 1 + random.below(4) as u16, [(); 8].map(|()| byte(random))),
            26 => Self::Lss(any_of(random, &LSS_SERVICES), random.below(2) as u8),
            27 => Self::Watch(joint, 1 + random.below(2) as u8, random.below(250) as u8),
            28 => Self::Sync(1 + random.below(39) as u8, 1 + random.below(19) as u8, random.coin()),
            29 => Self::Nmt(any_of(random, &NMT_COMMANDS), random.below(3) as u8),
            30 => Self::Contacts(random.coin(), random.coin(), random.below(251) as u8),
            31 => Self::Plug(random.coin()),
            32 => Self::Map(joint, 1 + random.below(4) as u16, [(); 2].map(|()| any_of(random, &MAPPED))),
            33..35 => {
                let words = [(); JOINTS].map(|()| any_of(random, &WORDS));
                Self::Cycle(words, 1 + random.below(30) as u8, 1 + random.below(19) as u8)
            }
            35 => {
                let pdo = 1 + random.below(4) as u16;
                let (word, mode) = (any_of(random, &WORDS), any_of(random, &MODES));
                Self::WordAndMode(joint, pdo, word, mode, random.coin())
            }
            36 => Self::StopSync(4 + random.below(16) as u8),
            37 => Self::LoseHost(joint, between(random, -200_000, 200_000), random.coin()),
            38 => Self::Stay(joint),
            39 => {
                let by = between(random, 15_000, 80_000) * if random.coin() { 1 } else { -1 };
                Self::Exclude(joint, by, any_of(random, &[1, 3, 8, 8, 9]))
            }
            40 => Self::Velocity(
                joint,
                between(random, -1_500_000, 1_500_000),
                between(random, 100_000, 2_000_000),
            ),
            41 => Self::StartElsewhere(
                joint,
                between(random, -200_000, 200_000),
                any_of(random, &[0, 3, 4, 9, 10]),
            ),
            42 => Self::Load(
                joint,
                between(random, -800, 800),
                between(random, -300_000, 300_000),
                random.coin(),
            ),
            _ => Self::Wait(1 + random.below(1199) as u16),
        }
    }
}

/// Steps, and whether the operator's contacts have enabled the leg before.
#[derive(Clone, Debug)]
pub struct HostSession {
    /// Whether the operator's contacts have enabled the leg before.
    pub by_hand: bool,
    /// What hosts and operator do, in this order.
    pub(super) steps: Vec<Step>,
}

impl HostSession {
    /// Draws a session.
    #[must_use]
    pub fn draw(random: &mut Random) -> Self {
        let (by_hand, count) = (random.coin(), 1 + random.below(MOST_STEPS));
        Self { by_hand, steps: (0..count).map(|_| Step::draw(random)).collect() }
    }

    /// Removes the steps without which the session still fails, within a number of runs.
    pub fn reduced(mut self, most_runs: u32, mut fails: impl FnMut(&Self) -> bool) -> Self {
        let (mut length, mut runs) = (self.steps.len().div_ceil(2), 0);
        while length > 0 {
            let (mut begin, before) = (0, self.steps.len());
            while begin < self.steps.len() && runs < most_runs {
                let mut fewer = self.clone();
                fewer.steps.drain(begin..(begin + length).min(self.steps.len()));
                runs += 1;
                if fails(&fewer) {
                    self = fewer;
                } else {
                    begin += length;
                }
            }
            // Single steps again, until none can be left out.
            if length > 1 || self.steps.len() == before {
                length /= 2;
            }
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failing_session_is_reduced_to_the_steps_that_make_it_fail() {
        for seed in 0..50 {
            let mut session = HostSession::draw(&mut Random::new("reduced", seed));
            session.steps.insert(session.steps.len() / 3, Step::Home(0, 77));
            session.steps.push(Step::Home(1, 77));
            let fails = |session: &HostSession| {
                let joints: Vec<usize> = session
                    .steps
                    .iter()
                    .filter_map(|step| if let Step::Home(joint, 77) = step { Some(*joint) } else { None })
                    .collect();
                joints == [0, 1]
            };
            let reduced = session.reduced(400, fails);
            assert!(matches!(reduced.steps[..], [Step::Home(0, 77), Step::Home(1, 77)]), "{reduced:?}");
        }
    }
}
