//! Thread: what outlives the power is written, in the only way in which the board stands it.
//!
//! The flash's one bank stands still while it is written or erased, for up to two seconds a sector, and with it every level. So, in this order:
//!
//! ```text
//! refused         unless the drive is off
//! interlock       `storing`: both bridges released by the next current tick, the servo keeps its drive off, a calibration ends
//! hosts           told by an emergency message (FF01): heartbeats may pause; 20 ms for it to leave
//! watchdog        8 s instead of 16 ms
//! flash           written; it looks at the bridges' registers itself
//! watchdog        16 ms
//! interlock       let go a millisecond later, when both current loops have ticked again; hosts are told (0000, or 5530)
//! ```
//!
//! Time stands meanwhile for everybody who counts it (`board::odrive_v3_6::flash`), and the current loops do not count the gap while `storing`
//! is raised. What an emergency stop does to bridges that are off is what it does after.

use core::pin::pin;
use core::task::{Context, Poll, Waker};

use embassy_time::Timer;

use super::bus::{Keep, KeeperEnd};
use super::interlock::{self, Cause};
use super::leg::{JOINTS, Leg};
use super::servo;
use crate::board::odrive_v3_6::flash::Flash;
use crate::board::odrive_v3_6::watchdog;
use crate::bus::LONGEST;
use crate::bus::station::Keeping;
use crate::leg::IdentifiedModel;
use crate::store::{KeptModel, Key, Permit, Store};

/// Looks for something to do so often, ms.
const ROUND_MS: u64 = 10;
/// For the hosts to be told, ms: two messages of 135 bits at 125 kbit/s and what stands before them.
const ANNOUNCED_MS: u64 = 20;
const KEYS: [Key; JOINTS] = [Key::Objects1, Key::Objects2];

/// The store and who asks for it.
pub struct Keeper {
    store: Store<Flash>,
    end: Option<KeeperEnd>,
    /// Accepted since something was kept last.
    accepted: Option<KeptModel<JOINTS>>,
}

/// Runs to its end at once: the flash never lets anybody wait.
fn at_once<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

impl Keeper {
    /// Of this flash; `None` where it does not fit, which no board of this kind is.
    #[must_use]
    pub fn new(flash: Flash, bytes: u32) -> Option<Self> {
        Some(Self { store: Store::new(flash, 0..bytes).ok()?, end: None, accepted: None })
    }

    /// Who asks for it from now on.
    pub fn serve(&mut self, end: KeeperEnd) {
        self.end = Some(end);
    }

    /// What is kept of a node: so many bytes; `None` where it cannot be read.
    pub fn objects(&mut self, joint: usize, into: &mut [u8; LONGEST]) -> Option<usize> {
        let key = *KEYS.get(joint)?;
        Some(at_once(self.store.load_bytes(key, into))?.ok()?.unwrap_or(0))
    }

    /// The model that is kept and its generation, if it is this leg's.
    pub fn model(&mut self, leg: &Leg) -> Option<(IdentifiedModel<JOINTS>, u32)> {
        let kept = at_once(self.store.load::<KeptModel<JOINTS>>(Key::Model))?.ok()??;
        Some((leg.restore(&kept.model).ok()?, kept.provenance.generation))
    }

    #[inline(never)]
    fn change(&mut self, keep: &mut Keep) -> Option<()> {
        let permit = Permit::under(servo::permission())?;
        if keep.what == Keeping::Defaults {
            return at_once(self.store.forget_all(&permit))?.ok();
        }
        for (key, (bytes, length)) in KEYS.into_iter().zip(&keep.objects) {
            at_once(self.store.save_bytes(&permit, key, bytes.get(..*length)?))?.ok()?;
        }
        if let Some(mut model) = self.accepted {
            model.provenance.generation = keep.generation.wrapping_add(1);
            at_once(self.store.save(&permit, Key::Model, &model))?.ok()?;
            (self.accepted, keep.generation) = (None, model.provenance.generation);
        }
        Some(())
    }
}

/// Runs for ever.
#[embassy_executor::task]
pub async fn run(keeper: &'static mut Keeper) -> ! {
    loop {
        Timer::after_millis(ROUND_MS).await;
        let Some(end) = &mut keeper.end else { continue };
        if let Some(model) = end.accepted.dequeue() {
            keeper.accepted = Some(model);
        }
        let Some(keep) = end.keep.dequeue() else { continue };
        keep.done = false;
        // Where motors brake themselves, or anything else forbids to enable, nothing is written: it would let them go.
        if Permit::under(servo::permission()).is_some() && interlock::is_clear() {
            interlock::raise(Cause::Storing);
            Timer::after_millis(ANNOUNCED_MS).await;
            watchdog::stretch();
            keep.done = keeper.change(keep).is_some();
            watchdog::tighten();
            Timer::after_millis(1).await;
            interlock::stored();
        }
        if let Some(end) = &mut keeper.end {
            let _ = end.kept.enqueue(keep);
        }
    }
}
