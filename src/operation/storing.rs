//! Sequence of a flash write, at thread level.
//!
//! The flash has one bank, so writing or erasing stalls every level: up to 0.5 s for a sector of stored
//! parameters, 2 s for one of a new image. Therefore this order:
//!
//! ```text
//! refused         unless the drive is off and no inhibit reason forbids it ([`Purpose`]); a supply of the
//!                processor that is too low becomes an inhibit reason
//! interlock       `storing`: the next current tick turns both bridges off, the servo keeps its drive off, a
//!                calibration ends
//! hosts           an emergency message (FF0D) announces a pause of the heartbeats; 20 ms to send it
//! refused         unless the same still holds: the drive may have been enabled between the first check and
//!                the interlock
//! watchdog        4 s instead of 16 ms, read back; refused if it does not take them
//! flash           written; the write itself checks the bridges' and the brake resistor's registers
//! watchdog        16 ms, read back; the drive stays off until the watchdog takes them
//! interlock       cleared a millisecond later, when both current loops have ticked again
//! ```
//!
//! Each step takes one millisecond and returns at once; longer waits are several steps.
//!
//! While motors brake nothing is written: a write would turn them off. Parameters are not stored with any
//! other inhibit reason either; a new image is, since it may be what the board lacks.

use super::signals::Inhibit;
use crate::hal::Hardware;
use crate::leg::Permission;
use crate::safety::{Bridges, InhibitReason};

/// Time for the announcement, ms: two messages of 135 bits at 125 kbit/s and the frames before them.
const ANNOUNCED_MS: u32 = 20;
/// Time for the watchdog to take another period, ms: six cycles of its oscillator (17 kHz at the slowest)
/// behind a divider of 256 take 91 ms.
const PATIENCE_MS: u32 = 200;

/// Progress of a flash write; numbers are milliseconds left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// No write in progress.
    #[default]
    Idle,
    /// The announcement is being sent.
    Announced(u32),
    /// Waits for the watchdog to take its longer period.
    Stretches(u32),
    /// Waits for the watchdog to take its usual period; contains whether the flash was changed.
    Tightens(u32, bool),
    /// The interlock is cleared next.
    Settles(bool),
}

/// What the flash is changed for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Stored parameters; not while any inhibit reason is set.
    Parameters,
    /// The program: also on a board that an inhibit reason keeps off, but not while motors brake.
    Program,
}

impl Purpose {
    /// Whether these inhibit reasons, that of the write itself left out, permit the change.
    const fn permits(self, causes: u32) -> bool {
        match self {
            Self::Parameters => causes == 0,
            Self::Program => !matches!(Bridges::from_causes(causes), Bridges::Brake),
        }
    }
}

/// State between two steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Storing {
    stage: Stage,
    /// The watchdog has not taken its usual period again.
    loose: bool,
}

impl Storing {
    /// State after the start. The watchdog may still have the start's period, until [`Self::supervise`] has
    /// checked.
    pub const fn new() -> Self {
        Self { stage: Stage::Idle, loose: true }
    }

    /// Runs one step of a write. Call it every millisecond until it returns whether the write succeeded.
    /// `change` is called in each step until it returns whether it succeeded; `permission` is the drive's
    /// present one. `purpose` must not change before the end.
    pub fn step<const N: usize>(
        &mut self,
        inhibit: &Inhibit,
        permission: Permission,
        purpose: Purpose,
        hardware: &mut impl Hardware<N>,
        change: impl FnOnce() -> Option<bool>,
    ) -> Option<bool> {
        let others = inhibit.causes() & !InhibitReason::Storing.bit();
        let is_permitted = permission == Permission::Off && purpose.permits(others);
        let is_low = is_permitted && hardware.processor_supply_is_low();
        if is_low && matches!(self.stage, Stage::Idle | Stage::Announced(0)) {
            inhibit.raise(InhibitReason::ProcessorSupply);
        }
        let is_permitted = is_permitted && !is_low;
        self.stage = match self.stage {
            Stage::Idle if self.loose || !is_permitted => return Some(false),
            Stage::Idle => {
                inhibit.raise(InhibitReason::Storing);
                Stage::Announced(ANNOUNCED_MS - 1)
            }
            Stage::Announced(left @ 1..) => Stage::Announced(left - 1),
            // A drive that was on when the inhibit word was set is off by now, or still damps.
            Stage::Announced(0) if !is_permitted => Stage::Settles(false),
            Stage::Announced(0) => {
                self.loose = true;
                Stage::Stretches(PATIENCE_MS)
            }
            Stage::Stretches(_) if hardware.stretch_watchdog() => match change() {
                Some(changed) => Stage::Tightens(PATIENCE_MS, changed),
                None => Stage::Stretches(PATIENCE_MS),
            },
            Stage::Stretches(0) => Stage::Tightens(PATIENCE_MS, false),
            Stage::Stretches(left) => Stage::Stretches(left - 1),
            Stage::Tightens(left, changed) => {
                self.loose = !hardware.tighten_watchdog();
                match left.checked_sub(1) {
                    Some(left) if self.loose => Stage::Tightens(left, changed),
                    _ => Stage::Settles(changed),
                }
            }
            Stage::Settles(changed) => {
                self.forbid_while_loose(inhibit);
                inhibit.end_storing();
                self.stage = Stage::Idle;
                return Some(changed);
            }
        };
        None
    }

    /// Call regularly while no write is in progress: tries again to set the watchdog's usual period.
    pub fn supervise<const N: usize>(&mut self, inhibit: &Inhibit, hardware: &mut impl Hardware<N>) {
        self.loose = self.loose && !hardware.tighten_watchdog();
        self.forbid_while_loose(inhibit);
    }

    fn forbid_while_loose(&self, inhibit: &Inhibit) {
        if self.loose {
            inhibit.raise(InhibitReason::Watchdog);
        }
    }
}

#[cfg(test)]
mod tests;
