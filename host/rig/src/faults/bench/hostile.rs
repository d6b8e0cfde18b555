//! B3, B4: hostile frames, and a node that never stops sending.
//!
//! | row | machine | requirement |
//! | --- | --- | --- |
//! | B3 | drive off, enabling switch open | never enabled |
//! | B3 | host moves the leg, malformed frames | motion continues within 2 mrad |
//! | B3 | host moves the leg, any frames | every invariant holds; legal frames may stop the leg |
//! | B4 | leg identifies itself, started by its operator | bit for bit as on a silent bus |
//! | B4 | host moves the leg, other frames of the lowest priority | motion continues within 2 mrad |
//! | B4 | host moves the leg, other frames of the highest priority | host timeout: damped in time as in B1 |
//!
//! After B3's frames both nodes are reset and must answer. Frames are random: any identifier, length 0 to 8,
//! truncated and interleaved transfers, network management, controlwords that enable.

use scarab::bus::Frame;
use scarab::hal::{Contacts, SERVO_RATE_HZ};
use scarab::safety::FaultCode;
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::board::TICK_NS;
use crate::bus::host::Host;
use crate::faults::bench::Outcomes;
use crate::faults::bench::hosted::{Fork, forked, hosted, identifying, started};
use crate::faults::bench::lost::{until_safe, watched};
use crate::faults::catalogue::{BUS_MS, Fault};
use crate::faults::run::Outcome;

/// Servo ticks of hostile frames, and frames in each: more than the bus carries.
const FLOOD: u64 = 400;
const FRAMES: u64 = 3;
/// Servo ticks until waiting frames have been sent and the nodes are back.
const DRAINED: u64 = SERVO_RATE_HZ as u64;
/// Device type of a servo drive with CiA 402's profile.
const SERVO_DRIVE: u32 = 0x0002_0192;
/// Bus load above which the bus counts as full.
const FULL: f64 = 0.98;
/// Allowed deviation of a motion because frames wait for others, rad.
const OFF_RAD: f64 = 2e-3;

/// Draws any frame.
pub fn frame(random: &mut Random) -> Frame {
    let byte = |random: &mut Random| random.below(256) as u8;
    let mut data: [u8; 8] = core::array::from_fn(|_| byte(random));
    let node = 1 + random.below(2) as u16;
    let mut length = random.below(9) as usize;
    let id = match random.below(10) {
        // SDO request: any command for an object that may exist, often truncated.
        0..=2 => {
            let index = match random.below(4) {
                0 => 0x1000 + random.below(0x30) as u16,
                1 => [0x1400, 0x1600, 0x1800, 0x1A00][random.below(4) as usize] + random.below(4) as u16,
                2 => 0x6000 + random.below(0x100) as u16,
                _ => 0x2100 + random.below(0x50) as u16,
            };
            [data[1], data[2]] = index.to_le_bytes();
            data[3] = random.below(8) as u8;
            length = if random.below(4) == 0 { length } else { 8 };
            0x600 + node
        }
        3 | 4 => [0x200, 0x300, 0x400, 0x500][random.below(4) as usize] + node,
        5 => {
            data[0] = [1, 2, 128, 129, 130, data[0]][random.below(6) as usize];
            data[1] = [0, node as u8, data[1]][random.below(3) as usize];
            0
        }
        6 => [0x080, 0x100, 0x701, 0x702, 0x770][random.below(5) as usize],
        // Steps towards enabled.
        7 => {
            data = [[6, 7, 15, 0x80, 0x1F][random.below(5) as usize], 0, 0, 0, 0, 0, 0, 0];
            length = 2;
            0x200 + node
        }
        _ => random.below(0x800) as u16,
    };
    Frame::new(id, &data[..length])
}

/// Draws a frame without legal effect on a leg that its host moves: truncated, for missing objects or
/// transfers, or for no node.
pub fn malformed(random: &mut Random) -> Frame {
    let mut data: [u8; 8] = core::array::from_fn(|_| random.below(256) as u8);
    let node = 1 + random.below(2) as u16;
    match random.below(5) {
        // Truncated SDO request.
        0 => Frame::new(0x600 + node, &data[..random.below(8) as usize]),
        // Missing objects, and segments of transfers that were never started.
        1 | 2 => {
            let index = 0x3000 + random.below(0x2000) as u16;
            [data[1], data[2]] = index.to_le_bytes();
            Frame::new(0x600 + node, &data)
        }
        // Truncated controlwords and targets.
        3 => {
            let id = [0x200 + node, 0x301, 0x400 + node, 0x500 + node][random.below(4) as usize];
            Frame::new(id, &data[..random.below(if id == 0x301 { 4 } else { 2 }) as usize])
        }
        // Heartbeats, emergencies and answers of absent nodes; network management for others, and truncated.
        _ => match random.below(3) {
            0 => Frame::new(0x710 + random.below(0x50) as u16, &data[..random.below(9) as usize]),
            1 => Frame::new([0x090, 0x590, 0x610][random.below(3) as usize] + random.below(8) as u16, &data),
            _ => Frame::new(0, &[data[0], 0x10 | data[1] & 0x6F][..random.below(3) as usize]),
        },
    }
}

pub(super) fn flood(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let of = |way: u64| seeds.iter().copied().filter(|seed| seed % 3 == way).collect::<Vec<_>>();
    let mut base = started(leg)?;
    // Blind: the enabling switch is held.
    base.rig().hand = Contacts { enabling: blind, start: false };
    base.run(400);
    let moved = hosted(leg)?;
    let mut outcomes = forked(fault, leg, base, &of(0), |fork| flooded(fork, true))?;
    outcomes.extend(forked(fault, leg, moved.clone(), &of(1), moved_on)?);
    outcomes.extend(forked(fault, leg, moved, &of(2), |fork| flooded(fork, false))?);
    Ok(outcomes)
}

/// Checks that a leg follows its host among malformed frames.
fn moved_on(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    watched(&mut fork, [true; 2], false)?;
    let (mut alone, mut near) = (fork.host.clone(), true);
    for tick in 0..FLOOD {
        // Few enough that the host's frames and the answers still fit.
        if tick.is_multiple_of(4) {
            let frame = malformed(&mut fork.random);
            fork.host.network.send(frame);
        }
        fork.tick();
        alone.run(1);
        near &= is_near(&mut fork, &mut alone);
    }
    let unaffected = near && fork.host.is_enabled();
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    Ok(fork.ended(unaffected.then_some("-"), alarm))
}

/// Returns whether both joints are where an undisturbed run has them.
fn is_near(fork: &mut Fork<'_>, alone: &mut Host) -> bool {
    let [with, without] = [&mut fork.host, alone].map(|host| host.rig().world.anatomical_position());
    with.iter().zip(without).all(|(with, without)| (with - without).abs() < OFF_RAD)
}

fn flooded(mut fork: Fork<'_>, off: bool) -> Result<Outcome, ToolError> {
    let mut switched = false;
    for _ in 0..FLOOD {
        for _ in 0..FRAMES {
            let frame = frame(&mut fork.random);
            fork.host.network.send(frame);
        }
        if off && fork.random.below(8) == 0 {
            // In the correct order, as by a real host.
            for (node, word) in [(1, 6), (2, 6), (1, 7), (2, 7), (1, 15), (2, 15)] {
                fork.host.command(node, word);
            }
        }
        fork.tick();
        switched |= fork.host.rig().is_switching();
    }
    fork.host.speaks.set_cycle(false);
    fork.host.speaks.words = false;
    for _ in 0..DRAINED {
        if fork.host.network.waiting() == 0 {
            break;
        }
        fork.tick();
        switched |= fork.host.rig().is_switching();
    }
    fork.host.network.send(Frame::new(0, &[129, 0]));
    fork.run(40);
    let numbers = fork.host.board().nodes().each_ref().map(|node| node.id().number());
    for number in numbers {
        if fork.host.read(number.into(), 0x1000, 0).ok() != Some(SERVO_DRIVE) {
            fork.broken("a node does not answer after hostile frames");
        }
    }
    let safe = !(off && switched);
    // Hostile frames may legally stop a leg that its host moves.
    Ok(fork.ended(safe.then_some("-"), None))
}

pub(super) fn babble(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let of = |way: u64| seeds.iter().copied().filter(|seed| seed % 3 == way).collect::<Vec<_>>();
    let moved = hosted(leg)?;
    let mut outcomes = forked(fault, leg, identifying(leg)?, &of(0), beside_an_operator)?;
    outcomes.extend(forked(fault, leg, moved.clone(), &of(1), beside_a_host)?);
    outcomes.extend(forked(fault, leg, moved, &of(2), |fork| instead_of_a_host(fork, blind))?);
    Ok(outcomes)
}

/// Bus load during the flood.
fn load(fork: &mut Fork<'_>) -> f64 {
    let before_ns = fork.host.network.wire().busy_ns();
    fork.run(FLOOD);
    (fork.host.network.wire().busy_ns() - before_ns) as f64 / (FLOOD * TICK_NS) as f64
}

fn beside_an_operator(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    let mut alone = fork.host.clone();
    let babble = frame(&mut fork.random);
    fork.host.network.babble(Some(babble));
    let full = load(&mut fork) > FULL;
    alone.run(FLOOD);
    let same = fork.host.rig().hash == alone.rig().hash && full;
    Ok(fork.ended(same.then_some("-"), None))
}

fn beside_a_host(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    watched(&mut fork, [true; 2], false)?;
    let mut alone = fork.host.clone();
    let id = 0x780 + fork.random.below(0x80) as u16;
    fork.host.network.babble(Some(Frame::new(id, &[0x55; 8])));
    let full = load(&mut fork) > FULL;
    alone.run(FLOOD);
    let unaffected = is_near(&mut fork, &mut alone) && fork.host.is_enabled() && full;
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    Ok(fork.ended(unaffected.then_some("-"), alarm))
}

fn instead_of_a_host(mut fork: Fork<'_>, blind: bool) -> Result<Outcome, ToolError> {
    let patience = watched(&mut fork, [true; 2], blind)?;
    fork.host.network.babble(Some(Frame::new(1 + fork.random.below(0x7F) as u16, &[0x55; 8])));
    let (state, after_ms) = until_safe(&mut fork, |host| patience.due_ns(host));
    let in_time = after_ms.is_some_and(|after| (0.0..=BUS_MS + 1e-9).contains(&after));
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    let found = fork.ended(state, alarm);
    Ok(Outcome { detected: in_time && state == Some("Damp"), after_ms, ..found })
}
