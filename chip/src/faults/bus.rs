//! B1, B3, B6: a host that falls silent, hostile frames, and a host that takes over an enabled leg.

use std::rc::Rc;

use scarab::bus::Frame;
use scarab::leg::Mode;
use scarab::safety::FaultCode;
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_rig::bus::host::TARGETS;
use scarab_rig::faults::bench::hostile::{frame, malformed};

use crate::faults::{DAMP_S, Machines, Verdict, begin, jitter};
use crate::machine::Snapshot;
use crate::plant::{JOINTS, Reaction};
use crate::session::Session;
use crate::situations::{CYCLE_S, OTHER, take_over, targets};
use crate::time::{Ticks, seconds, ticks};

const NODES: [u16; JOINTS] = [1, 2];
/// Node-ID of the host, and COB-ID of its heartbeat.
const HOST: u32 = 0x70;
const HEARTBEAT: u16 = 0x770;
const SYNC: u16 = 0x80;
/// Cycles before a host may fall silent, and cycles of hostile frames.
const LEAD: u64 = 100;
const FLOOD: u32 = 100;
/// Longest time until a lost host has an effect, beyond its timeout, s.
const LATE_S: f64 = 20e-3;
/// Frames that wait for the wire while it is flooded.
const WAITING: usize = 12;
/// Largest change of a torque when a host takes over, N m: a tenth of the default leg's cap; largest motion,
/// rad; and cycles for which both are watched.
const TAKEN_NM: f64 = 8.5;
const TAKEN_RAD: f64 = 0.01;
const TAKEN: u32 = 1500;
/// Difference of a motion because frames wait for others, rad.
const OFF_RAD: f64 = 2e-3;
/// Device type of a servo drive with CiA 402's profile.
const SERVO_DRIVE: u32 = 0x0002_0192;

/// A drive that a host with the compact mapping has enabled.
pub struct Hosted {
    saved: Snapshot,
    positions: [i32; JOINTS],
}

impl Machines<'_> {
    fn hosted(&mut self) -> Result<Rc<Hosted>, ToolError> {
        if let Some(hosted) = &self.hosted {
            return Ok(Rc::clone(hosted));
        }
        let resting = self.resting()?;
        self.session.machine.restore(&resting)?;
        let positions = take_over(self.session)?;
        let hosted = Hosted { saved: self.session.machine.save()?, positions };
        Ok(Rc::clone(self.hosted.insert(Rc::new(hosted))))
    }
}

fn send(session: &mut Session, frame: Frame) {
    session.chip_mut().send_frame(frame);
}

/// Instant at which both bridges went off, of those that were on; an error if one went on again.
fn release(session: &Session) -> Result<Option<Ticks>, String> {
    let mut reaction = Reaction { armed: [true; JOINTS], ..Reaction::default() };
    reaction.follow(&session.chip().plant.switchings);
    if reaction.on_again { Err("a bridge was on again".into()) } else { Ok(reaction.released) }
}

/// Instant of the last SYNC that made targets valid, of frames in their order.
fn last_valid(heard: &[(Ticks, Frame)]) -> Ticks {
    let mut wait = false;
    heard.iter().fold(0, |last, (at, frame)| match frame.id() {
        TARGETS => {
            wait = true;
            last
        }
        SYNC if core::mem::take(&mut wait) => *at,
        _ => last,
    })
}

/// B1: heartbeat, targets or both end; targets end with their SYNC, or one of the two goes on without effect.
/// The leg is damped in time after the host's timeout, then off; the bus says why, and the host's return does
/// not enable.
pub fn lost(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let hosted = machines.hosted()?;
    let mut random = Random::new("B1", seed);
    let session = &mut *machines.session;
    begin(session, &hosted.saved, 0)?;
    let times_ms = [random.logarithmic(5.0, 200.0) as u32, random.logarithmic(4.0, 100.0) as u32];
    let silent = [[true, false], [false, true], [true, true]][seed as usize % 3];
    // Fault, or quick stop.
    let option = if random.coin() { 1 } else { 3 };
    let goes_on = [(false, false), (true, false), (false, true)][random.below(3) as usize];
    for node in NODES {
        let mut write = |index, sub, value, bytes| session.write_sized(node, index, sub, value, bytes);
        write(0x6007, 0, option, 2)?;
        write(0x1016, 1, HOST << 16 | times_ms[0], 4)?;
        write(0x1401, 5, times_ms[1], 2)?;
        write(0x2013, 0, 0, 1)?;
    }
    session.forget_frames();
    session.chip_mut().can.heard = Some(Vec::new());
    // So often that one lost heartbeat has no effect.
    let beat = u64::from(times_ms[0] * 4 / 10).max(1);
    let lead = LEAD + random.below(LEAD);
    let longest = lead + u64::from(times_ms[0].max(times_ms[1])) + ((LATE_S + DAMP_S) / CYCLE_S) as u64;
    for cycle in 0..longest {
        let speaks = silent.map(|silent| !silent || cycle < lead);
        if speaks[0] && cycle.is_multiple_of(beat) {
            send(session, Frame::new(HEARTBEAT, &[5]));
        }
        if speaks[1] || goes_on.0 {
            send(session, Frame::new(SYNC, &[]));
        }
        if speaks[1] || goes_on.1 {
            send(session, targets(hosted.positions, 0.0));
        }
        session.run(CYCLE_S)?;
    }
    let heard = session.chip_mut().can.heard.take().unwrap_or_default();
    let heartbeat = heard.iter().rev().find(|(_, frame)| frame.id() == HEARTBEAT).map_or(0, |(at, _)| *at);
    let last = [heartbeat, last_valid(&heard)];
    let due = (0..2).filter(|way| silent[*way]);
    let due = due.map(|way| last[way] + ticks(1e-3 * f64::from(times_ms[way]))).min().unwrap_or(0);
    let what = format!(
        "silent {silent:?}, SYNC and targets go on: {goes_on:?}, own times {times_ms:?} ms, 6007 = {option}"
    );
    let released = match release(session) {
        Ok(Some(released)) => released,
        Ok(None) => return Ok(Err(format!("{what}: no reaction"))),
        Err(complaint) => return Ok(Err(format!("{what}: {complaint}"))),
    };
    let after = seconds(released) - DAMP_S - seconds(due);
    if after < 0.0 {
        return Ok(Err(format!("{what}: {:.3} ms too early, or off without damping", -1e3 * after)));
    }
    let codes = [FaultCode::Heartbeat, FaultCode::LatePdo].map(FaultCode::number);
    for node in NODES {
        if !session.emergencies(node).iter().any(|code| codes.contains(code)) {
            return Ok(Err(format!("{what}: node {node} sends no emergency message")));
        }
    }
    host_returns(session, hosted.positions)?;
    Ok(release(session).map(|_| after).map_err(|complaint| format!("{what}: {complaint}")))
}

/// Brings a lost host back, which repeats its controlwords.
fn host_returns(session: &mut Session, positions: [i32; JOINTS]) -> Result<(), ToolError> {
    send(session, Frame::new(0, &[1, 0]));
    for cycle in 0..100 {
        if cycle % 10 == 0 {
            NODES.into_iter().for_each(|node| send(session, Frame::new(0x200 + node, &[15, 0])));
        }
        send(session, Frame::new(HEARTBEAT, &[5]));
        send(session, Frame::new(SYNC, &[]));
        send(session, targets(positions, 0.0));
        session.run(CYCLE_S)?;
    }
    Ok(())
}

/// B3: frames of any kind, more than the wire carries. A drive that is off stays off; a host's motion goes on
/// among malformed frames; current ticks come in time, the image does not restart, and its nodes answer.
pub fn hostile(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let resets = machines.session.resets.len();
    let findings = crate::report::findings(machines.session).0.len();
    let mut random = Random::new("B3", seed);
    let complaint = match seed % 3 {
        0 => flooded_off(machines, &mut random)?,
        1 => moved_on(machines, &mut random)?,
        _ => flooded_on(machines, &mut random)?,
    };
    if let Err(complaint) = complaint {
        return Ok(Err(complaint));
    }
    let session = &mut *machines.session;
    let delay = jitter(session);
    if session.resets.len() != resets {
        return Ok(Err(format!("the image restarted: {:?}", session.resets.last())));
    }
    if crate::report::findings(session).0.len() != findings {
        return Ok(Err("the model has new findings".into()));
    }
    if let Err(complaint) = answers(session)? {
        return Ok(Err(complaint));
    }
    Ok(delay)
}

/// Both nodes start again and answer.
fn answers(session: &mut Session) -> Result<Result<(), String>, ToolError> {
    session.chip_mut().can.partner.clear();
    session.run(5e-3)?;
    session.forget_frames();
    send(session, Frame::new(0, &[129, 0]));
    session.run(20e-3)?;
    // Hostile frames may have set other node-IDs.
    let sent = session.chip().can.sent.iter();
    let started = sent.filter(|(_, frame)| frame.id() & 0x780 == 0x700 && frame.data() == [0]);
    let nodes: Vec<u16> = started.map(|(_, frame)| frame.id() & 0x7F).collect();
    if nodes.len() != JOINTS {
        return Ok(Err(format!("of both nodes {nodes:?} start again")));
    }
    for node in nodes {
        match session.read_object(node, 0x1000, 0) {
            Ok(SERVO_DRIVE) => {}
            other => return Ok(Err(format!("node {node} answers {other:?}"))),
        }
    }
    Ok(Ok(()))
}

/// Keeps the wire full of any frames for a millisecond.
fn flood(session: &mut Session, random: &mut Random) -> Result<(), ToolError> {
    while session.chip().can.partner.len() < WAITING {
        send(session, frame(random));
    }
    session.run(CYCLE_S)
}

fn flooded_off(machines: &mut Machines<'_>, random: &mut Random) -> Result<Result<(), String>, ToolError> {
    let resting = machines.resting()?;
    let session = &mut *machines.session;
    session.machine.restore(&resting)?;
    session.hold_switch(false);
    session.run(2.0 * DAMP_S)?;
    let off = session.machine.save()?;
    begin(session, &off, random.below(ticks(10e-3)))?;
    for _ in 0..FLOOD {
        if random.below(2) == 0 {
            // In the correct order, as a real host.
            for (word, node) in [6, 7, 15].into_iter().flat_map(|word| NODES.map(|node| (word, node))) {
                send(session, Frame::new(0x200 + node, &[word, 0]));
            }
        }
        flood(session, random)?;
    }
    let is_off = session.chip().plant.switchings.is_empty();
    Ok(if is_off { Ok(()) } else { Err("a drive that was off switched".into()) })
}

fn flooded_on(machines: &mut Machines<'_>, random: &mut Random) -> Result<Result<(), String>, ToolError> {
    let hosted = machines.hosted()?;
    let session = &mut *machines.session;
    begin(session, &hosted.saved, random.below(ticks(10e-3)))?;
    for cycle in 0..FLOOD {
        send(session, Frame::new(SYNC, &[]));
        send(session, targets(hosted.positions, f64::from(cycle) * CYCLE_S));
        flood(session, random)?;
    }
    // Legal frames may have stopped the leg, and enabled it again step by step while the switch is held.
    Ok(Ok(()))
}

fn moved_on(machines: &mut Machines<'_>, random: &mut Random) -> Result<Result<(), String>, ToolError> {
    let hosted = machines.hosted()?;
    let session = &mut *machines.session;
    let delay = random.below(ticks(10e-3));
    let mut ends = [[0.0; JOINTS]; 2];
    for (end, is_hostile) in ends.iter_mut().zip([false, true]) {
        begin(session, &hosted.saved, delay)?;
        for cycle in 0..4 * FLOOD {
            send(session, Frame::new(SYNC, &[]));
            send(session, targets(hosted.positions, f64::from(cycle) * CYCLE_S));
            send(session, if is_hostile { malformed(random) } else { Frame::new(OTHER, &[0x55; 8]) });
            session.run(CYCLE_S)?;
        }
        *end = session.chip().plant.position();
    }
    let off = (0..JOINTS).map(|joint| (ends[0][joint] - ends[1][joint]).abs()).fold(0.0, f64::max);
    Ok(match release(session) {
        Ok(None) if off < OFF_RAD => Ok(()),
        Ok(None) => Err(format!("{:.2} mrad beside its motion", 1e3 * off)),
        Ok(Some(_)) => Err("malformed frames stopped the leg".into()),
        Err(complaint) => Err(complaint),
    })
}

/// B6: a host comes to a leg that its operator has enabled, commands it to stand still in one of the modes
/// (by the present torque in modes of torque), and writes its first controlword. The leg goes on holding its
/// pose.
pub fn taken_over(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let resting = machines.resting()?;
    let mut random = Random::new("B6", seed);
    let session = &mut *machines.session;
    begin(session, &resting, ticks(random.uniform(0.0, 0.5)))?;
    let mode = Mode::ALL[seed as usize % Mode::ALL.len()];
    send(session, Frame::new(0, &[1, 0]));
    session.run(0.1)?;
    for node in NODES {
        let position = session.read_object(node, 0x6064, 0)?;
        let torque = session.read_object(node, 0x6077, 0)?;
        let mut write = |index, sub, value, bytes| session.write_sized(node, index, sub, value, bytes);
        write(0x6060, 0, u32::from((mode as i8).cast_unsigned()), 1)?;
        write(0x607A, 0, position, 4)?;
        write(0x60FF, 0, 0, 4)?;
        if matches!(mode, Mode::ProfileTorque | Mode::CyclicTorque) {
            write(0x6071, 0, torque, 2)?;
        }
        write(0x2020, 1, 0xFFFF, 2)?;
        write(0x2020, 2, 0xFFFF, 2)?;
    }
    let plant = &session.chip().plant;
    let (torque, position) = (plant.torque(), plant.position());
    session.forget_frames();
    let mut codes = [const { Vec::new() }; JOINTS];
    let collect = |session: &Session, codes: &mut [Vec<u16>; JOINTS]| {
        codes.iter_mut().zip(NODES).for_each(|(codes, node)| codes.extend(session.emergencies(node)));
    };
    for node in NODES {
        session.write_sized(node, 0x6040, 0, 0xF, 2)?;
        collect(session, &mut codes);
        session.forget_frames();
    }
    for _ in 0..TAKEN {
        session.run(CYCLE_S)?;
        let plant = &session.chip().plant;
        for joint in 0..JOINTS {
            let change = plant.torque()[joint] - torque[joint];
            let moved = plant.position()[joint] - position[joint];
            if change.abs() > TAKEN_NM || moved.abs() > TAKEN_RAD {
                return Ok(Err(format!("{mode:?}, joint {joint}: {change:.1} N m, {moved:.3} rad")));
            }
        }
    }
    collect(session, &mut codes);
    for (node, codes) in NODES.into_iter().zip(codes) {
        let word = session.read_object(node, 0x6041, 0)?;
        let shown = session.read_object(node, 0x6061, 0)?;
        let is_shown = shown as u8 == (mode as i8).cast_unsigned();
        let ignores = matches!(mode as i8, -1 | 8..=10) && word & 1 << 12 == 0;
        if word & 0x806F != 0x27 || ignores || !is_shown || !codes.is_empty() {
            return Ok(Err(format!(
                "{mode:?}, node {node}: {word:04X}, 6061 {shown:X}, emergencies {codes:X?}"
            )));
        }
    }
    Ok(Ok(0.0))
}
