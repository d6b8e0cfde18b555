//! Describes what a leg does and waits for, in sentences without their subject.

use scarab::leg::{Activity, AssistPhase, DriveState, IdentifyPhase, Step, VALIDATION_MOTIONS};

use scarab_base::names::VALIDATION_NAMES;

/// Present activity.
pub fn doing(activity: Activity, state: DriveState) -> String {
    match activity {
        Activity::Idle if state.is_enabled() => "holds its pose".into(),
        Activity::Idle => "is off".into(),
        Activity::Identify(IdentifyPhase::Approach) => "moves to the start of the exciting motion".into(),
        Activity::Identify(IdentifyPhase::Excite) => "runs the exciting motion to identify from".into(),
        Activity::Identify(IdentifyPhase::Settle | IdentifyPhase::Judge) => "rests after the motion".into(),
        Activity::Identify(IdentifyPhase::Solve) => "rests while the solver works".into(),
        Activity::Identify(IdentifyPhase::Validate { motion, step }) => {
            let name = VALIDATION_NAMES.get(usize::from(motion)).copied().unwrap_or("?");
            let unused = format!("unused motion {} of {VALIDATION_MOTIONS} ({name})", motion + 1);
            match step {
                Step::Approach => format!("moves to the start of {unused}"),
                Step::Run => format!("runs {unused}"),
            }
        }
        Activity::Track(Step::Approach) => "moves to the start of the tracked motion".into(),
        Activity::Track(Step::Run) => "tracks a motion".into(),
        Activity::Follow => "follows its host".into(),
        Activity::Assist(AssistPhase::Enter) => "fades its assistance in".into(),
        Activity::Assist(AssistPhase::Run) => "assists its wearer".into(),
        Activity::Assist(AssistPhase::Leave) => "fades its assistance out".into(),
    }
}

/// Event that ends the present phase.
pub const fn waits_for(activity: Activity, state: DriveState) -> &'static str {
    match state {
        DriveState::NotReadyToSwitchOn => "the first tick without a fault",
        DriveState::SwitchOnDisabled => "the request `shutdown`, the first of three that enable",
        DriveState::ReadyToSwitchOn => "the request `switch on`, the second of three that enable",
        DriveState::SwitchedOn => "the request `enable operation`",
        DriveState::QuickStopActive { .. } | DriveState::FaultReactionActive { .. } => {
            "the end of the damping"
        }
        DriveState::Fault { .. } => "a reset by the operator, with the cause gone",
        DriveState::OperationEnabled => match activity {
            Activity::Idle => "a request of the operator",
            Activity::Follow => "commands of its host",
            Activity::Assist(AssistPhase::Enter | AssistPhase::Leave) => "the end of the fade",
            Activity::Assist(AssistPhase::Run) => "the end of the session",
            Activity::Identify(IdentifyPhase::Settle) => "the last samples",
            Activity::Identify(IdentifyPhase::Solve) => "the end of the search",
            Activity::Identify(IdentifyPhase::Judge) => "the verdict",
            Activity::Identify(IdentifyPhase::Approach)
            | Activity::Identify(IdentifyPhase::Validate { step: Step::Approach, .. })
            | Activity::Track(Step::Approach) => "the end of the approach",
            Activity::Identify(IdentifyPhase::Excite)
            | Activity::Identify(IdentifyPhase::Validate { step: Step::Run, .. })
            | Activity::Track(Step::Run) => "the end of the motion",
        },
    }
}

/// Reason why the drive is not enabled; empty while it is.
pub fn not_enabled(state: DriveState) -> String {
    match (state.is_enabled(), state.fault()) {
        (true, _) => String::new(),
        (false, Some(fault)) => format!("fault {:#06x}: {}", fault.code as u16, fault.code.words()),
        (false, None) => "no request to enable it, or one to switch it off".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_faulted_leg_is_off_and_waits_for_its_operator() {
        let fault = scarab::leg::Fault { code: scarab::leg::FaultCode::Overspeed, joint: 1 };
        let state = DriveState::Fault { fault };
        assert_eq!(doing(Activity::Idle, state), "is off");
        assert_eq!(waits_for(Activity::Idle, state), "a reset by the operator, with the cause gone");
        assert!(not_enabled(state).starts_with("fault 0x8400: "), "{}", not_enabled(state));
        assert_eq!(not_enabled(DriveState::OperationEnabled), "");
    }

    #[test]
    fn unused_motions_are_named_as_in_the_report() {
        let activity = Activity::Identify(IdentifyPhase::Validate { motion: 1, step: Step::Run });
        let words = doing(activity, DriveState::OperationEnabled);
        assert_eq!(words, "runs unused motion 2 of 3 (gait-3)");
        assert_eq!(waits_for(activity, DriveState::OperationEnabled), "the end of the motion");
    }
}
