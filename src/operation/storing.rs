//! Thread: the flash is changed, in the only way in which the board stands it.
//!
//! The flash's one bank stands still while it is written or erased, for up to two seconds a sector, and with it every level. So, in this order:
//!
//! ```text
//! refused         unless the drive is off and nothing forbids to enable
//! interlock       `storing`: both bridges released by the next current tick, the servo keeps its drive off, a calibration ends
//! hosts           told by an emergency message (FF01): heartbeats may pause; 20 ms for it to leave
//! refused         unless the drive is off still: it may have been enabled between the first look and the interlock
//! watchdog        8 s instead of 16 ms, read back; refused where it does not take them
//! flash           changed; it looks at the bridges' and the brake resistor's registers itself
//! watchdog        16 ms, read back; where it does not take them nothing is enabled until it does
//! interlock       let go a millisecond later, when both current loops have ticked again
//! ```
//!
//! Where motors brake themselves, or anything else forbids to enable, nothing is written: it would let them go.

use crate::leg::Permission;
use crate::safety::Cause;

/// For the hosts to be told, ms: two messages of 135 bits at 125 kbit/s and what stands before them.
const ANNOUNCED_MS: u64 = 20;
/// For the watchdog to take another time, ms: six cycles of its oscillator (17 kHz at the slowest) behind a divider of 256 take 91.
const PATIENCE_MS: u32 = 200;

/// What a change of the flash needs of a board. But for the waits every method answers at once.
pub trait StoringBoard {
    /// What the drive may do.
    fn permission(&self) -> Permission;
    /// Why nothing may be enabled: the interlock's bits.
    fn causes(&self) -> u32;
    /// One more.
    fn raise(&mut self, cause: Cause);
    /// [`Cause::Storing`] is let go.
    fn stored(&mut self);
    /// Asks the watchdog for as long as the flash may stand; whether it has that now.
    fn stretch(&mut self) -> bool;
    /// Asks the watchdog for its usual time; whether it has that now.
    fn tighten(&mut self) -> bool;
    /// Everybody else has the time.
    fn wait_ms(&mut self, milliseconds: u64) -> impl Future<Output = ()>;
}

/// What is known between two changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Storing {
    /// The watchdog has not taken its usual time again.
    loose: bool,
}

impl Storing {
    /// Nothing changed yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { loose: false }
    }

    /// The whole way; whether `change` was done and said so.
    pub async fn change(&mut self, board: &mut impl StoringBoard, change: impl FnOnce() -> bool) -> bool {
        if self.loose || board.permission() != Permission::Released || board.causes() != 0 {
            return false;
        }
        board.raise(Cause::Storing);
        board.wait_ms(ANNOUNCED_MS).await;
        // Who was on when the interlock came is released by now, and may still be damping.
        let is_off = board.permission() == Permission::Released && board.causes() == Cause::Storing.bit();
        let mut changed = false;
        if is_off {
            self.loose = true;
            changed = takes(board, |board| board.stretch()).await && change();
            self.loose = !takes(board, |board| board.tighten()).await;
            self.forbid_while_loose(board);
        }
        board.wait_ms(1).await;
        board.stored();
        changed
    }

    /// To be called again and again: a watchdog that did not take its usual time is asked once more.
    pub fn look_after(&mut self, board: &mut impl StoringBoard) {
        self.loose = self.loose && !board.tighten();
        self.forbid_while_loose(board);
    }

    fn forbid_while_loose(&self, board: &mut impl StoringBoard) {
        if self.loose {
            board.raise(Cause::Watchdog);
        }
    }
}

/// Asks the watchdog until it has what it is asked for, or is not waited for any longer.
async fn takes<B: StoringBoard>(board: &mut B, ask: impl Fn(&mut B) -> bool) -> bool {
    for _ in 0..PATIENCE_MS {
        if ask(board) {
            return true;
        }
        board.wait_ms(1).await;
    }
    false
}

#[cfg(test)]
mod tests;
