//! Sentences about a leg from the objects of its nodes.

use scarab::leg::{Activity, DriveState, IdentifyPhase, Step};

use crate::leg::activity_words;

/// State of a joint's drive, as its statusword shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct JointState {
    /// Place in [`STATES`]: joints that stand lower come first.
    place: usize,
}

/// Mask and value of the statusword's state bits, name, and event that ends the state, the farthest from
/// enabled first. Source: CiA 402, state coding of the statusword.
const STATES: [(u16, u16, &str, &str); 8] = [
    (0x4F, 0x08, "fault", "a reset by its host (controlword 80), with the cause gone"),
    (0x4F, 0x0F, "fault reaction active", "the end of the damping"),
    (0x4F, 0x00, "not ready to switch on", "the first tick without a fault"),
    (0x6F, 0x07, "quick stop active", "the end of the damping"),
    (0x4F, 0x40, "switch on disabled", "controlword 6 of its host"),
    (0x6F, 0x21, "ready to switch on", "controlword 7 of its host"),
    (0x6F, 0x23, "switched on", "controlword F of its host"),
    (0x6F, 0x27, "operation enabled", "commands of its host"),
];

impl JointState {
    /// State in a statusword (6041); `None` if its bits are those of no state.
    #[must_use]
    pub fn of(statusword: u16) -> Option<Self> {
        let place = STATES.iter().position(|(mask, value, ..)| statusword & mask == *value)?;
        Some(Self { place })
    }

    /// Name of the state.
    #[must_use]
    pub fn name(self) -> &'static str {
        STATES[self.place].2
    }

    /// Event that ends the state.
    #[must_use]
    pub fn waits_for(self) -> &'static str {
        STATES[self.place].3
    }

    /// Whether the joint is enabled.
    #[must_use]
    pub fn is_enabled(self) -> bool {
        self.place == STATES.len() - 1
    }

    /// Whether the state is that of a fault.
    #[must_use]
    pub fn has_fault(self) -> bool {
        self.place < 2
    }
}

/// Activity of a state number of 2100:2, with the motion of 2100:3.
#[must_use]
pub fn activity(state: u32, motion: u32) -> Option<Activity> {
    let motion = motion.saturating_sub(1) as u8;
    let phase = match state {
        0 => return Some(Activity::Idle),
        1 => IdentifyPhase::Approach,
        2 => IdentifyPhase::Excite,
        3 => IdentifyPhase::Settle,
        4 => IdentifyPhase::Solve,
        5 => IdentifyPhase::Validate { motion, step: Step::Approach },
        6 => IdentifyPhase::Validate { motion, step: Step::Run },
        7 => IdentifyPhase::Judge,
        8 => return Some(Activity::Track(Step::Run)),
        9 => return Some(Activity::Follow),
        _ => return None,
    };
    Some(Activity::Identify(phase))
}

/// What an enabled leg does.
#[must_use]
pub fn doing(activity: Option<Activity>, modes: &[Option<i32>]) -> String {
    match activity {
        Some(activity @ (Activity::Identify(_) | Activity::Track(_))) => {
            activity_words::doing(activity, DriveState::OperationEnabled)
        }
        _ => {
            let mut names: Vec<&str> = modes.iter().flatten().map(|mode| mode_name(*mode)).collect();
            names.dedup();
            let names = names.join(", ");
            if names.is_empty() { "follows its host".into() } else { format!("follows its host: {names}") }
        }
    }
}

/// Mode of operation (6060, 6061).
const fn mode_name(mode: i32) -> &'static str {
    match mode {
        0 => "holds its position",
        1 => "profile position",
        3 => "profile velocity",
        4 => "profile torque",
        6 => "homing",
        8 => "cyclic position",
        9 => "cyclic velocity",
        10 => "cyclic torque",
        _ => "unknown mode",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab::bus::drive::Mode;

    #[test]
    fn every_state_of_cia_402_has_its_word_and_reserved_bits_none() {
        // Other bits of the statusword do not matter.
        for (word, name) in [
            (0x0210, "not ready to switch on"),
            (0x8250, "switch on disabled"),
            (0x0231, "ready to switch on"),
            (0x0233, "switched on"),
            (0x1637, "operation enabled"),
            (0x0217, "quick stop active"),
            (0x021F, "fault reaction active"),
            (0x0218, "fault"),
        ] {
            assert_eq!(JointState::of(word).map(JointState::name), Some(name), "{word:04X}");
        }
        assert_eq!(JointState::of(0x0F | 0x40), None);
        let [off, on] = [0x0250, 0x0237].map(|word| JointState::of(word).expect("a state"));
        assert!(off < on && on.is_enabled() && !off.is_enabled());
    }

    #[test]
    fn modes_and_phases_are_named() {
        assert!(Mode::ALL.into_iter().all(|mode| mode_name(mode as i32) != "unknown mode"));
        assert_eq!(doing(None, &[Some(8), Some(8)]), "follows its host: cyclic position");
        assert_eq!(doing(None, &[None, None]), "follows its host");
        assert_eq!(doing(activity(6, 2), &[Some(8)]), "runs unused motion 2 of 3 (gait-3)");
        assert_eq!(activity(11, 0), None);
    }
}
