//! What must hold on a leg whose hosts send a random session.
//!
//! ```text
//! range     an enabled joint is in its range, or no farther out than it can be stopped
//! cap       no torque above the joint's limit
//! targets   a joint is moved only by a target that its mode needs and that a host has written to it since
//!           the leg was last disabled, moved by itself or lost its host; by bit 4 only in profile position
//! steps     no torque changes by a tenth of its limit in a tick, unless the host has just asked for it in
//!           the joint's mode (`asks_for_a_step`), or the monitor or the stop of a torque mode takes it away
//! stops     a controlword by SDO that does not ask for operation disables the leg
//! enabled   the leg is enabled by its operator, or by hosts that ask for it after it was disabled
//! silence   a leg whose host sends no SYNC any more, and synchronous PDOs in vain, is stopped
//! words     the statusword is that of the leg, bit 12 of a cyclic mode means a target of this session, and
//!           "target reached" in profile velocity that the joint has the commanded velocity
//! faults    the code of a fault is heard from both nodes, if they can send
//! reset     at the end both nodes reset when a host asks for it
//! session   settings of the next identification and assistance end with the session
//! again     at the end a well-behaved host enables and moves the leg, or a reason is stated
//! ```

use scarab::bus::Frame;
use scarab::hal::{Contacts, SERVO_RATE_HZ};
use scarab::leg::{FaultCode, NoticeCode};
use scarab::model::planar::{BASE, JOINTS};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use super::HostSession;
use super::commanded::Commanded;
use crate::options::SimulationOptions;
use crate::pair::Context;

pub(super) const NODES: [u16; JOINTS] = [1, 2];
/// How far beyond its range an enabled joint may come until the monitor has stopped it, rad.
const BEYOND: f64 = 0.1;
/// Largest motion of a joint that is held, rad, and the time after which it has come to rest, ticks.
pub(super) const HELD: f64 = 0.01;
pub(super) const COMES_TO_REST: u64 = 500 * MILLISECOND as u64;
/// Time in which a host takes over a leg that has just been enabled, or a new word or mode acts, ticks.
pub(super) const TAKES_OVER: u64 = 5 * MILLISECOND as u64;
/// Ticks until the nodes have started.
const START: u32 = 40;
/// Speed of a joint that creeps within its friction, rad/s: a joint that is held comes to rest from it.
pub(super) const CREEP: f32 = 5e-3;
pub(super) const MILLISECOND: u32 = SERVO_RATE_HZ / 1000;
/// Time in which a fault must be heard, ticks.
const HEARD: u64 = 200 * MILLISECOND as u64;
/// Longest time in which a joint slows down, ticks.
const LONGEST_STOP: u64 = 2000 * MILLISECOND as u64;
/// Emergencies of a host that is lost: heartbeat, event timer, silence, bus.
const LOST: [u16; 6] = [
    FaultCode::Heartbeat.number(),
    FaultCode::LatePdo.number(),
    FaultCode::HostSilent.number(),
    FaultCode::BusOff.number(),
    FaultCode::BusPassive.number(),
    NoticeCode::Overrun.number(),
];
/// Time after an emergency in which the next one waits, ticks.
const INHIBIT: u64 = 15 * MILLISECOND as u64;
/// Longest time for which an emergency may have waited, ticks.
const LATEST: u32 = 100 * MILLISECOND;

/// Limits of a joint.
#[derive(Clone, Copy, Debug)]
pub struct JointBounds {
    /// Ends of its range, anatomical, rad.
    pub(super) range: [f64; 2],
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
    /// Commanded speed of each joint, rad/s, if the leg shows it.
    pub speed: Option<[f32; JOINTS]>,
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
        speed: Some([0.0; JOINTS]),
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
pub(super) struct Play<L> {
    pub(crate) leg: L,
    pub(crate) bounds: [JointBounds; JOINTS],
    pub(crate) ticks: u64,
    pub is_enabled: bool,
    pub fault: Option<u16>,
    pub moves_itself: bool,
    torque: [f64; JOINTS],
    pub speed: [f32; JOINTS],
    pub position: [f64; JOINTS],
    pub(crate) commanded: [Commanded; JOINTS],
    /// Tick until which a step of each joint's torque is explained.
    pub(crate) explained: [u64; JOINTS],
    /// Whether a torque was written for it since the leg was last enabled.
    pub(crate) pending: [bool; JOINTS],
    pub returns: [bool; JOINTS],
    bounded: [bool; JOINTS],
    /// Tick until which a new mode or a controlword may stop a joint.
    pub(crate) stops: [u64; JOINTS],
    /// Tick from which a joint must be at rest but for [`COMES_TO_REST`], and its position then.
    pose: [(u64, f64); JOINTS],
    /// Tick before the leg was enabled, and how far each joint was beyond its range then, rad.
    enabled_at: u64,
    was_out: [f64; JOINTS],
    /// Tick from which a joint is held, and its least commanded speed since, rad/s: it only slows down.
    slows: [(u64, f32); JOINTS],
    /// Code that must be heard from each node, and the tick in which the leg had it.
    pub(crate) unheard: Option<(u16, u64)>,
    /// Code of each node's last emergency message, and its tick.
    pub(crate) heard: [(u16, u64); JOINTS],
    /// Tick in which each node last reported that its host is lost.
    pub(crate) lost_at: [u64; JOINTS],
    /// Tick until which the leg may be writing its flash memory.
    pub(crate) writes_flash_until: u64,
    pub(crate) plugged: bool,
    /// Whether the operator may have enabled the leg.
    pub(crate) by_hand: bool,
    is_switch_closed: bool,
    pub(crate) answer: Option<[u8; 8]>,
    /// Nodes whose boot-up message came since the last reset.
    pub(crate) has_booted: [bool; JOINTS],
}

impl<L: HostedLeg> Play<L> {
    fn new(leg: L, bounds: [JointBounds; JOINTS]) -> Self {
        Self {
            leg,
            bounds,
            ticks: 0,
            is_enabled: false,
            fault: None,
            moves_itself: false,
            torque: [0.0; JOINTS],
            speed: [0.0; JOINTS],
            position: [0.0; JOINTS],
            commanded: core::array::from_fn(|_| Commanded::new()),
            explained: [0; JOINTS],
            pending: [false; JOINTS],
            returns: [false; JOINTS],
            bounded: [false; JOINTS],
            stops: [0; JOINTS],
            pose: [(0, 0.0); JOINTS],
            enabled_at: 0,
            was_out: [0.0; JOINTS],
            slows: [(0, f32::INFINITY); JOINTS],
            unheard: None,
            heard: [(0, 0); JOINTS],
            lost_at: [0; JOINTS],
            writes_flash_until: 0,
            plugged: true,
            by_hand: false,
            is_switch_closed: true,
            answer: None,
            has_booted: [false; JOINTS],
        }
    }

    pub fn send(&mut self, id: u16, data: &[u8]) {
        self.leg.send(Frame::new(id, data));
    }

    pub(crate) fn hand(&mut self, enabling: bool, start: bool) {
        // Closing the switch enables the leg.
        self.by_hand |= enabling && !self.is_switch_closed || start;
        self.is_switch_closed = enabling;
        self.leg.hold(Contacts { enabling, start });
    }

    pub fn run(&mut self, ticks: u32) -> Result<(), String> {
        (0..ticks).try_for_each(|_| self.tick())
    }

    fn tick(&mut self) -> Result<(), String> {
        self.ticks += 1;
        let mut frames = Vec::new();
        let seen = self.leg.tick(&mut |frame| frames.push(*frame))?;
        frames.iter().for_each(|frame| self.hear(frame));
        let Some(seen) = seen else { return Ok(()) };
        let was_enabled = core::mem::replace(&mut self.is_enabled, seen.is_enabled);
        self.check_joints(&seen, was_enabled)?;
        self.check_fault(seen.fault)?;
        if seen.is_enabled && !was_enabled {
            for joint in 0..JOINTS {
                self.explain_pending(joint, self.commanded[joint].mode);
                self.commanded[joint].enable(self.ticks, L::DELAY);
            }
            let is_asked = self.commanded.iter().all(Commanded::has_asked);
            if self.ticks > START.into() && !self.by_hand && !is_asked {
                return Err("enabled: no host has asked for it".into());
            }
        }
        Ok(())
    }

    /// Handles a frame from the leg: an answer, an emergency or a boot-up message.
    fn hear(&mut self, frame: &Frame) {
        let (ticks, data) = (self.ticks, frame.data());
        let is_from = |id: u16| NODES.iter().position(|node| frame.id() == id + node);
        if is_from(0x580).is_some() {
            self.answer = frame.full();
        }
        if let (Some(node), [low, high, _, _, _, _, _, _]) = (is_from(0x80), data) {
            // An emergency that follows another one may have waited for its inhibit time.
            let delay = if self.heard[node].1 + INHIBIT < ticks { L::DELAY } else { LATEST };
            let code = u16::from_le_bytes([*low, *high]);
            self.heard[node] = (code, ticks);
            if LOST.contains(&code) {
                self.lost_at[node] = ticks;
                self.commanded[node].lose(ticks, delay);
                self.stops[node] = ticks + TAKES_OVER;
            }
        }
        if let (Some(node), [0]) = (is_from(0x700), data) {
            self.has_booted[node] = true;
            self.commanded[node].reset(ticks, L::DELAY);
        }
    }

    fn check_joints(&mut self, seen: &LegState, was_enabled: bool) -> Result<(), String> {
        let ticks = self.ticks;
        let torque = core::mem::replace(&mut self.torque, seen.torque);
        self.position = seen.position;
        let moved_itself = core::mem::replace(&mut self.moves_itself, seen.moves_itself);
        self.by_hand &= !was_enabled || seen.is_enabled;
        if was_enabled && !seen.is_enabled || moved_itself && !seen.moves_itself {
            for (commanded, pending) in self.commanded.iter_mut().zip(&mut self.pending) {
                // A frame that is on its way belongs to the next session.
                commanded.void(ticks, L::DELAY);
                *pending &= commanded.has_any();
            }
        }
        for joint in 0..JOINTS {
            let JointBounds { range: [low, high], cap } = self.bounds[joint];
            let (before, now, position) = (torque[joint], seen.torque[joint], seen.position[joint]);
            if now.abs() > L::OVERSHOOT * cap {
                return Err(format!("cap: joint {joint} {now} of {cap} N m"));
            }
            let out = (low - position).max(position - high);
            if !seen.is_enabled || !was_enabled {
                (self.pose[joint].0, self.enabled_at, self.was_out[joint]) = (ticks, ticks, out);
                continue;
            }
            let is_fresh = ticks < self.enabled_at + TAKES_OVER;
            // A joint that is enabled beyond its range returns, and goes no farther out.
            if out > BEYOND.max(self.was_out[joint] + HELD) {
                return Err(format!("range: joint {joint} at {position} rad"));
            }
            let returns = seen.returns[joint];
            let may_be_hosted = self.commanded.iter().any(|commanded| commanded.may_be_hosted);
            let is_commanded = may_be_hosted && self.commanded[joint].may_move();
            let is_held = !is_commanded && !seen.moves_itself && !returns;
            self.check_held(joint, is_held, seen)?;
            // A joint that returns has less torque.
            let returned = core::mem::replace(&mut self.returns[joint], returns);
            // A monitor that acts or ends takes torque away, and so does a stop in a torque mode: what braked
            // the joint ends, or the halt's slope is steep.
            let bounded = core::mem::replace(&mut self.bounded[joint], seen.bounded[joint]);
            let is_slower = seen.speed.is_some_and(|speed| speed[joint].abs() < self.speed[joint].abs());
            let may_be_free = self.commanded[joint].mode.is_none_or(|mode| matches!(mode, 4 | 10 | -1));
            let stops = may_be_free && (is_slower || ticks < self.stops[joint]);
            let takes = bounded || seen.bounded[joint] || stops;
            let is_less = takes && now.abs() < before.abs() && now * before >= -0.01 * cap * cap;
            let explained = ticks < self.explained[joint]
                || seen.moves_itself
                || returned != returns
                || is_less
                || is_fresh;
            if (now - before).abs() > 0.1 * cap && !explained {
                return Err(format!("steps: joint {joint} from {before} to {now} N m"));
            }
        }
        self.speed = seen.speed.unwrap_or_default();
        Ok(())
    }

    /// Whether a joint of the enabled leg is held and has come to rest.
    pub(crate) fn is_at_rest(&self, joint: usize) -> bool {
        self.is_enabled && self.ticks >= self.pose[joint].0 + COMES_TO_REST
    }

    /// A joint that is held slows down, comes to rest and stays there.
    fn check_held(&mut self, joint: usize, is_held: bool, seen: &LegState) -> Result<(), String> {
        let (ticks, position) = (self.ticks, seen.position[joint]);
        let speed = seen.speed.map(|speed| speed[joint].abs()).filter(|_| !self.commanded[joint].stays());
        let ((begins, slows), enabled) = (&mut self.slows[joint], self.enabled_at);
        if !is_held {
            *begins = ticks;
        }
        // A joint that moves is braked first.
        if ticks < enabled.max(*begins) + TAKES_OVER {
            *slows = f32::INFINITY;
        }
        if let Some(speed) = speed.filter(|speed| *speed > CREEP && *speed > *slows) {
            return Err(format!("targets: joint {joint} commanded at {speed} rad/s"));
        }
        *slows = slows.min(speed.unwrap_or(0.0));
        let is_late = ticks > enabled.max(*begins) + TAKES_OVER + LONGEST_STOP * 11 / 10;
        if is_late && speed.is_some_and(|speed| speed > CREEP) {
            return Err(format!("targets: joint {joint} does not come to rest"));
        }
        let (since, from) = &mut self.pose[joint];
        if !is_held || self.commanded[joint].may_sag || speed.is_some_and(|speed| speed > CREEP) {
            *since = ticks;
        }
        let rests = COMES_TO_REST + if seen.speed.is_none() { LONGEST_STOP } else { 0 };
        if ticks < *since + rests {
            *from = position;
        } else if (position - *from).abs() > HELD {
            return Err(format!("targets: joint {joint} went from {from} to {position} rad"));
        }
        Ok(())
    }

    fn check_fault(&mut self, fault: Option<u16>) -> Result<(), String> {
        let before = core::mem::replace(&mut self.fault, fault);
        if let Some(fault) = fault.filter(|fault| before != Some(*fault) && self.plugged) {
            self.unheard = Some((fault, self.ticks));
        }
        let Some((code, since)) = self.unheard else { return Ok(()) };
        let is_heard = |(heard, commanded): (&(u16, u64), &Commanded)| {
            commanded.may_stop || heard.0 == code && heard.1 + u64::from(L::DELAY) >= since
        };
        if self.heard.iter().zip(&self.commanded).all(is_heard) {
            self.unheard = None;
        } else if self.ticks > since + HEARD {
            return Err(format!("faults: {code:04X} of tick {since}, heard {:04X?}", self.heard));
        }
        Ok(())
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
    let mut play = Play { by_hand: session.by_hand, ..Play::new(leg, bounds) };
    play.send(0, &[1, 0]);
    play.run(START)?;
    session.steps.iter().try_for_each(|step| play.step(step))?;
    play.again()
}

/// Whether two complaints are of the same kind.
pub fn is_like(why: &str, other: &str) -> bool {
    why.split(':').next() == other.split(':').next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::random_hosts::{Object, Step};
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
        /// Value of an object that is read. With one of object 0 the leg does not reset.
        reads: fn(u16) -> u32,
        answers: Vec<Frame>,
    }

    impl HostedLeg for FakeLeg {
        const DELAY: u32 = 0;
        const OVERSHOOT: f64 = 1.0;

        fn send(&mut self, frame: Frame) {
            self.moves |= frame.data().starts_with(&[0x23, 0xFF, 0x60]);
            if frame.data().starts_with(&[129]) && (self.reads)(0) == 0 {
                self.answers = NODES.map(|node| Frame::new(0x700 + node, &[0])).into();
            }
            if let [service, low, high, sub, ..] = *frame.data() {
                let [a, b, c, d] = (self.reads)(u16::from_le_bytes([low, high])).to_le_bytes();
                let answer = [if service == 0x40 { 0x43 } else { 0x60 }, low, high, sub, a, b, c, d];
                self.answers = vec![Frame::new(frame.id() - 0x80, &answer)];
            }
        }

        fn hold(&mut self, _: Contacts) {}

        fn plug(&mut self, _: bool) {}

        fn tick(&mut self, heard: &mut dyn FnMut(&Frame)) -> Result<Option<LegState>, String> {
            self.ticks += 1;
            self.answers.drain(..).for_each(|frame| heard(&frame));
            self.travel += if self.moves { 2.5e-5 } else { 0.0 };
            let position = [0.5 - self.travel, 0.5 + self.travel];
            let mut state = LegState { torque: [20.0; JOINTS], position, ..LegState::AT_REST };
            if self.ticks >= ERRS {
                (self.errs)(&mut state);
            }
            Ok(Some(state))
        }
    }

    const ENABLED: fn(u16) -> u32 = |index| match index {
        0x6041 => 0x27,
        0x6072 => 1000,
        _ => 0,
    };

    /// Kind of complaint about these steps on such a leg.
    fn complaint(errs: Errs, reads: fn(u16) -> u32, steps: Vec<Step>, begins: u64) -> String {
        let leg = LegFile::load(DEFAULT_LEG).expect("a shipped leg");
        let bounds = JointBounds::from_leg(&leg).expect("a leg that can be moved");
        let leg = FakeLeg { ticks: begins, travel: 0.0, moves: false, errs, reads, answers: vec![] };
        let found = check_session(leg, bounds, &HostSession { by_hand: true, steps });
        found.err().as_deref().unwrap_or("").split(':').next().unwrap_or("").into()
    }

    #[test]
    fn each_check_of_a_session_can_fail() {
        let errs: [(&str, Errs); 8] = [
            ("", |_| {}),
            ("cap", |state| state.torque[1] = -1000.0),
            ("range", |state| state.position[0] = 2.0),
            ("targets", |state| state.speed = Some([0.0, 0.1])),
            ("targets", |state| state.position[1] = 0.52),
            ("steps", |state| state.torque[0] = 5.0),
            ("faults", |state| state.fault = Some(0x8611)),
            ("words", |state| state.is_enabled = false),
        ];
        for (kind, errs) in errs {
            assert_eq!(complaint(errs, ENABLED, vec![Step::Wait(4900), Step::Wait(1000)], 0), kind);
        }
        // A joint that moved goes on moving.
        let moves: Errs = |state| state.speed = Some([0.0, 0.1]);
        assert_eq!(complaint(moves, ENABLED, vec![Step::Wait(1000); 10], ERRS), "targets");
        // No stop disables the leg, and silence does not stop it.
        assert_eq!(complaint(|_| {}, ENABLED, vec![Step::Word(1, 0)], 0), "stops");
        assert_eq!(complaint(|_| {}, ENABLED, vec![Step::StopSync(10)], 0), "silence");
        // The speed is not the commanded one.
        let reaches = |index| match index {
            0x6041 => 0x427,
            0x6061 => 3,
            0x60FF | 0x607F => 500_000,
            _ => 0,
        };
        let steps = || vec![Step::Mode(0, 3), Step::Write(0, Object(0x60FF, 0, 4), 500_000), Step::Wait(10)];
        assert_eq!(complaint(|_| {}, reaches, steps(), 0), "words");
        // A setting outlives its session.
        let keeps = |index| if index == 0x2150 { 100 } else { ENABLED(index) };
        assert_eq!(complaint(|_| {}, keeps, Vec::new(), 0), "session");
        let stays = |index| if index == 0 { 1 } else { ENABLED(index) };
        assert_eq!(complaint(|_| {}, stays, Vec::new(), 0), "reset");
        // No host can enable the leg, and no reason is stated.
        assert_eq!(complaint(|state| state.is_enabled = false, ENABLED, Vec::new(), ERRS), "again");
    }
}
