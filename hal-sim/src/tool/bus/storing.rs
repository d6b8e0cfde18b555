//! What hosts want kept of a board, in the board's own order (`operation::Storing`), and a processor that stands meanwhile.
//!
//! ```text
//! hosts are told, 20 ms later the flash is changed: each word 16 us, each sector that is erased 1 to 2 s (STM32F405, data sheet)
//! for that time the processor stands: frames of others wait in the controller's queue of three, what comes then is lost
//! ```

use scarab::bus::station::Keeping;
use scarab::bus::{Frame, KeptNode};
use scarab::leg::Permission;
use scarab::operation::{Storing, StoringBoard};
use scarab::safety::Cause;
use scarab::store::KeptModel;

use super::board::TICK_NS;
use super::memory::{Memory, SECTOR};
use crate::tool::faults::rig::Rig;

/// A step of `Storing`.
const STEP_NS: u64 = 1_000_000;
/// A word of four bytes takes so long to program, and a sector to erase.
const WORD_NS: u64 = 16_000;
const ERASING_NS: u64 = 1_000_000_000;
/// Of the controller's receiving queue.
const QUEUE: usize = 3;
/// The watchdog's 8 s instead of 16 ms.
const STRETCHED: u64 = 500;

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
    /// The accepted model is in the memory, or was forgotten with it.
    pub model_kept: bool,
    /// Something was kept or forgotten.
    has_kept: bool,
    /// The next step.
    due_ns: u64,
    /// The processor stands until then.
    until_ns: u64,
    /// What the controller heard meanwhile, and that it lost something; told once, it is over with the next tick.
    heard: Vec<Frame>,
    lost: bool,
    recovers: bool,
    /// A sector is erased in this time.
    pub erasing_ns: u64,
    /// For campaigns that are blind: the interlock is not told.
    pub unannounced: bool,
    raised: bool,
}

impl<const N: usize> Flashing<N> {
    /// Nothing asked.
    #[must_use]
    pub fn new() -> Self {
        Self {
            storing: Storing::new(),
            asked: None,
            model_kept: false,
            has_kept: false,
            due_ns: 0,
            until_ns: 0,
            heard: Vec::new(),
            lost: false,
            recovers: false,
            erasing_ns: ERASING_NS,
            unannounced: false,
            raised: false,
        }
    }

    /// A change is asked for and has not ended.
    #[must_use]
    pub fn is_under_way(&self) -> bool {
        self.asked.is_some()
    }

    pub(super) fn ask(&mut self, asked: Asked<N>) {
        self.asked = Some(asked);
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
        self.recovers = self.lost;
        (core::mem::take(&mut self.heard), core::mem::take(&mut self.lost))
    }

    /// A loss was told and is over.
    pub(super) fn recovers(&mut self) -> bool {
        core::mem::take(&mut self.recovers)
    }

    /// Whether something was kept or forgotten since this was asked.
    pub fn take_kept(&mut self) -> bool {
        core::mem::take(&mut self.has_kept)
    }

    /// A step, where one is due; how a change ended, and what was asked.
    pub(super) fn step<const B: usize>(
        &mut self,
        now_ns: u64,
        rig: &mut Rig<N, B>,
        memory: &mut Memory,
    ) -> Option<(bool, Asked<N>)> {
        if now_ns < self.due_ns {
            return None;
        }
        self.due_ns = now_ns + STEP_NS;
        let (before, state) = (memory.worked(), rig.state());
        let mut board = Ports { rig, unannounced: self.unannounced, raised: &mut self.raised };
        let Some(asked) = &self.asked else {
            self.storing.look_after(&mut board);
            return None;
        };
        let done = self.storing.step(&mut board, || {
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
        let asked = done.and_then(|_| self.asked.take())?;
        let done = done?;
        self.model_kept |= done && asked.generation().is_some();
        Some((done, asked))
    }
}

impl<const N: usize> Default for Flashing<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// A rig, as a change of the flash has it.
struct Ports<'a, const N: usize, const B: usize> {
    rig: &'a mut Rig<N, B>,
    unannounced: bool,
    raised: &'a mut bool,
}

impl<const N: usize, const B: usize> StoringBoard for Ports<'_, N, B> {
    fn permission(&self) -> Permission {
        self.rig.state().permission()
    }

    fn causes(&self) -> u32 {
        let unseen = if self.unannounced && *self.raised { Cause::Storing.bit() } else { 0 };
        self.rig.causes() | unseen
    }

    fn raise(&mut self, cause: Cause) {
        *self.raised = true;
        if !self.unannounced {
            self.rig.raise(cause);
        }
    }

    fn stored(&mut self) {
        *self.raised = false;
        self.rig.stored();
    }

    fn stretch(&mut self) -> bool {
        self.rig.stretch(STRETCHED);
        true
    }

    fn tighten(&mut self) -> bool {
        self.rig.stretch(1);
        true
    }
}
