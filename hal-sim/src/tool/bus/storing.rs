//! What hosts want kept of a board, in the board's own order (`operation::Storing`), and a processor that stands meanwhile.
//!
//! ```text
//! hosts are told, 20 ms later the flash is changed: each word 16 us, each sector that is erased 1 to 2 s (STM32F405, data sheet)
//! for that time the processor stands: frames of others wait in the controller's queue of three, what comes then is lost
//! ```

use scarab::bus::station::Keeping;
use scarab::bus::{Frame, KeptNode};
use scarab::operation::{Inhibit, Storing};
use scarab::store::KeptModel;

use super::board::TICK_NS;
use super::memory::{Memory, SECTOR};
use crate::tool::board::levels::Levels;
use crate::tool::faults::rig::Rig;

/// A step of `Storing`.
const STEP_NS: u64 = 1_000_000;
/// A word of four bytes takes so long to program, and a sector to erase.
const WORD_NS: u64 = 16_000;
const ERASING_NS: u64 = 1_000_000_000;
/// Of the controller's receiving queue.
const QUEUE: usize = 3;

/// What a host wants kept.
#[derive(Clone, Copy, Debug)]
pub struct Asked<const N: usize> {
    /// All or nothing.
    pub what: Keeping,
    /// Of each node.
    pub objects: [KeptNode; N],
    /// A model that was accepted and is not kept yet.
    pub model: Option<KeptModel<N>>,
}

impl<const N: usize> Asked<N> {
    /// Models kept so far, once it was done, where that changes.
    #[must_use]
    pub fn generation(&self) -> Option<u32> {
        match self.what {
            Keeping::Defaults => Some(0),
            Keeping::All => self.model.map(|model| model.provenance.generation),
        }
    }
}

/// See the module.
#[derive(Clone, Debug)]
pub struct Flashing<const N: usize> {
    storing: Storing,
    asked: Option<Asked<N>>,
    /// Model that was accepted and is not stored yet.
    accepted: Option<KeptModel<N>>,
    /// Something was kept or forgotten.
    has_kept: bool,
    /// The next step.
    due_ns: u64,
    /// The processor stands until then.
    until_ns: u64,
    /// What the controller heard meanwhile, and that it lost something; told once, it is over with the next tick.
    heard: Vec<Frame>,
    lost: bool,
    /// A sector is erased in this time.
    pub erasing_ns: u64,
    /// For campaigns that are blind: the inhibit word of the firmware is not raised, but this one.
    pub unannounced: bool,
    unseen: Inhibit,
}

impl<const N: usize> Flashing<N> {
    /// Nothing asked.
    #[must_use]
    pub fn new() -> Self {
        Self {
            storing: Storing::new(),
            asked: None,
            accepted: None,
            has_kept: false,
            due_ns: 0,
            until_ns: 0,
            heard: Vec::new(),
            lost: false,
            erasing_ns: ERASING_NS,
            unannounced: false,
            unseen: Inhibit::new(),
        }
    }

    /// A change is asked for and has not ended.
    #[must_use]
    pub fn is_under_way(&self) -> bool {
        self.asked.is_some()
    }

    /// A model that may be stored from now on, in the place of one that was not.
    pub(super) fn accept(&mut self, model: KeptModel<N>) {
        self.accepted = Some(model);
    }

    /// The processor stands.
    #[must_use]
    pub fn stands(&self, now_ns: u64) -> bool {
        now_ns < self.until_ns
    }

    /// A frame came; whether anybody can hear it now.
    pub(super) fn hear(&mut self, frame: &Frame, now_ns: u64) -> bool {
        let stands = self.stands(now_ns);
        if stands && self.heard.len() < QUEUE {
            self.heard.push(*frame);
        } else if stands {
            self.lost = true;
        }
        !stands
    }

    /// What came while the processor stood, and whether something of it was lost.
    pub(super) fn take_heard(&mut self) -> (Vec<Frame>, bool) {
        (core::mem::take(&mut self.heard), core::mem::take(&mut self.lost))
    }

    /// Whether something was kept or forgotten since this was asked.
    pub fn take_kept(&mut self) -> bool {
        core::mem::take(&mut self.has_kept)
    }

    /// A step, where one is due.
    pub(super) fn step<const B: usize>(&mut self, now_ns: u64, rig: &mut Rig<N, B>, memory: &mut Memory) {
        if now_ns < self.due_ns {
            return;
        }
        self.due_ns = now_ns + STEP_NS;
        let (before, state) = (memory.worked(), rig.state());
        let Levels { signals, registers, bus, .. } = &mut *rig.board;
        let inhibit = if self.unannounced { &self.unseen } else { &signals.inhibit };
        let Some(storage) = bus.as_ref().map(|bus| &bus.storage) else { return };
        let Some(mut keep) = storage.given() else {
            return self.storing.look_after(inhibit, registers);
        };
        if self.asked.is_none() {
            let model = self.accepted.map(|mut model| {
                model.provenance.generation = keep.generation + 1;
                model
            });
            self.asked = Some(Asked { what: keep.what, objects: keep.objects, model });
        }
        let Some(asked) = &self.asked else { return };
        let done = self.storing.step(inhibit, signals.permission(), registers, || {
            self.has_kept = true;
            memory.change(state, asked)
        });
        let after = memory.worked();
        let sectors = u64::from(after.1 - before.1);
        // One whose power failed is not erased whole.
        let words = (after.0 - before.0).saturating_sub(sectors * SECTOR as u64) / 4;
        if after != before {
            self.until_ns = now_ns + TICK_NS + words * WORD_NS + sectors * self.erasing_ns;
        }
        let Some(done) = done else { return };
        if let Some(generation) = asked.generation().filter(|_| done) {
            keep.generation = generation;
            self.accepted = None;
            if asked.what == Keeping::Defaults {
                signals.forget_stored();
            }
        }
        self.asked = None;
        keep.done = done;
        drop(keep);
        storage.give_back();
    }
}

impl<const N: usize> Default for Flashing<N> {
    fn default() -> Self {
        Self::new()
    }
}
