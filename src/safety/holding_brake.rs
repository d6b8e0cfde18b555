//! Spring-applied holding brake of a leg: when it is released, and from when on a motion may be commanded.
//!
//! Why: a leg whose bridges are off falls. Without power the brake is engaged, so it holds the leg in reset
//! and after a crash too.
//!
//! ```text
//! drive    off     | enabled, holds its pose  | follows commands | damps, 300 ms               | off
//! brake    engaged | released, one tick later | open             | released | engaged, closing  | closed
//! ```
//!
//! The brake is released one servo tick after the drive was enabled, when all bridges switch. It engages in
//! the tick in which the drive turns off, or `engage_ms` before the end of damping. Damping is not prolonged:
//! a brake slower than damping engages as damping begins, and closes after the bridges are off.
//!
//! Known limit: no sensor shows whether the brake is open or closed.

use super::state::DriveState;
use crate::hal::SERVO_RATE_HZ;

/// Servo ticks per millisecond.
const TICKS_PER_MS: u32 = SERVO_RATE_HZ / 1000;

/// Times that a holding brake needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrakeDelays {
    /// Time to open, ms.
    pub release_ms: u16,
    /// Time to close, ms.
    pub engage_ms: u16,
}

/// Command of a holding brake; see the module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HoldingBrake {
    release_ticks: u32,
    engage_ticks: u32,
    /// Ticks in a row in which the drive was on and not about to turn off.
    on_ticks: u32,
}

impl HoldingBrake {
    /// An engaged brake.
    pub const fn new(delays: BrakeDelays) -> Self {
        Self {
            release_ticks: delays.release_ms as u32 * TICKS_PER_MS,
            engage_ticks: delays.engage_ms as u32 * TICKS_PER_MS,
            on_ticks: 0,
        }
    }

    /// Takes the drive's state of this servo tick and returns whether the brake is released.
    #[must_use]
    pub(crate) const fn follow(&mut self, state: DriveState) -> bool {
        let is_on = match state {
            DriveState::OperationEnabled => true,
            DriveState::QuickStopActive { remaining_ticks }
            | DriveState::FaultReactionActive { remaining_ticks, .. } => remaining_ticks > self.engage_ticks,
            _ => false,
        };
        self.on_ticks = if is_on { self.on_ticks.saturating_add(1) } else { 0 };
        self.on_ticks > 1
    }

    /// Returns whether the brake has been released for the time it needs to open.
    pub(crate) const fn is_open(&self) -> bool {
        self.on_ticks > self.release_ticks + 1
    }
}

#[cfg(test)]
mod tests {
    use super::super::fault::{Fault, FaultCode};
    use super::*;

    const DELAYS: BrakeDelays = BrakeDelays { release_ms: 20, engage_ms: 30 };
    const FAULT: Fault = Fault { code: FaultCode::Overspeed, joint: 0 };

    fn enabled(ticks: u32) -> HoldingBrake {
        let mut brake = HoldingBrake::new(DELAYS);
        for _ in 0..ticks {
            let _ = brake.follow(DriveState::OperationEnabled);
        }
        brake
    }

    #[test]
    fn the_brake_is_released_a_tick_after_enabling_and_open_after_its_time() {
        let mut brake = HoldingBrake::new(DELAYS);
        assert!(!brake.follow(DriveState::SwitchedOn) && !brake.is_open());
        assert!(!brake.follow(DriveState::OperationEnabled), "the bridges do not switch yet");
        for _ in 0..80 {
            assert!(brake.follow(DriveState::OperationEnabled) && !brake.is_open());
        }
        assert!(brake.follow(DriveState::OperationEnabled) && brake.is_open());
    }

    #[test]
    fn the_brake_engages_before_damping_ends() {
        for damping in [
            |remaining_ticks| DriveState::QuickStopActive { remaining_ticks },
            |remaining_ticks| DriveState::FaultReactionActive { fault: FAULT, remaining_ticks },
        ] {
            let mut brake = enabled(1000);
            let released = (1..=1200).rev().filter(|&left| brake.follow(damping(left))).count();
            assert_eq!(released, 1200 - 120);
        }
        // A brake slower than damping engages as it begins.
        let mut slow = HoldingBrake { engage_ticks: 1600, ..enabled(1000) };
        assert!(!slow.follow(DriveState::QuickStopActive { remaining_ticks: 1200 }));
    }

    #[test]
    fn the_brake_engages_with_any_state_that_is_off() {
        use DriveState::{NotReadyToSwitchOn, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
        let states = [NotReadyToSwitchOn, SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn];
        for state in states.into_iter().chain([DriveState::Fault { fault: FAULT }]) {
            let mut brake = enabled(1000);
            assert!(brake.is_open() && !brake.follow(state) && !brake.is_open(), "{state:?}");
        }
    }
}
