//! B3, B4: frames that nobody should send, and a node that never stops sending.
//!
//! | row | machine | what has to follow |
//! | --- | --- | --- |
//! | B3 | a leg that is off, its enabling switch open | nothing is ever enabled |
//! | B3 | a leg that its host moves, frames that are all malformed | moved on, at most 2 mrad from where it would have been |
//! | B3 | a leg that its host moves, any frames | every invariant holds: what is legal may stop it |
//! | B4 | a leg that identifies itself in its operator's hand | the same bit for bit as on a bus that is still |
//! | B4 | a leg that its host moves, others' frames of the lowest priority | moved on, at most 2 mrad from where it would have been |
//! | B4 | the same, of the highest priority: the host is not heard any more | damped as by a host that is lost (B1), in its time |
//!
//! After B3's frames both nodes are reset and have to answer. Frames are drawn: any identifier, length 0 to 8, transfers that are cut and
//! mixed with others, network management, controlwords that enable.

use scarab::bus::Frame;
use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::entry::Head;
use super::super::run::Outcome;
use super::Bench;
use super::hosted::{Fork, forked, hosted, identifying, started};
use super::lost::{until_safe, watched};
use crate::tool::bus::board::TICK_NS;
use crate::tool::bus::host::Host;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use scarab::hal::Contacts;

/// Servo ticks of hostile frames, and frames in each: more than the wire carries.
const FLOOD: u64 = 400;
const FRAMES: u64 = 3;
/// Until what waits has been sent, and nodes are there again.
const DRAINED: u64 = 4000;
/// Device type of a servo drive with CiA 402's profile.
const SERVO_DRIVE: u32 = 0x0002_0192;
/// A wire with less than this share is not full.
const FULL: f64 = 0.98;
/// What a motion may be off by for frames that wait for others, rad.
const OFF_RAD: f64 = 2e-3;

pub(super) const FRAMES_BENCH: Bench = Bench {
    head: Head {
        id: "B3",
        fault: "malformed and hostile frames, transfers cut and mixed",
        detector: "lengths, ranges, states; the operator's switch",
        state: "-",
        deadline_ms: f64::INFINITY,
        unit: "",
        codes: &[],
        lacking: None,
    },
    run: flood,
};

pub(super) const BABBLE: Bench = Bench {
    head: Head {
        id: "B4",
        fault: "a node that babbles, wire at 100 %",
        detector: "the bus stands below the servo; a host that is not heard is lost",
        state: "-",
        deadline_ms: f64::INFINITY,
        unit: "",
        codes: &[FaultCode::Heartbeat, FaultCode::LatePdo],
        lacking: None,
    },
    run: babble,
};

/// Any frame.
fn frame(dice: &mut Dice) -> Frame {
    let byte = |dice: &mut Dice| dice.below(256) as u8;
    let mut data: [u8; 8] = core::array::from_fn(|_| byte(dice));
    let node = 1 + dice.below(2) as u16;
    let mut length = dice.below(9) as usize;
    let id = match dice.below(10) {
        // A request of the dictionary: any command of an object that may be there; often cut short.
        0..=2 => {
            let index = match dice.below(4) {
                0 => 0x1000 + dice.below(0x30) as u16,
                1 => [0x1400, 0x1600, 0x1800, 0x1A00][dice.below(4) as usize] + dice.below(4) as u16,
                2 => 0x6000 + dice.below(0x100) as u16,
                _ => 0x2100 + dice.below(0x50) as u16,
            };
            [data[1], data[2]] = index.to_le_bytes();
            data[3] = dice.below(8) as u8;
            length = if dice.below(4) == 0 { length } else { 8 };
            0x600 + node
        }
        3 | 4 => [0x200, 0x300, 0x400, 0x500][dice.below(4) as usize] + node,
        5 => {
            data[0] = [1, 2, 128, 129, 130, data[0]][dice.below(6) as usize];
            data[1] = [0, node as u8, data[1]][dice.below(3) as usize];
            0
        }
        6 => [0x080, 0x100, 0x701, 0x702, 0x770][dice.below(5) as usize],
        // The way to enabled, step by step.
        7 => {
            data = [[6, 7, 15, 0x80, 0x1F][dice.below(5) as usize], 0, 0, 0, 0, 0, 0, 0];
            length = 2;
            0x200 + node
        }
        _ => dice.below(0x800) as u16,
    };
    Frame::new(id, &data[..length])
}

/// A frame that says nothing legal to a leg that its host moves: cut short, of objects or transfers that are not there, or of nobody.
fn malformed(dice: &mut Dice) -> Frame {
    let mut data: [u8; 8] = core::array::from_fn(|_| dice.below(256) as u8);
    let node = 1 + dice.below(2) as u16;
    match dice.below(5) {
        // A request of the dictionary that is cut short.
        0 => Frame::new(0x600 + node, &data[..dice.below(8) as usize]),
        // Objects that are not there, and pieces of transfers that nobody began.
        1 | 2 => {
            let index = 0x3000 + dice.below(0x2000) as u16;
            [data[1], data[2]] = index.to_le_bytes();
            Frame::new(0x600 + node, &data)
        }
        // Controlword and targets without all of their bytes.
        3 => {
            let id = [0x200 + node, 0x301, 0x400 + node, 0x500 + node][dice.below(4) as usize];
            Frame::new(id, &data[..dice.below(if id == 0x301 { 4 } else { 2 }) as usize])
        }
        // Heartbeats, emergencies and answers of nodes that are not there; network management of others, and cut short.
        _ => match dice.below(3) {
            0 => Frame::new(0x710 + dice.below(0x50) as u16, &data[..dice.below(9) as usize]),
            1 => Frame::new([0x090, 0x590, 0x610][dice.below(3) as usize] + dice.below(8) as u16, &data),
            _ => Frame::new(0, &[data[0], 0x10 | data[1] & 0x6F][..dice.below(3) as usize]),
        },
    }
}

fn flood(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let of = |way: u64| seeds.iter().copied().filter(|seed| seed % 3 == way).collect::<Vec<_>>();
    let mut base = started(leg)?;
    // Blind, the operator's hand permits what frames ask for.
    base.rig().hand = Contacts { enabling: blind, start: false };
    base.run(400);
    let moved = hosted(leg)?;
    let mut outcomes = forked(head, leg, base, &of(0), |fork| flooded(fork, true))?;
    outcomes.extend(forked(head, leg, moved.clone(), &of(1), moved_on)?);
    outcomes.extend(forked(head, leg, moved, &of(2), |fork| flooded(fork, false))?);
    Ok(outcomes)
}

/// Among frames that are malformed a leg goes on as its host says.
fn moved_on(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    watched(&mut fork, [true; 2], false)?;
    let (mut alone, mut near) = (fork.host.clone(), true);
    for tick in 0..FLOOD {
        // As many as leave room for the host's own and for the answers.
        if tick.is_multiple_of(4) {
            let frame = malformed(&mut fork.dice);
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

/// Both joints stand where they would have stood.
fn is_near(fork: &mut Fork<'_>, alone: &mut Host) -> bool {
    let [with, without] = [&mut fork.host, alone].map(|host| host.rig().world.anatomical_position());
    with.iter().zip(without).all(|(with, without)| (with - without).abs() < OFF_RAD)
}

fn flooded(mut fork: Fork<'_>, off: bool) -> Result<Outcome, ToolError> {
    let mut switched = false;
    for _ in 0..FLOOD {
        for _ in 0..FRAMES {
            let frame = frame(&mut fork.dice);
            fork.host.network.send(frame);
        }
        if off && fork.dice.below(8) == 0 {
            // In the right order, as a host that means it.
            for (node, word) in [(1, 6), (2, 6), (1, 7), (2, 7), (1, 15), (2, 15)] {
                fork.host.command(node, word);
            }
        }
        fork.tick();
        switched |= fork.host.rig().is_switching();
    }
    fork.host.speaks.targets = false;
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
    // What stops a leg that its host moves is the frames' own to choose.
    Ok(fork.ended(safe.then_some("-"), None))
}

fn babble(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let of = |way: u64| seeds.iter().copied().filter(|seed| seed % 3 == way).collect::<Vec<_>>();
    let moved = hosted(leg)?;
    let mut outcomes = forked(head, leg, identifying(leg)?, &of(0), beside_an_operator)?;
    outcomes.extend(forked(head, leg, moved.clone(), &of(1), beside_a_host)?);
    outcomes.extend(forked(head, leg, moved, &of(2), |fork| instead_of_a_host(fork, blind))?);
    Ok(outcomes)
}

/// Share of the wire that is taken while the flood lasts.
fn load(fork: &mut Fork<'_>) -> f64 {
    let before_ns = fork.host.network.wire().busy_ns();
    fork.run(FLOOD);
    (fork.host.network.wire().busy_ns() - before_ns) as f64 / (FLOOD * TICK_NS) as f64
}

fn beside_an_operator(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    let mut alone = fork.host.clone();
    let babble = frame(&mut fork.dice);
    fork.host.network.babble(Some(babble));
    let full = load(&mut fork) > FULL;
    alone.run(FLOOD);
    let same = fork.host.rig().hash == alone.rig().hash && full;
    Ok(fork.ended(same.then_some("-"), None))
}

fn beside_a_host(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    watched(&mut fork, [true; 2], false)?;
    let mut alone = fork.host.clone();
    let id = 0x780 + fork.dice.below(0x80) as u16;
    fork.host.network.babble(Some(Frame::new(id, &[0x55; 8])));
    let full = load(&mut fork) > FULL;
    alone.run(FLOOD);
    let unaffected = is_near(&mut fork, &mut alone) && fork.host.is_enabled() && full;
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    Ok(fork.ended(unaffected.then_some("-"), alarm))
}

fn instead_of_a_host(mut fork: Fork<'_>, blind: bool) -> Result<Outcome, ToolError> {
    let patience = watched(&mut fork, [true; 2], blind)?;
    fork.host.network.babble(Some(Frame::new(1 + fork.dice.below(0x7F) as u16, &[0x55; 8])));
    let (state, after_ms) = until_safe(&mut fork, &patience);
    let in_time = after_ms.is_some_and(|after| (0.0..=super::lost::BUS_MS + 1e-9).contains(&after));
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    let found = fork.ended(state, alarm);
    Ok(Outcome { detected: in_time && state == Some("Damp"), after_ms, ..found })
}
