//! Thread: the flash is changed, in the only way in which the board stands it.
//!
//! The flash's one bank stands still while it is written or erased, for up to two seconds a sector, and with it every level. So, in this order:
//!
//! ```text
//! refused         unless the drive is off and nothing forbids to enable
//! interlock       `storing`: both bridges released by the next current tick, the servo keeps its drive off, a calibration ends
//! hosts           told by an emergency message (FF0D): heartbeats may pause; 20 ms for it to leave
//! refused         unless the drive is off still: it may have been enabled between the first look and the interlock
//! watchdog        8 s instead of 16 ms, read back; refused where it does not take them
//! flash           changed; it looks at the bridges' and the brake resistor's registers itself
//! watchdog        16 ms, read back; where it does not take them nothing is enabled until it does
//! interlock       let go a millisecond later, when both current loops have ticked again
//! ```
//!
//! Each wait is one of whole milliseconds: a step is taken in every one of them, and none waits itself.
//!
//! Where motors brake themselves, or anything else forbids to enable, nothing is written: it would let them go.

use super::signals::Inhibit;
use crate::hal::Hardware;
use crate::leg::Permission;
use crate::safety::Cause;

/// For the hosts to be told, ms: two messages of 135 bits at 125 kbit/s and what stands before them.
const ANNOUNCED_MS: u32 = 20;
/// For the watchdog to take another time, ms: six cycles of its oscillator (17 kHz at the slowest) behind a divider of 256 take 91.
const PATIENCE_MS: u32 = 200;

/// How far a change has come, and for how many milliseconds more that is waited for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// None is under way.
    #[default]
    Idle,
    /// Hosts are told.
    Announced(u32),
    /// The watchdog is to have its longer time.
    Stretches(u32),
    /// It is to have its usual time; whether the flash was changed.
    Tightens(u32, bool),
    /// The interlock is let go next.
    Settles(bool),
}

/// What is known between two steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Storing {
    stage: Stage,
    /// The watchdog has not taken its usual time again.
    loose: bool,
}

impl Default for Storing {
    fn default() -> Self {
        Self::new()
    }
}

impl Storing {
    /// Nothing changed yet. The watchdog may still have the start's time, until [`Self::look_after`] has asked it.
    #[must_use]
    pub const fn new() -> Self {
        Self { stage: Stage::Idle, loose: true }
    }

    /// One step of a change, to be called every millisecond until it returns whether the change was made. `change` is called at most
    /// once and returns whether it succeeded; `permission` is what the drive may do now.
    pub fn step<const N: usize>(
        &mut self,
        inhibit: &Inhibit,
        permission: Permission,
        hardware: &mut impl Hardware<N>,
        change: impl FnOnce() -> bool,
    ) -> Option<bool> {
        let is_off = |causes| permission == Permission::Released && inhibit.causes() == causes;
        self.stage = match self.stage {
            Stage::Idle if self.loose || !is_off(0) => return Some(false),
            Stage::Idle => {
                inhibit.raise(Cause::Storing);
                Stage::Announced(ANNOUNCED_MS - 1)
            }
            Stage::Announced(left @ 1..) => Stage::Announced(left - 1),
            // A drive that was on when the inhibit word was raised is released by now, or still damps.
            Stage::Announced(0) if !is_off(Cause::Storing.bit()) => Stage::Settles(false),
            Stage::Announced(0) => {
                self.loose = true;
                Stage::Stretches(PATIENCE_MS)
            }
            Stage::Stretches(_) if hardware.stretch_watchdog() => Stage::Tightens(PATIENCE_MS, change()),
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

    /// To be called regularly while no change is under way: asks a watchdog that did not take its usual time once more.
    pub fn look_after<const N: usize>(&mut self, inhibit: &Inhibit, hardware: &mut impl Hardware<N>) {
        self.loose = self.loose && !hardware.tighten_watchdog();
        self.forbid_while_loose(inhibit);
    }

    fn forbid_while_loose(&self, inhibit: &Inhibit) {
        if self.loose {
            inhibit.raise(Cause::Watchdog);
        }
    }
}

#[cfg(test)]
mod tests;
