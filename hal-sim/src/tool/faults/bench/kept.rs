//! F1, F2, F3: what is kept over the power, when the power fails in the midst of it, when it rots, and when somebody wants to keep something
//! of a leg that moves.
//!
//! | row | what | what has to follow |
//! | --- | --- | --- |
//! | F1 | the power fails at any byte that is programmed or erased while both nodes' objects and a model are kept; one time in four again while the next boot mends that | each record is the old or the new one, no later one is new where an earlier is old, and the next save succeeds |
//! | F2 | bits flip, a stretch is overwritten, another leg's model, everything gone | each node has the newest of its records that is whole, or all as after the start; so has the leg its model, if it is its own; what cannot be read and what is another's is told (5530) |
//! | F3 | "save" while the drive is on | refused (0800 0022), not a byte of the flash changes, the leg moves on |
//! | F3 | "save" while it is off (`stall.rs`) | the processor stands meanwhile, and nobody takes it for a fault |
//!
//! Flashes of F1 were filled before, to all levels up to where a sector has to be erased for the next record.

use embassy_futures::block_on;
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use scarab::bus::{LONGEST, kept_entries};
use scarab::leg::{ControlRequest, DriveState, IdentifiedModel, NoticeCode};
use scarab::store::{KeptModel, Key};

use super::super::campaign::BASE;
use super::super::catalogue::JOINTS;
use super::super::dice::Dice;
use super::super::entry::Head;
use super::super::run::Outcome;
use super::hosted::{Fork, board, forked, hosted};
use super::stall::stall;
use super::{Bench, outcome};
use crate::tool::bus::board::Board;
use crate::tool::bus::host::Host;
use crate::tool::bus::memory::Memory;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::pair::{Context, Pair};
use crate::tool::setup::SetupError;
use crate::tool::simulate::SimulationOptions;

/// No identification takes longer, servo ticks.
const LONGEST_TICKS: u64 = 300 * 4000;
/// A state in which may be written.
const OFF: DriveState = DriveState::SwitchOnDisabled;
/// Flashes that are cut, by how full they are.
const LEVELS: u64 = 24;
/// "save", and the object that is kept of it: the following window, micro-radian.
const SAVE: u32 = u32::from_le_bytes(*b"save");
const WINDOW: u16 = 0x6065;
const WINDOWS: [u32; 2] = [20_000, 30_000];
const UNTOUCHED: u32 = 87_266;
/// What was kept cannot be read.
const LOST: u16 = NoticeCode::StoreFailed.number();

const fn head(id: &'static str, fault: &'static str, detector: &'static str, state: &'static str) -> Head {
    Head { id, fault, detector, state, deadline_ms: f64::INFINITY, unit: "", codes: &[], lacking: None }
}

pub(super) const CUT: Bench = Bench {
    head: Head {
        unit: "bytes",
        ..head(
            "F1",
            "power cut at any byte of a write or erase",
            "records are whole or not there",
            "Refuse only if both are lost",
        )
    },
    run: cuts,
};

pub(super) const ROT: Bench = Bench {
    head: head("F2", "corrupt or foreign parameters", "checksum, schema, ranges, fingerprint", "Refuse"),
    run: rots,
};

pub(super) const ARMED: Bench = Bench {
    head: head(
        "F3",
        "store asked for while the drive is on; the processor that stands meanwhile",
        "permit of a drive that is off, interlock",
        "-",
    ),
    run: armed,
};

/// A leg that was identified, as it is kept.
fn identified(leg: &LegFile, seed: u64) -> Result<KeptModel<JOINTS>, ToolError> {
    let refused = || SetupError::new(leg, "its identification is refused");
    let context = Context::<JOINTS, BASE>::new(leg, &SimulationOptions::of_seed(seed))?;
    let mut pair = Pair::new(leg, &context, seed)?;
    if !pair.enable(context.gravity) {
        return Err(refused().into());
    }
    let mut request = Some(ControlRequest::Identify);
    for _ in 0..LONGEST_TICKS {
        pair.tick(request.take(), context.gravity);
        if let Some(model) = pair.leg.control().model() {
            let identification = pair.leg.identification();
            return Ok(KeptModel::of(&context.configuration, identification, model, seed as u32, seed));
        }
    }
    Err(refused().into())
}

/// What is kept of a board.
#[derive(Clone, Debug, PartialEq)]
struct All {
    objects: [Option<Vec<u8>>; 2],
    model: Option<KeptModel<JOINTS>>,
}

impl All {
    fn of(memory: &mut Memory) -> Self {
        Self { objects: [0, 1].map(|joint| memory.objects(joint).ok().flatten()), model: memory.any_model() }
    }

    /// Bytes of any value, since the store does not look into them.
    fn random(random: &mut Xoshiro256PlusPlus, model: &KeptModel<JOINTS>) -> Self {
        let objects = [0, 1].map(|_| {
            let mut bytes = vec![0; 1 + random.next_u32() as usize % LONGEST];
            random.fill_bytes(&mut bytes);
            Some(bytes)
        });
        let mut model = *model;
        model.provenance.generation = random.next_u32();
        Self { objects, model: Some(model) }
    }

    /// In the order in which a board keeps them; whether all of it was.
    fn keep(&self, memory: &mut Memory) -> bool {
        let objects =
            self.objects.iter().enumerate().all(|(joint, bytes)| {
                bytes.as_ref().is_some_and(|bytes| memory.keep_objects(OFF, joint, bytes))
            });
        objects && self.model.as_ref().is_some_and(|model| memory.keep_any(OFF, model))
    }

    /// Each record is of one of both, and once one is old no later one is new.
    fn is_between(&self, old: &Self, new: &Self) -> bool {
        let parts = |all: &Self| {
            let [first, second] = all.objects.clone();
            [(first, None), (second, None), (None, all.model)]
        };
        let (told, old, new) = (parts(self), parts(old), parts(new));
        let mut may_be_new = true;
        (0..told.len()).all(|part| {
            let is_new = told[part] == new[part];
            let holds = is_new && may_be_new || told[part] == old[part];
            may_be_new &= is_new;
            holds
        })
    }
}

/// A flash that was written so often before, what it holds, and what is kept next.
struct Filled {
    memory: Memory,
    old: All,
    new: All,
    /// Bytes that the next save programs and erases.
    work: u64,
}

/// From empty to one whose next save erases a sector, in equal steps; the last of them erase.
fn filled(model: &KeptModel<JOINTS>) -> Vec<Filled> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut memory = Memory::new(None);
    let mut old = All::random(&mut random, model);
    old.keep(&mut memory);
    let mut all: Vec<Filled> = Vec::new();
    let mut erasing = 0;
    // A sector holds some 120 of them; the flash begins anew after both.
    for _ in 0..400 {
        let new = All::random(&mut random, model);
        let mut tried = memory.clone();
        new.keep(&mut tried);
        let (before, after) = (memory.worked(), tried.worked());
        erasing += usize::from(after.1 > before.1);
        all.push(Filled { memory, old, new: new.clone(), work: after.0 - before.0 });
        (memory, old) = (tried, new);
        if erasing == 2 {
            break;
        }
    }
    let erases: Vec<usize> = (0..all.len()).filter(|place| all[*place].work > 128 * 1024).collect();
    let step = (all.len() / LEVELS as usize).max(1);
    let mut place = 0;
    all.retain(|_| {
        place += 1;
        (place - 1) % step == 0 || erases.contains(&(place - 1))
    });
    all
}

fn cuts(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let filled = filled(&identified(leg, 1)?);
    Ok(seeds.par_iter().map(|seed| cut(head, &filled, *seed, blind)).collect())
}

/// Blind, the record is written over the old one as it stands, and believed.
fn cut(head: &Head, filled: &[Filled], seed: u64, blind: bool) -> Outcome {
    let mut dice = Dice::new(head.id, seed);
    let Filled { memory, old, new, work } = &filled[dice.below(filled.len() as u64) as usize];
    let mut memory = memory.clone();
    let bytes = 1 + dice.below(*work);
    memory.fail_after(Some(bytes));
    let kept = new.keep(&mut memory);
    memory.fail_after(None);
    if dice.below(4) == 0 {
        memory.fail_after(Some(1 + dice.below(3000)));
        All::of(&mut memory);
        memory.fail_after(None);
    }
    let mut told = All::of(&mut memory);
    if blind && let [Some(old), Some(new)] = [&old.objects[0], &new.objects[0]] {
        let cut = dice.below(new.len() as u64) as usize;
        told.objects[0] = Some(new[..cut].iter().chain(old.iter().skip(cut)).copied().collect());
    }
    let whole = told.is_between(old, new);
    let mut found = outcome(head, seed, whole.then_some(head.state));
    if kept && told != *new {
        found.broken.push("a save that was cut was told as done".into());
    }
    let mut again = old.clone();
    again.objects.reverse();
    if !again.keep(&mut memory) || All::of(&mut memory) != again {
        found.broken.push("nothing can be kept after a cut".into());
    }
    found.magnitude = Some(bytes as f64);
    found
}

/// A board whose memory holds older and newer objects and models, and the models that may be used.
struct Rotting {
    board: Board<JOINTS, BASE>,
    /// Of each node, all that were kept.
    objects: [Vec<Vec<u8>>; 2],
    models: [(KeptModel<JOINTS>, IdentifiedModel<JOINTS>); 2],
    kept: KeptModel<JOINTS>,
    other: KeptModel<JOINTS>,
}

impl Rotting {
    /// What the leg makes of a model that it kept.
    fn own(&self, kept: &KeptModel<JOINTS>) -> Option<IdentifiedModel<JOINTS>> {
        self.models.into_iter().find(|(record, _)| record.model == kept.model).map(|(_, model)| model)
    }

    fn new(leg: &LegFile) -> Result<Self, ToolError> {
        let refused = |words: &str| ToolError::from(SetupError::new(leg, words.to_owned()));
        let kept = [identified(leg, 1)?, identified(leg, 2)?];
        let mut longer = leg.clone();
        for joint in &mut longer.joints {
            joint.torque_per_ampere *= 1.1;
        }
        let other = identified(&longer, 1)?;
        let mut host = Host::new(board(leg)?);
        host.begin()?;
        let mut objects = [Vec::new(), Vec::new()];
        for (window, kept) in WINDOWS.into_iter().zip(&kept) {
            for node in [1, 2] {
                host.write(node, WINDOW, 0, window, 4)?;
            }
            host.write(1, 0x1010, 1, SAVE, 4)?;
            host.run(400);
            for (joint, objects) in objects.iter_mut().enumerate() {
                objects.extend(host.board().memory().objects(joint).ok().flatten());
            }
            if !host.board().memory().keep_any(OFF, kept) {
                return Err(refused("a flash that keeps no model"));
            }
        }
        let mut models = Vec::new();
        for kept in kept {
            host.board().memory().keep_any(OFF, &kept);
            host.board().power_on();
            let model = host.rig().leg.control().model().copied();
            let model = model.ok_or_else(|| refused("a model of its own that is not taken back"))?;
            models.push((kept, model));
        }
        let models = models.try_into().map_err(|_| refused("two models"))?;
        Ok(Self { board: host.board().clone(), objects, models, kept: kept[1], other })
    }
}

fn rots(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let rotting = Rotting::new(leg)?;
    seeds.par_iter().map(|seed| rot(head, &rotting, *seed, blind)).collect()
}

/// Blind, one of two checks is not made: another leg's model is taken as if it were this one's, or what rotted as if its check sum held.
fn rot(head: &Head, rotting: &Rotting, seed: u64, blind: bool) -> Result<Outcome, ToolError> {
    let mut dice = Dice::new(head.id, seed);
    let mut board = rotting.board.clone();
    spoil(&mut board, rotting, if blind { 4 } else { dice.below(6) }, &mut dice);
    let told_apart = readable(board.memory());
    // Nobody but the store can tell which of its records are whole: what it reads is one that was kept, or none.
    let after = All::of(board.memory());
    if blind && dice.coin() {
        let mut own = rotting.kept;
        own.model.parameters = rotting.other.model.parameters;
        board.memory().keep_any(OFF, &own);
    } else if blind && let Some(mut bytes) = after.objects[0].clone() {
        let place = dice.below(bytes.len() as u64) as usize;
        bytes[place] ^= 1 << dice.below(8);
        board.memory().keep_objects(OFF, 0, &bytes);
    }
    board.power_on();
    let used = board.rig.leg.control().model().copied();
    let was_kept = (0..2).all(|joint| {
        after.objects[joint].as_ref().is_none_or(|bytes| rotting.objects[joint].contains(bytes))
    });
    let is_foreign =
        after.model.is_some_and(|model| model.model.fingerprint != rotting.kept.model.fingerprint);
    let expected = after.model.filter(|_| !is_foreign).map(|kept| rotting.own(&kept));
    let is_own = used == expected.flatten();
    let mut host = Host::new(board);
    host.run(20);
    let windows = [host.read(1, WINDOW, 0)?, host.read(2, WINDOW, 0)?];
    let whole = [0, 1].map(|joint| after.objects[joint].as_deref().map_or(UNTOUCHED, window));
    let lost = is_foreign || !told_apart;
    let tells = [1, 2].map(|node| host.told().contains(&(node, LOST)));
    let enabled = host.is_enabled();
    let holds = is_own && was_kept && windows == whole && tells == [lost; 2] && !enabled;
    let mut found = outcome(head, seed, holds.then_some("Refuse"));
    // Nothing that is read was hit; or the record before it is read, whole, as after a power cut, and nobody can tell.
    if !lost && !blind && found.detected {
        (found.detected, found.undetectable) = (false, true);
    }
    found.hash = format!("{:016x}", host.rig().hash);
    Ok(found)
}

/// The following window among a node's objects, as it is after the start where it is not among them.
fn window(bytes: &[u8]) -> u32 {
    kept_entries(bytes).find(|(object, _)| object.index == WINDOW).map_or(UNTOUCHED, |(_, value)| value)
}

/// Every record can be read, whatever it says.
fn readable(memory: &mut Memory) -> bool {
    let model = memory.with(|store| block_on(store.load::<KeptModel<JOINTS>>(Key::Model)));
    (0..2).all(|joint| memory.objects(joint).is_ok()) && model.is_some_and(|model| model.is_ok())
}

/// In one of six ways: bits, stretches, another leg's model, all of it.
fn spoil(board: &mut Board<JOINTS, BASE>, rotting: &Rotting, way: u64, dice: &mut Dice) {
    let bytes = board.memory().bytes_mut();
    let used = bytes.iter().rposition(|byte| *byte != 0xFF).map_or(1, |last| last + 1) as u64;
    match way {
        0 | 1 => {
            for _ in 0..dice.logarithmic(1.0, 64.0) as u64 {
                bytes[dice.below(used) as usize] ^= 1 << dice.below(8);
            }
        }
        2 | 3 => {
            let from = dice.below(used) as usize;
            let to = (from + dice.logarithmic(1.0, 3000.0) as usize).min(bytes.len());
            let fill = dice.below(3);
            for byte in &mut bytes[from..to] {
                *byte = [0x00, 0xFF, dice.below(256) as u8][fill as usize];
            }
        }
        4 => {
            board.memory().keep_any(OFF, &rotting.other);
        }
        _ => bytes.fill([0x00, 0xFF][dice.below(2) as usize]),
    }
}

fn armed(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let (off, on): (Vec<u64>, Vec<u64>) = seeds.iter().partition(|seed| seed.is_multiple_of(2));
    let mut outcomes = stall(head, leg, &off, blind)?;
    outcomes.extend(forked(head, leg, hosted(leg)?, &on, |fork| asked(fork, blind))?);
    Ok(outcomes)
}

/// Blind, the flash is written as if the drive were off.
fn asked(mut fork: Fork<'_>, blind: bool) -> Result<Outcome, ToolError> {
    let before = fork.host.board().memory().bytes().to_vec();
    let node = 1 + fork.dice.below(2) as u16;
    let (object, word) = if fork.dice.coin() { (0x1010_u16, *b"save") } else { (0x1011, *b"load") };
    let ([low, high], [a, b, c, d]) = (object.to_le_bytes(), word);
    fork.host.write(node, WINDOW, 0, 50_000 + fork.dice.below(1000) as u32, 4)?;
    let answer = fork.host.ask(node, [0x23, low, high, 1, a, b, c, d])?;
    if blind {
        fork.host.board().memory().keep_objects(OFF, 0, &[1, 2, 3]);
    }
    let refused = answer.data() == [0x80, low, high, 1, 0x22, 0, 0, 0x08];
    fork.run(400);
    let untouched = fork.host.board().memory().bytes() == before;
    let moves = fork.host.is_enabled();
    Ok(fork.ended((refused && untouched && moves).then_some("-"), None))
}
