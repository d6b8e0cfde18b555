//! Words of the closed lists: one for each state, activity, fault and refusal. They never change.
//!
//! No match has a wildcard: a new state needs a word to compile. Faults, refusals to enable and the ends of
//! assistance have their words where they are listed.

use crate::leg::{
    Activity, AssistNote, AssistPhase, AxisFault, CalibrationRefusal, Cause, DriveState, IdentifyPhase,
    Parameter, Segment, Step,
};

/// Word for the drive state.
pub const fn drive(state: DriveState) -> &'static str {
    match state {
        DriveState::NotReadyToSwitchOn => "not_ready",
        DriveState::SwitchOnDisabled => "switch_on_disabled",
        DriveState::ReadyToSwitchOn => "ready_to_switch_on",
        DriveState::SwitchedOn => "switched_on",
        DriveState::OperationEnabled => "operation_enabled",
        DriveState::QuickStopActive { .. } => "quick_stop_active",
        DriveState::FaultReactionActive { .. } => "fault_reaction_active",
        DriveState::Fault { .. } => "fault",
    }
}

/// Words for the activity and its phase (`-` without one), and the held-out motion from 1 (0 without one).
pub const fn activity(activity: Activity) -> (&'static str, &'static str, u8) {
    match activity {
        Activity::Idle => ("idle", "-", 0),
        Activity::Identify(phase) => match phase {
            IdentifyPhase::Approach => ("identify", "approach", 0),
            IdentifyPhase::Excite => ("identify", "excite", 0),
            IdentifyPhase::Settle => ("identify", "settle", 0),
            IdentifyPhase::Solve => ("identify", "solve", 0),
            IdentifyPhase::Validate { motion, step: Step::Approach } => {
                ("identify", "validate_approach", motion.saturating_add(1))
            }
            IdentifyPhase::Validate { motion, step: Step::Run } => {
                ("identify", "validate", motion.saturating_add(1))
            }
            IdentifyPhase::Judge => ("identify", "judge", 0),
        },
        Activity::Track(Step::Approach) => ("track", "approach", 0),
        Activity::Track(Step::Run) => ("track", "run", 0),
        Activity::Follow => ("follow", "-", 0),
        Activity::Assist(AssistPhase::Enter) => ("assist", "enter", 0),
        Activity::Assist(AssistPhase::Run) => ("assist", "run", 0),
        Activity::Assist(AssistPhase::Leave) => ("assist", "leave", 0),
    }
}

/// Words for the event of a session of assistance and for its reason.
pub(crate) const fn assist(note: AssistNote) -> (&'static str, &'static str) {
    match note {
        AssistNote::Refused(why) => ("refused", why.name()),
        AssistNote::Ending(why) => ("ending", why.name()),
    }
}

/// Word for the use of a logged sample, and the held-out motion from 1.
pub const fn segment(segment: Option<Segment>) -> (&'static str, u8) {
    match segment {
        None => ("-", 0),
        Some(Segment::Training) => ("training", 0),
        Some(Segment::Validation(motion)) => ("validation", motion.saturating_add(1)),
        Some(Segment::Tracking) => ("tracking", 0),
    }
}

/// Word for a fault by which an axis turned its outputs off.
pub const fn axis_fault(fault: AxisFault) -> &'static str {
    match fault {
        AxisFault::CurrentSense => "current_sense",
        AxisFault::Overcurrent => "overcurrent",
        AxisFault::BusVoltage => "bus_voltage",
        AxisFault::Encoder => "encoder",
        AxisFault::NotANumber => "not_a_number",
        AxisFault::EncoderFrozen => "encoder_frozen",
        AxisFault::OpenPhase => "open_phase",
        AxisFault::CurrentOffset => "current_zero",
        AxisFault::StuckConversion => "stuck_conversion",
        AxisFault::Parameters => "parameters",
    }
}

/// Word for the cause of a change, and the link of a payload from 1.
pub(crate) const fn cause(cause: Cause) -> (&'static str, u8) {
    match cause {
        Cause::Payload { link } => ("payload", (link as u8).saturating_add(1)),
        Cause::Friction => ("friction", 0),
        Cause::Nothing => ("nothing", 0),
        Cause::Unexplained => ("unexplained", 0),
    }
}

/// Unit of a parameter as one word.
pub(crate) const fn unit(parameter: Parameter) -> &'static str {
    match parameter {
        Parameter::XX
        | Parameter::XY
        | Parameter::XZ
        | Parameter::YY
        | Parameter::YZ
        | Parameter::ZZ
        | Parameter::IA => "kg_m2",
        Parameter::HX | Parameter::HY | Parameter::HZ => "kg_m",
        Parameter::M => "kg",
        Parameter::FC | Parameter::OFF => "N_m",
        Parameter::FV => "N_m_s/rad",
    }
}

/// Word for the refusal of a calibration.
pub const fn calibration(refusal: CalibrationRefusal) -> &'static str {
    use CalibrationRefusal as Why;
    match refusal {
        Why::Overcurrent => "overcurrent",
        Why::CurrentSense => "current_sense",
        Why::BusVoltage => "bus_voltage",
        Why::ShuntOffset(_) => "shunt_zero",
        Why::Turning => "turning",
        Why::PhaseOpen(_) => "phase_open",
        Why::ShuntInverted(_) => "shunt_inverted",
        Why::ShuntsInverted => "shunts_inverted",
        Why::ShuntsSwapped => "shunts_swapped",
        Why::CurrentDirection => "current_direction",
        Why::PhaseImbalance => "phase_imbalance",
        Why::MotorConstants => "motor_constants",
        Why::OtherMotor(..) => "other_motor",
        Why::Flux(_) => "flux",
        Why::TimeOut => "time_out",
        Why::NoCounts => "no_counts",
        Why::Direction => "direction",
        Why::PolePairs { .. } => "pole_pairs",
        Why::CountsPerTurn { .. } => "counts_per_turn",
        Why::Slipped => "slipped",
        Why::Load(_) => "load",
        Why::Travel => "travel",
        Why::NoIndex => "no_index",
        Why::IndexMoved => "index_moved",
        Why::StoredOffset(_) => "stored_offset",
        Why::Moved => "moved",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leg::{FaultCode, RefusalReason};

    #[test]
    fn a_unit_is_the_report_s_with_its_spaces_closed() {
        for parameter in Parameter::ALL {
            let spaced = parameter.unit().bytes().map(|byte| if byte == b' ' { b'_' } else { byte });
            assert!(spaced.eq(unit(parameter).bytes()), "{parameter:?}");
        }
    }

    #[test]
    fn every_word_can_stand_behind_a_key() {
        let words = [
            drive(DriveState::NotReadyToSwitchOn),
            activity(Activity::Idle).1,
            activity(Activity::Identify(IdentifyPhase::Validate { motion: 2, step: Step::Run })).1,
            segment(Some(Segment::Validation(0))).0,
            FaultCode::Overspeed.name(),
            RefusalReason::Moving.name(),
            axis_fault(AxisFault::NotANumber),
            cause(Cause::Payload { link: 1 }).0,
            calibration(CalibrationRefusal::CountsPerTurn { stated: 8192, found: 4000 }),
        ];
        for word in words {
            assert!(!word.is_empty() && !word.contains([' ', '[']), "{word}");
        }
    }
}
