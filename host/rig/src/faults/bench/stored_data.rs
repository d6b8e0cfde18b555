//! F1, F2, F3: stored data after a power failure during a write, after corruption, and after a request to
//! store while the leg moves.
//!
//! | row | fault |
//! | --- | --- |
//! | F1 | power failure at any byte of a save; in one of four runs another during the repair |
//! | F2 | flipped bits, an overwritten stretch, another leg's model, everything erased |
//! | F3 | "save" while the drive is on |
//! | F3 | "save" while the drive is off (`stall.rs`) |
//!
//! Requirements. F1: each record is the old or the new one; no later record is new where an earlier one is
//! old; the next save succeeds. F2: each node has the newest of its intact records, or its start values; the
//! leg has its models likewise, if they are its own. Unreadable and foreign data is reported (5530). F3: with
//! the drive on the request is refused (0800 0022), no byte of the flash changes, and the leg moves on. With
//! the drive off the processor stalls, which no check reports as a fault.
//!
//! The flashes of F1 were filled before, to all levels up to one where the next record requires erasing a
//! sector.

use embassy_futures::block_on;
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use scarab::bus::{Abort, LONGEST, stored_entries};
use scarab::leg::{ControlRequest, DriveState, IdentifiedModel, NoticeCode, Wearing};
use scarab::store::{Key, ModelRecord};
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_client::bus::Object;
use scarab_client::master::Client;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::board::Board;
use crate::bus::host::{Host, SAVE, WINDOW};
use crate::faults::bench::hosted::{Fork, board, forked, hosted};
use crate::faults::bench::stall::stall;
use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::Fault;
use crate::faults::run::Outcome;
use crate::options::SimulationOptions;
use crate::pair::{Context, Pair};
use crate::parameter_file::memory::{Memory, SECTOR};
use scarab::hal::SERVO_RATE_HZ;
use scarab::model::planar::{BASE, JOINTS};

/// Longest identification, servo ticks.
const LONGEST_TICKS: u64 = 300 * SERVO_RATE_HZ as u64;
/// Drive state in which writing is permitted.
const OFF: DriveState = DriveState::SwitchOnDisabled;
/// Number of fill levels of the flash.
const LEVELS: u64 = 24;
const WINDOWS: [u32; 2] = [20_000, 30_000];
const UNTOUCHED: u32 = 87_266;
/// Emergency code: stored data cannot be read.
const LOST: u16 = NoticeCode::StoreFailed.number();

/// Identifies a leg and returns its model as stored.
///
/// # Errors
/// The leg cannot be identified.
pub fn identified(leg: &LegFile, seed: u64) -> Result<ModelRecord<JOINTS>, ToolError> {
    let refused = || leg.error("its identification is refused");
    let context = Context::<JOINTS, BASE>::new(leg, &SimulationOptions::with_seed(seed))?;
    let mut pair = Pair::new(leg, &context, seed)?;
    if !pair.enable(context.gravity) {
        return Err(refused().into());
    }
    let mut request = Some(ControlRequest::Identify);
    for _ in 0..LONGEST_TICKS {
        pair.tick(request.take(), context.gravity);
        if let Some(model) = pair.leg.control().model() {
            let identification = pair.leg.identification();
            let configuration = &context.configuration;
            return Ok(ModelRecord::new(configuration, identification, model, seed as u32, seed, None));
        }
    }
    Err(refused().into())
}

/// The model as that of the worn leg.
pub fn worn(model: &ModelRecord<JOINTS>) -> ModelRecord<JOINTS> {
    let mut worn = *model;
    worn.provenance.worn = Some(true);
    worn
}

/// All data that a board stores; models in the order of [`Key::MODELS`].
#[derive(Clone, Debug, PartialEq)]
struct All {
    objects: [Option<Vec<u8>>; 2],
    models: [Option<ModelRecord<JOINTS>>; 2],
}

impl All {
    fn read(memory: &mut Memory) -> Self {
        Self {
            objects: [0, 1].map(|joint| memory.objects(joint).ok().flatten()),
            models: Key::MODELS.map(|key| memory.any_model(key)),
        }
    }

    /// Random bytes; the store does not interpret them.
    fn random(random: &mut Xoshiro256PlusPlus, model: &ModelRecord<JOINTS>) -> Self {
        let objects = [0, 1].map(|_| {
            let mut bytes = vec![0; 1 + random.next_u32() as usize % LONGEST];
            random.fill_bytes(&mut bytes);
            Some(bytes)
        });
        let models = [*model, worn(model)].map(|mut model| {
            model.provenance.generation = random.next_u32();
            Some(model)
        });
        Self { objects, models }
    }

    /// Stores all in the board's order; returns whether all succeeded.
    fn keep(&self, memory: &mut Memory) -> bool {
        let objects =
            self.objects.iter().enumerate().all(|(joint, bytes)| {
                bytes.as_ref().is_some_and(|bytes| memory.keep_objects(OFF, joint, bytes))
            });
        let write = |model: &Option<_>| model.as_ref().is_some_and(|model| memory.keep_any(OFF, model));
        objects && self.models.iter().all(write)
    }

    /// Returns whether each record comes from one of both sets, and no new record follows an old one.
    fn is_between(&self, old: &Self, new: &Self) -> bool {
        let parts = |all: &Self| {
            let [first, second] = all.objects.clone();
            let [model, worn] = all.models;
            [(first, None), (second, None), (None, model), (None, worn)]
        };
        let (read, old, new) = (parts(self), parts(old), parts(new));
        let mut may_be_new = true;
        (0..read.len()).all(|part| {
            let is_new = read[part] == new[part];
            let holds = is_new && may_be_new || read[part] == old[part];
            may_be_new &= is_new;
            holds
        })
    }
}

/// A flash with a fill level, its content, and the content to store next.
struct Filled {
    memory: Memory,
    old: All,
    new: All,
    /// Bytes that the next save programs and erases.
    work: u64,
}

/// Flashes from empty to one whose next save erases a sector, in equal steps, and those that erase.
fn filled(model: &ModelRecord<JOINTS>) -> Vec<Filled> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut memory = Memory::new(None);
    let mut old = All::random(&mut random, model);
    old.keep(&mut memory);
    let mut all: Vec<Filled> = Vec::new();
    let mut erasing = 0;
    // A sector holds about 150 of these saves; the sequence repeats after both sectors.
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
    let erases: Vec<usize> = (0..all.len()).filter(|index| all[*index].work > SECTOR as u64).collect();
    let step = (all.len() / LEVELS as usize).max(1);
    let mut index = 0;
    all.retain(|_| {
        index += 1;
        (index - 1) % step == 0 || erases.contains(&(index - 1))
    });
    all
}

pub(super) fn cuts(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let filled = filled(&identified(leg, 1)?);
    Ok(seeds.par_iter().map(|seed| cut(fault, &filled, *seed, blind)).collect())
}

/// Blind: the record overwrites the old one and is accepted without a check.
fn cut(fault: &Fault, filled: &[Filled], seed: u64, blind: bool) -> Outcome {
    let mut random = Random::new(fault.id, seed);
    let Filled { memory, old, new, work } = &filled[random.below(filled.len() as u64) as usize];
    let mut memory = memory.clone();
    let bytes = 1 + random.below(*work);
    memory.fail_after(Some(bytes));
    let kept = new.keep(&mut memory);
    memory.fail_after(None);
    if random.below(4) == 0 {
        memory.fail_after(Some(1 + random.below(3000)));
        All::read(&mut memory);
        memory.fail_after(None);
    }
    let mut read = All::read(&mut memory);
    if blind && let [Some(old), Some(new)] = [&old.objects[0], &new.objects[0]] {
        let cut = random.below(new.len() as u64) as usize;
        read.objects[0] = Some(new[..cut].iter().chain(old.iter().skip(cut)).copied().collect());
    }
    let whole = read.is_between(old, new);
    let mut found = outcome(fault, seed, whole.then_some(fault.state));
    if kept && read != *new {
        found.broken.push("an interrupted save was reported as done".into());
    }
    let mut again = old.clone();
    again.objects.reverse();
    if !again.keep(&mut memory) || All::read(&mut memory) != again {
        found.broken.push("nothing can be stored after a power cut".into());
    }
    found.magnitude = Some(bytes as f64);
    found
}

/// A board whose memory holds older and newer objects and models, and the models that may be used.
struct FilledBoard {
    board: Board<JOINTS, BASE>,
    /// All stored objects of each node.
    objects: [Vec<Vec<u8>>; 2],
    /// Stored for the empty and for the worn leg.
    models: [(ModelRecord<JOINTS>, IdentifiedModel<JOINTS>); 2],
    kept: ModelRecord<JOINTS>,
    other: ModelRecord<JOINTS>,
}

impl FilledBoard {
    /// Model that the leg derives from one of its stored models.
    fn own(&self, kept: &ModelRecord<JOINTS>) -> Option<IdentifiedModel<JOINTS>> {
        self.models.into_iter().find(|(record, _)| record.model == kept.model).map(|(_, model)| model)
    }

    fn new(leg: &LegFile) -> Result<Self, ToolError> {
        let refused = |words: &str| ToolError::from(leg.error(words.to_owned()));
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
            host.write_both(WINDOW, window, 4)?;
            host.write(1, 0x1010, 1, SAVE, 4)?;
            host.run(400);
            for (joint, objects) in objects.iter_mut().enumerate() {
                objects.extend(host.board().memory().objects(joint).ok().flatten());
            }
            for model in [*kept, worn(kept)] {
                if !host.board().memory().keep_any(OFF, &model) {
                    return Err(refused("its flash does not store a model"));
                }
            }
        }
        let mut models = Vec::new();
        for kept in kept {
            host.board().memory().keep_any(OFF, &kept);
            host.board().power_on();
            let model = host.rig().leg.control().model().copied();
            let model = model.ok_or_else(|| refused("its own stored model is not accepted"))?;
            models.push((kept, model));
        }
        let models = models.try_into().map_err(|_| refused("two models"))?;
        Ok(Self { board: host.board().clone(), objects, models, kept: kept[1], other })
    }
}

pub(super) fn corruptions(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let stored = FilledBoard::new(leg)?;
    seeds.par_iter().map(|seed| corruption(fault, &stored, *seed, blind)).collect()
}

/// Blind: one of two checks is skipped. Either another leg's model is taken as its own, or corrupt data as if
/// its checksum were correct.
fn corruption(fault: &Fault, stored: &FilledBoard, seed: u64, blind: bool) -> Result<Outcome, ToolError> {
    let mut random = Random::new(fault.id, seed);
    let mut board = stored.board.clone();
    let way = if blind { 4 } else { random.below(6) };
    corrupt(board.memory(), &stored.other, way, &mut random);
    let told_apart = readable(board.memory());
    // Only the store can decide which of its records are intact: each value it reads was stored once, or is
    // absent.
    let after = All::read(board.memory());
    if blind && random.coin() {
        let mut own = stored.kept;
        own.model.parameters = stored.other.model.parameters;
        board.memory().keep_any(OFF, &own);
    } else if blind && let Some(mut bytes) = after.objects[0].clone() {
        let index = random.below(bytes.len() as u64) as usize;
        bytes[index] ^= 1 << random.below(8);
        board.memory().keep_objects(OFF, 0, &bytes);
    }
    board.power_on();
    let control = board.rig.leg.control();
    let used = [control.model().copied(), control.model_of(Wearing::Worn).copied()];
    let was_kept = (0..2)
        .all(|joint| after.objects[joint].as_ref().is_none_or(|bytes| stored.objects[joint].contains(bytes)));
    let belongs = |kept: &ModelRecord<JOINTS>| kept.model.fingerprint == stored.kept.model.fingerprint;
    let is_foreign = !after.models.iter().flatten().all(belongs);
    let is_own = used == after.models.map(|kept| stored.own(&kept.filter(belongs)?));
    let mut host = Host::new(board);
    host.run(20);
    let windows = [host.read(1, WINDOW, 0)?, host.read(2, WINDOW, 0)?];
    let whole = [0, 1].map(|joint| after.objects[joint].as_deref().map_or(UNTOUCHED, window));
    let lost = is_foreign || !told_apart;
    let reports = [1, 2].map(|node| host.emergencies().contains(&(node, LOST)));
    let enabled = host.is_enabled();
    let holds = is_own && was_kept && windows == whole && reports == [lost; 2] && !enabled;
    let mut found = outcome(fault, seed, holds.then_some("Refuse"));
    // The corruption hit no data in use, or the previous intact record is read, as after a power cut. Neither
    // is detectable.
    if !lost && !blind && found.detected {
        (found.detected, found.undetectable) = (false, true);
    }
    found.hash = format!("{:016x}", host.rig().hash);
    Ok(found)
}

/// Following window among a node's objects, or its start value.
pub fn window(bytes: &[u8]) -> u32 {
    stored_entries(bytes).find(|(object, _)| object.index == WINDOW).map_or(UNTOUCHED, |(_, value)| value)
}

/// Returns whether every record can be read, whatever its content.
pub fn readable(memory: &mut Memory) -> bool {
    (0..2).all(|joint| memory.objects(joint).is_ok())
        && Key::MODELS.into_iter().all(|key| {
            let model = memory.with(|store| block_on(store.load::<ModelRecord<JOINTS>>(key)));
            model.is_some_and(|model| model.is_ok())
        })
}

/// Corrupts the memory in one of six ways: bits, stretches, another leg's model, all of it.
pub fn corrupt(memory: &mut Memory, other: &ModelRecord<JOINTS>, way: u64, random: &mut Random) {
    let bytes = memory.bytes_mut();
    let used = bytes.iter().rposition(|byte| *byte != 0xFF).map_or(1, |last| last + 1) as u64;
    match way {
        0 | 1 => {
            for _ in 0..random.logarithmic(1.0, 64.0) as u64 {
                bytes[random.below(used) as usize] ^= 1 << random.below(8);
            }
        }
        2 | 3 => {
            let from = random.below(used) as usize;
            let to = (from + random.logarithmic(1.0, 3000.0) as usize).min(bytes.len());
            let fill = random.below(3);
            for byte in &mut bytes[from..to] {
                *byte = [0x00, 0xFF, random.below(256) as u8][fill as usize];
            }
        }
        4 => {
            let other = if random.coin() { worn(other) } else { *other };
            memory.keep_any(OFF, &other);
        }
        _ => bytes.fill([0x00, 0xFF][random.below(2) as usize]),
    }
}

pub(super) fn armed(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let (off, on): (Vec<u64>, Vec<u64>) = seeds.iter().partition(|seed| seed.is_multiple_of(2));
    let mut outcomes = stall(fault, leg, &off, blind)?;
    outcomes.extend(forked(fault, leg, hosted(leg)?, &on, |fork| requested(fork, blind))?);
    Ok(outcomes)
}

/// Blind: the flash is written as if the drive were off.
fn requested(mut fork: Fork<'_>, blind: bool) -> Result<Outcome, ToolError> {
    let before = fork.host.board().memory().bytes().to_vec();
    let node = 1 + fork.random.below(2) as u16;
    let (object, word) = if fork.random.coin() { (0x1010_u16, *b"save") } else { (0x1011, *b"load") };
    fork.host.write(node, WINDOW, 0, 50_000 + fork.random.below(1000) as u32, 4)?;
    let answer =
        Client::over(&mut fork.host).try_write(node as u8, Object(object, 1), u32::from_le_bytes(word), 4);
    if blind {
        fork.host.board().memory().keep_objects(OFF, 0, &[1, 2, 3]);
    }
    let refused = answer.is_err_and(|error| error.is(Abort::State));
    fork.run(400);
    let untouched = fork.host.board().memory().bytes() == before;
    let moves = fork.host.is_enabled();
    Ok(fork.ended((refused && untouched && moves).then_some("-"), None))
}
