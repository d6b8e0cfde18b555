//! Storing of a board's parameters, in the order of the firmware (`operation::Storing`), with the processor
//! stalled.
//!
//! ```text
//! hosts are informed; 20 ms later the flash is changed: 16 us per word, 0.25 to 0.5 s per erased sector
//! (STM32F405, data sheet). The processor stalls for that time: received frames wait in the controller's
//! queue of three, further ones are lost.
//! ```

use scarab::bus::device::StoreCommand;
use scarab::bus::program::{ProgramCommand, ProgramError, ProgramStatus};
use scarab::bus::{Frame, StoredNode};
use scarab::leg::DriveState;
use scarab::operation::{Inhibit, Purpose, Storing};
use scarab::store::{Key, ModelRecord};

use crate::board::levels::Levels;
use crate::bus::board::TICK_NS;
use crate::faulty_board::Rig;
use crate::parameter_file::memory::{Memory, SECTOR};

/// Period of the steps of `Storing`.
const STEP_NS: u64 = 1_000_000;
/// Time to program a word of four bytes, and to erase a sector.
const WORD_NS: u64 = 16_000;
const ERASING_NS: u64 = 250_000_000;
/// Length of the controller's receive queue.
const QUEUE: usize = 3;

/// Pending store request.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StorageRequest<const N: usize> {
    /// Store all, or restore the defaults.
    pub(crate) what: StoreCommand,
    /// Objects of each node.
    pub(crate) objects: [StoredNode; N],
    /// Accepted models that are not stored yet, in the order of [`Key::MODELS`].
    pub(crate) models: [Option<ModelRecord<N>>; 2],
}

impl<const N: usize> StorageRequest<N> {
    /// Stores all objects and models, or erases everything; returns whether this succeeded.
    fn change(&self, memory: &mut Memory, state: DriveState) -> bool {
        match self.what {
            StoreCommand::Defaults => memory.forget(state),
            StoreCommand::All => {
                let mut nodes = self.objects.iter().enumerate();
                nodes.all(|(joint, kept)| memory.keep_objects(state, joint, kept.bytes()))
                    && self.models.iter().flatten().all(|model| memory.keep_any(state, model))
            }
        }
    }

    /// Number of stored models after success, if it changes.
    pub(crate) fn generation(&self) -> Option<u32> {
        match self.what {
            StoreCommand::Defaults => Some(0),
            StoreCommand::All => {
                self.models.iter().flatten().next_back().map(|model| model.provenance.generation)
            }
        }
    }
}

/// Storing and stall of a simulated board; see the module.
#[derive(Clone, Debug)]
pub(crate) struct Flashing<const N: usize> {
    storing: Storing,
    requested: Option<StorageRequest<N>>,
    /// Accepted models that are not stored yet, in the order of [`Key::MODELS`].
    accepted: [Option<ModelRecord<N>>; 2],
    /// Whether the flash was changed.
    has_kept: bool,
    /// Time of the next step.
    due_ns: u64,
    /// End of the stall.
    until_ns: u64,
    /// Frames received during the stall, and whether one was lost.
    queued: Vec<Frame>,
    lost: bool,
    /// Time to erase a sector.
    pub(crate) erasing_ns: u64,
    /// In campaigns without announcement, the inhibit reason of the store is not set in the firmware.
    pub(crate) unannounced: bool,
    unseen: Inhibit,
}

impl<const N: usize> Flashing<N> {
    /// Creates the state without a request.
    pub fn new() -> Self {
        Self {
            storing: Storing::new(),
            requested: None,
            accepted: [None; 2],
            has_kept: false,
            due_ns: 0,
            until_ns: 0,
            queued: Vec::new(),
            lost: false,
            erasing_ns: ERASING_NS,
            unannounced: false,
            unseen: Inhibit::new(),
        }
    }

    /// Whether a store request is in progress.
    pub(crate) fn is_under_way(&self) -> bool {
        self.requested.is_some()
    }

    /// Sets the model to be stored with the next request.
    pub(super) fn accept(&mut self, model: ModelRecord<N>) {
        let [other, worn] = &mut self.accepted;
        let accepted = if model.key() == Key::WornModel { worn } else { other };
        *accepted = Some(model);
    }

    /// Whether the processor stalls.
    pub(crate) fn stands(&self, now_ns: u64) -> bool {
        now_ns < self.until_ns
    }

    /// Receives a frame during a stall. Returns whether the processor runs.
    pub(super) fn receive(&mut self, frame: &Frame, now_ns: u64) -> bool {
        let stands = self.stands(now_ns);
        if stands && self.queued.len() < QUEUE {
            self.queued.push(*frame);
        } else if stands {
            self.lost = true;
        }
        !stands
    }

    /// Takes the frames received during the stall, and whether one was lost.
    pub(super) fn take_queued(&mut self) -> (Vec<Frame>, bool) {
        (core::mem::take(&mut self.queued), core::mem::take(&mut self.lost))
    }

    /// Whether the flash was changed since the last call.
    pub(crate) fn take_kept(&mut self) -> bool {
        core::mem::take(&mut self.has_kept)
    }

    /// Runs a step, if one is due.
    pub(super) fn step<const B: usize>(&mut self, now_ns: u64, rig: &mut Rig<N, B>, memory: &mut Memory) {
        if now_ns < self.due_ns {
            return;
        }
        self.due_ns = now_ns + STEP_NS;
        let (before, state) = (memory.worked(), rig.state());
        let Levels { signals, registers, bus, .. } = &mut *rig.board;
        let inhibit = if self.unannounced { &self.unseen } else { &signals.inhibit };
        // A simulated board has no program that could be replaced.
        if let Some(command) = signals.take_program_command() {
            let error = match command {
                ProgramCommand::Start => ProgramError::None,
                _ => ProgramError::Forbidden,
            };
            signals.set_program_status(ProgramStatus((error as u32) << 1));
        }
        let Some(storage) = bus.as_ref().map(|bus| &bus.storage) else { return };
        let Some(mut keep) = storage.given() else {
            return self.storing.supervise(inhibit, registers);
        };
        if self.requested.is_none() {
            let mut models = self.accepted;
            let mut generation = keep.generation;
            for model in models.iter_mut().flatten() {
                generation = generation.wrapping_add(1);
                model.provenance.generation = generation;
            }
            self.requested = Some(StorageRequest { what: keep.what, objects: keep.objects, models });
        }
        let Some(requested) = &self.requested else { return };
        let done = self.storing.step(inhibit, signals.permission(), Purpose::Parameters, registers, || {
            self.has_kept = true;
            Some(requested.change(memory, state))
        });
        let after = memory.worked();
        let sectors = u64::from(after.1 - before.1);
        // A sector erased during a power failure is not complete.
        let words = (after.0 - before.0).saturating_sub(sectors * SECTOR as u64) / 4;
        if after != before {
            self.until_ns = now_ns + TICK_NS + words * WORD_NS + sectors * self.erasing_ns;
        }
        let Some(done) = done else { return };
        if let Some(generation) = requested.generation().filter(|_| done) {
            keep.generation = generation;
            self.accepted = [None; 2];
            if requested.what == StoreCommand::Defaults {
                signals.forget_stored();
            }
        }
        self.requested = None;
        keep.done = done;
        drop(keep);
        storage.return_value();
    }
}

impl<const N: usize> Default for Flashing<N> {
    fn default() -> Self {
        Self::new()
    }
}
