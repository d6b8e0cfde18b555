//! Sentences about a leg from the objects of its nodes.

use scarab::leg::{Activity, DriveState, IdentifyPhase, Step};

use crate::activity_words;

/// State of a joint's drive, as its statusword shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct JointState {
    /// Index in [`STATES`]: joints that stand lower come first.
    index: usize,
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
    pub fn from_statusword(statusword: u16) -> Option<Self> {
        let index = STATES.iter().position(|(mask, value, ..)| statusword & mask == *value)?;
        Some(Self { index })
    }

    /// Name of the state.
    pub fn name(self) -> &'static str {
        STATES[self.index].2
    }

    /// Event that ends the state.
    pub fn waits_for(self) -> &'static str {
        STATES[self.index].3
    }

    /// Whether the joint is enabled.
    pub fn is_enabled(self) -> bool {
        self.index == STATES.len() - 1
    }

    /// Whether the motors may be energised.
    pub(crate) fn is_on(self) -> bool {
        matches!(
            self.name(),
            "fault reaction active" | "quick stop active" | "switched on" | "operation enabled"
        )
    }

    /// Whether the state is that of a fault.
    pub fn has_fault(self) -> bool {
        self.index < 2
    }
}

/// What an enabled leg does, by the state and the motion of its identification (2100:2, 3) and its modes.
pub fn doing(state: Option<u32>, motion: Option<u32>, modes: &[Option<i32>]) -> String {
    let phase = match (state, motion) {
        (Some(1), _) => IdentifyPhase::Approach,
        (Some(2), _) => IdentifyPhase::Excite,
        (Some(3), _) => IdentifyPhase::Settle,
        (Some(4), _) => IdentifyPhase::Solve,
        (Some(5), Some(motion)) => validate(motion, Step::Approach),
        (Some(6), Some(motion)) => validate(motion, Step::Run),
        (Some(5), None) => return "moves to the start of an unused motion".into(),
        (Some(6), None) => return "runs an unused motion".into(),
        (Some(7), _) => IdentifyPhase::Judge,
        (Some(8), _) => return "tracks a motion".into(),
        _ => return follows(modes),
    };
    activity_words::doing(Activity::Identify(phase), DriveState::OperationEnabled)
}

/// Phase of an unused motion, counted from 1.
const fn validate(motion: u32, step: Step) -> IdentifyPhase {
    IdentifyPhase::Validate { motion: motion.saturating_sub(1) as u8, step }
}

fn follows(modes: &[Option<i32>]) -> String {
    let mut names: Vec<&str> = modes.iter().flatten().map(|mode| mode_name(*mode)).collect();
    names.dedup();
    if names.is_empty() {
        "follows its host".into()
    } else {
        format!("follows its host: {}", names.join(", "))
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
        -1 => "impedance",
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
            assert_eq!(JointState::from_statusword(word).map(JointState::name), Some(name), "{word:04X}");
        }
        assert_eq!(JointState::from_statusword(0x0F | 0x40), None);
        let [off, on] = [0x0250, 0x0237].map(|word| JointState::from_statusword(word).expect("a state"));
        assert!(off < on && on.is_enabled() && !off.is_enabled());
        assert!(on.is_on() && !off.is_on());
    }

    #[test]
    fn modes_and_phases_are_named() {
        assert!(Mode::ALL.into_iter().all(|mode| mode_name(mode as i32) != "unknown mode"));
        assert_eq!(doing(None, None, &[Some(8), Some(8)]), "follows its host: cyclic position");
        assert_eq!(doing(Some(9), Some(0), &[None, None]), "follows its host");
        assert_eq!(doing(Some(6), Some(2), &[Some(8)]), "runs unused motion 2 of 3 (gait-3)");
        assert_eq!(doing(Some(6), None, &[Some(8)]), "runs an unused motion");
    }
}
