//! F2, F3: stored data that has rotted or is another leg's, and requests to change the flash.

use std::rc::Rc;

use scarab::bus::Abort;
use scarab::leg::{DriveState, Fingerprint};
use scarab::safety::{InhibitReason, NoticeCode};
use scarab::store::{Key, ModelRecord};
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_client::bus::{Object, RequestError};
use scarab_rig::faults::bench::stored_data::{corrupt, identified, readable, window, worn};
use scarab_rig::parameter_file::memory::Memory;

use crate::faults::{DAMP_S, Machines, Verdict, begin};
use crate::machine::Snapshot;
use crate::plant::JOINTS;
use crate::session::Session;
use crate::store_cuts::{LOAD, LONGEST_S, OBJECT, Request, SAVE};
use crate::time::ticks;

/// Values that are stored one after the other.
const WINDOWS: [u32; 2] = [20_000, 30_000];
/// Number of models accepted so far, in the object dictionary.
const MODELS: (u16, u8) = (0x2100, 7);
/// Inhibit reasons.
const INHIBIT: (u16, u8) = (0x2170, 1);
/// Ways to corrupt a memory.
const WAYS: u64 = 6;

/// A board that has stored two generations of objects and of models, and a model of the worn leg.
pub struct Stored {
    flash: Vec<u8>,
    fingerprint: Fingerprint,
    other: ModelRecord<JOINTS>,
}

/// What a board does with its stored data at a start.
#[derive(Debug, PartialEq, Eq)]
struct Start {
    windows: [u32; JOINTS],
    generation: u32,
    /// Nodes that report the loss of stored data.
    reports: [bool; JOINTS],
}

impl Machines<'_> {
    fn stored(&mut self) -> Result<Rc<Stored>, ToolError> {
        if let Some(stored) = &self.stored {
            return Ok(Rc::clone(stored));
        }
        let session = &mut *self.session;
        session.machine.restore(&self.booted)?;
        for window in WINDOWS {
            for node in [1, 2] {
                session.write_object(node, OBJECT, 0, window)?;
            }
            session.store(SAVE, LONGEST_S)?;
        }
        let mut memory = Memory::new(Some(session.chip_mut().flash.parameters_mut()));
        let leg = session.leg.clone();
        let mut longer = leg.clone();
        longer.joints.iter_mut().for_each(|joint| joint.torque_per_ampere *= 1.1);
        let [older, own, other] = [identified(&leg, 2)?, identified(&leg, 1)?, identified(&longer, 3)?];
        let mut of_worn = worn(&own);
        of_worn.provenance.generation = older.provenance.generation + 1;
        let kept = [&older, &own, &of_worn]
            .into_iter()
            .all(|model| memory.keep_any(DriveState::SwitchOnDisabled, model));
        let stored = Stored { flash: memory.bytes().to_vec(), fingerprint: own.model.fingerprint, other };
        let expected = Start {
            windows: [WINDOWS[1]; 2],
            generation: of_worn.provenance.generation,
            reports: [false; 2],
        };
        let found = start(session, &self.booted, &stored.flash)?;
        if !kept || found != expected {
            return Err(ToolError::input(format!("a sound memory gives {found:?} instead of {expected:?}")));
        }
        Ok(Rc::clone(self.stored.insert(Rc::new(stored))))
    }
}

/// Starts a board with this flash.
fn start(session: &mut Session, booted: &Snapshot, flash: &[u8]) -> Result<Start, ToolError> {
    session.machine.restore(booted)?;
    session.chip_mut().flash.parameters_mut().copy_from_slice(flash);
    session.power_up()?;
    session.run(20e-3)?;
    let reports = [1, 2].map(|node| session.emergencies(node).contains(&NoticeCode::StoreFailed.number()));
    let mut read = |node, (index, sub)| session.read_object(node, index, sub);
    let windows = [read(1, (OBJECT, 0))?, read(2, (OBJECT, 0))?];
    Ok(Start { windows, generation: read(1, MODELS)?, reports })
}

/// F2: the board takes the newest of its intact records, or its start values; it reports what is lost, and
/// enables nothing.
pub fn corrupted_records(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let stored = machines.stored()?;
    let mut random = Random::new("F2", seed);
    let way = seed % WAYS;
    let mut memory = Memory::new(Some(&stored.flash));
    corrupt(&mut memory, &stored.other, way, &mut random);
    let flash = memory.bytes().to_vec();
    let is_readable = readable(&mut memory);
    let models = Key::MODELS.map(|key| memory.any_model::<JOINTS>(key));
    let is_own = |model: &&ModelRecord<JOINTS>| model.model.fingerprint == stored.fingerprint;
    let own = models.iter().flatten().filter(is_own);
    let is_foreign = !models.iter().flatten().all(|model| is_own(&model));
    let objects = [0, 1].map(|joint| memory.objects(joint).ok().flatten());
    let default = window(&[]);
    let expected = Start {
        windows: objects.map(|objects| objects.as_deref().map_or(default, window)),
        generation: own.map(|model| model.provenance.generation).max().unwrap_or(0),
        reports: [!is_readable || is_foreign; JOINTS],
    };
    if !expected.windows.iter().all(|value| WINDOWS.contains(value) || *value == default) {
        return Err(ToolError::input(format!("the store reads what was never stored: {expected:?}")));
    }
    let session = &mut *machines.session;
    let resets = session.resets.len();
    let found = start(session, &machines.booted, &flash)?;
    session.chip_mut().plant.switchings.clear();
    session.hold_switch(true);
    session.run(0.3)?;
    let switched = session.chip().plant.switchings.len();
    if found != expected || switched > 0 || session.resets.len() != resets {
        return Ok(Err(format!("way {way}: {found:?} instead of {expected:?}; {switched} switchings")));
    }
    Ok(Ok(0.0))
}

/// F3: a request to change the flash while the drive is on is refused and changes nothing; with the drive off
/// the processor stalls, for up to twice the typical time, and nothing resets it. With a low supply of the
/// processor it is refused as well, with an inhibit reason.
pub fn requested(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let mut random = Random::new("F3", seed);
    let request = if random.coin() { SAVE } else { LOAD };
    match seed % 3 {
        0 => armed(machines, request, &mut random),
        1 => off(machines, request, &mut random),
        _ => low(machines, request, &mut random),
    }
}

/// Turns a resting drive off and changes an object of each node, so that a save has something to write.
fn drive_off<'a>(machines: &'a mut Machines<'_>, random: &mut Random) -> Result<&'a mut Session, ToolError> {
    let resting = machines.resting()?;
    let session = &mut *machines.session;
    begin(session, &resting, random.below(ticks(10e-3)))?;
    session.hold_switch(false);
    session.run(2.0 * DAMP_S)?;
    for node in [1, 2] {
        session.write_object(node, OBJECT, 0, WINDOWS[0])?;
    }
    Ok(session)
}

fn low(machines: &mut Machines<'_>, request: Request, random: &mut Random) -> Result<Verdict, ToolError> {
    let session = drive_off(machines, random)?;
    let cells = session.chip_mut().flash.parameters_mut().to_vec();
    // Between the supply that words of 32 bits need and the detector's level.
    session.chip_mut().set_supply(random.uniform(2.7, 2.9));
    let refused = session.store(request, LONGEST_S);
    let (index, sub) = INHIBIT;
    let causes = session.read_object(1, index, sub)?;
    let is_same = session.chip_mut().flash.parameters_mut() == cells;
    if !matches!(refused, Err(ToolError::Refused(_)))
        || causes != InhibitReason::ProcessorSupply.bit()
        || !is_same
    {
        return Ok(Err(format!("{refused:?}, inhibit reasons {causes:#x}, flash unchanged {is_same}")));
    }
    session.power_up()?;
    session.run(20e-3)?;
    session.write_object(1, OBJECT, 0, WINDOWS[0])?;
    Ok(session.store(request, LONGEST_S).map(|()| 0.0).map_err(|error| error.to_string()))
}

fn armed(machines: &mut Machines<'_>, request: Request, random: &mut Random) -> Result<Verdict, ToolError> {
    let (index, word) = request;
    let moving = machines.moving()?;
    let session = &mut *machines.session;
    begin(session, &moving, random.below(ticks(0.5)))?;
    let cells = session.chip_mut().flash.parameters_mut().to_vec();
    let node = 1 + random.below(2) as u8;
    let answer = session.client().try_write(node, Object(index, 1), u32::from_le_bytes(word), 4);
    if let Err(RequestError::Failed(why)) = answer {
        return Err(ToolError::input(why));
    }
    session.run(0.1)?;
    let is_refused = answer.as_ref().is_err_and(|error| error.is(Abort::State));
    let is_same = session.chip_mut().flash.parameters_mut() == cells;
    let switched = session.chip().plant.switchings.len();
    if !is_refused || !is_same || switched > 0 {
        return Ok(Err(format!("answer {answer:?}, flash unchanged {is_same}, {switched} switchings")));
    }
    Ok(Ok(0.0))
}

fn off(machines: &mut Machines<'_>, request: Request, random: &mut Random) -> Result<Verdict, ToolError> {
    let session = drive_off(machines, random)?;
    let resets = session.resets.len();
    let chip = session.chip_mut();
    chip.flash.slowness = random.uniform(1.0, 2.0);
    chip.iwdg.oscillator_hz = random.uniform(17e3, 47e3) as u64;
    chip.reschedule();
    chip.plant.switchings.clear();
    let erasures = chip.flash.erasures;
    // The bus says FF0D before and 0000 afterwards, else this fails.
    if let Err(error) = session.store(request, LONGEST_S) {
        return Ok(Err(error.to_string()));
    }
    session.run(0.1)?;
    let erased = session.chip().flash.erasures > erasures;
    let switched = session.chip().plant.switchings.len();
    if session.resets.len() != resets || switched > 0 {
        return Ok(Err(format!("resets {:?}, {switched} switchings", &session.resets[resets..])));
    }
    // After an erasure the joints may have moved by any angle: no enabling without a new reference.
    session.hold_switch(true);
    session.run(0.5)?;
    let enabled = session.chip().plant.axes.iter().any(|axis| axis.is_armed);
    if enabled == erased {
        return Ok(Err(format!("sector erased {erased}, enabled afterwards {enabled}")));
    }
    Ok(Ok(0.0))
}
