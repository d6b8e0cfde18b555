//! Thread: persistent storage on the board, and a new image.
//!
//! Connects flash, watchdog, inhibits and queues to `operation::Storing`, `operation::Update` and
//! `store::Storage`.
//!
//! During a flash write all software stalls, and with it every clock (`board::odrive_v3_6::flash`). The
//! current loops do not count the gap while `storing` is raised (`operation::CurrentLoops`). An emergency
//! stop finds the bridges off; it takes effect after the write.

use embassy_time::Timer;
use heapless::spsc::Consumer;

use super::SIGNALS;
use super::bus::StorageEnd;
use super::leg::{JOINTS, Leg};
use crate::board::odrive_v3_6::flash::{SmallSectors, at_once};
use crate::board::odrive_v3_6::hardware::Odrive;
use crate::board::odrive_v3_6::program::BoardProgram;
use crate::bus::device::StoreCommand;
use crate::bus::{LONGEST, StoredNode};
use crate::leg::{IdentifiedModel, StoredCalibration, Wearing};
use crate::operation::{Calibrated, Purpose, StoreJob, Storing, Update};
use crate::store::{self, Key, ModelRecord, Permit, Store};

/// Polling interval of the task, ms.
const ROUND_MS: u64 = 10;

/// Interval between the steps of a flash write, ms.
const STEP_MS: u64 = 1;

/// A stored model that belongs to this leg.
pub struct RestoredModel {
    /// The model.
    pub model: IdentifiedModel<JOINTS>,
    /// Whether the identified leg was empty or worn, if known.
    pub wearing: Option<Wearing>,
    /// Number of models accepted on this board when it was stored.
    pub generation: u32,
}

/// The store and the ends of its queues.
pub struct StorageTask {
    storage: store::Storage<SmallSectors, JOINTS>,
    storing: Storing,
    program: BoardProgram,
    update: Update,
    ends: Option<(StorageEnd, Consumer<'static, Calibrated>)>,
}

impl StorageTask {
    /// Creates the storage on this flash; `None` where its size is invalid, which no board of this kind has.
    pub fn new(flash: SmallSectors, bytes: u32) -> Option<Self> {
        let store = Store::new(flash, 0..bytes).ok()?;
        let program = BoardProgram::new();
        let update = Update::new(program.is_on_trial());
        Some(Self {
            storage: store::Storage::new(store),
            storing: Storing::new(),
            program,
            update,
            ends: None,
        })
    }

    /// Sets the sources of requests and of calibrations.
    pub fn serve(&mut self, end: StorageEnd, calibrated: Consumer<'static, Calibrated>) {
        // Before the bus answers: a host must not take an image on trial for a confirmed one.
        self.update.end(true, &SIGNALS);
        self.ends = Some((end, calibrated));
    }

    /// Reads the stored objects of a node; returns their length, or `None` where they cannot be read.
    pub fn objects(&mut self, joint: usize, into: &mut [u8; LONGEST]) -> Option<usize> {
        at_once(self.storage.objects(joint, into))?
    }

    /// Stored calibrations.
    pub fn calibrations(&mut self) -> [Option<StoredCalibration>; JOINTS] {
        core::array::from_fn(|axis| at_once(self.storage.calibration(axis))?)
    }

    /// Stored model of one of [`Key::MODELS`], if there is one; `None` where it cannot be read or belongs to
    /// another leg.
    #[inline(never)]
    pub fn model(&mut self, leg: &Leg, key: Key) -> Option<Option<RestoredModel>> {
        match at_once(self.storage.model(key))?? {
            Some(ModelRecord { model, provenance }) => Some(Some(RestoredModel {
                model: leg.restore(&model).ok()?,
                wearing: provenance.wearing(),
                generation: provenance.generation,
            })),
            None => Some(None),
        }
    }
}

/// Stores or resets; returns `None` on failure.
#[inline(never)]
fn change(storage: &mut store::Storage<SmallSectors, JOINTS>, job: &mut StoreJob<JOINTS>) -> Option<()> {
    let permit = Permit::under(SIGNALS.permission())?;
    job.generation = match job.what {
        StoreCommand::Defaults => {
            let generation = at_once(storage.forget(&permit))??;
            SIGNALS.forget_stored();
            generation
        }
        StoreCommand::All => {
            let objects = job.objects.each_ref().map(StoredNode::bytes);
            at_once(storage.save(&permit, objects, job.generation))??
        }
    };
    Some(())
}

/// Task of the storage.
#[embassy_executor::task]
pub async fn run(storage: &'static mut StorageTask) -> ! {
    let StorageTask { storage, storing, program, update, ends } = storage;
    loop {
        Timer::after_millis(ROUND_MS).await;
        storing.supervise(&SIGNALS.inhibit, &mut Odrive);
        let Some((end, calibrated)) = ends else { continue };
        if let Some(model) = end.accepted.dequeue() {
            storage.accept(model);
        }
        while let Some((axis, calibration)) = calibrated.dequeue() {
            storage.calibrated(axis, calibration);
        }
        if let Some(begun) =
            SIGNALS.take_program_command().and_then(|command| update.begin(command, &SIGNALS))
        {
            let done = loop {
                let change = || update.change(begun, &SIGNALS, &mut end.program, program);
                match storing.step(
                    &SIGNALS.inhibit,
                    SIGNALS.permission(),
                    Purpose::Program,
                    &mut Odrive,
                    change,
                ) {
                    Some(done) => break done,
                    None => Timer::after_millis(STEP_MS).await,
                }
            };
            update.end(done, &SIGNALS);
        }
        let Some(mut job) = end.storage.given() else { continue };
        job.done = loop {
            let change = || Some(change(storage, &mut job).is_some());
            match storing.step(
                &SIGNALS.inhibit,
                SIGNALS.permission(),
                Purpose::Parameters,
                &mut Odrive,
                change,
            ) {
                Some(done) => break done,
                None => Timer::after_millis(STEP_MS).await,
            }
        };
        drop(job);
        end.storage.return_value();
    }
}
