//! Steps of commissioning that a host asks for, and their reports.

use super::*;
use crate::bus::commissioning::{BoardState, CommissioningStep, StepReport, StepResult};

/// Asks for a step with these contacts and returns the report after a tenth of a second.
fn ask(bench: &mut Bench, step: CommissioningStep, enabling: bool) -> StepReport {
    bench.hold(enabling, false);
    bench.signals.ask(step);
    assert_eq!(bench.signals.board_status().report, StepReport::new(StepResult::UnderWay));
    bench.hold(enabling, false);
    bench.signals.board_status().report
}

fn state(bench: &Bench) -> u8 {
    bench.signals.board_status().state.0
}

#[test]
fn a_host_commissions_the_board_without_a_button() {
    use CommissioningStep::{Calibrate, Reference};
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
    assert_eq!(ask(&mut bench, Calibrate, false), StepReport::new(StepResult::SwitchOpen));
    assert_eq!(ask(&mut bench, Reference, false), StepReport::new(StepResult::NotCalibrated));
    assert_eq!(ask(&mut bench, Calibrate, true), StepReport::new(StepResult::UnderWay));
    assert_eq!(state(&bench), BoardState::CALIBRATING | BoardState::SWITCH_CLOSED);
    for axis in 0..2 {
        assert_eq!(bench.signals.board_status().report, StepReport::new(StepResult::UnderWay));
        bench.ends(axis, Outcome::Calibrated(measured()));
    }
    assert_eq!(bench.signals.board_status().report, StepReport::new(StepResult::Done));
    assert_eq!(ask(&mut bench, Reference, true), StepReport::new(StepResult::SwitchClosed));
    assert_eq!(ask(&mut bench, Reference, false), StepReport::new(StepResult::UnderWay));
    // A joint that stands for a second.
    (0..10).for_each(|_| drop(bench.hold(false, false)));
    assert_eq!(bench.signals.board_status().report, StepReport::new(StepResult::Done));
    assert_eq!(state(&bench), BoardState::CALIBRATED | BoardState::REFERENCED);
    assert_eq!(ask(&mut bench, Reference, false), StepReport::new(StepResult::AlreadyDone));
}

#[test]
fn a_failed_calibration_is_reported_with_axis_and_reason() {
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
    ask(&mut bench, CommissioningStep::Calibrate, true);
    bench.ends(0, Outcome::Calibrated(measured()));
    bench.ends(1, Outcome::Refused(CalibrationRefusal::NoIndex));
    let reason = CalibrationRefusal::NoIndex.number();
    let result = StepResult::CalibrationRefused as u8;
    assert_eq!(bench.signals.board_status().report, StepReport { result, axis: 2, reason, detail: 0 });
    // The next one begins with the axis that is missing, and its interruption has no axis.
    ask(&mut bench, CommissioningStep::Calibrate, true);
    bench.ends(1, Outcome::Interrupted);
    assert_eq!(bench.signals.board_status().report, StepReport::new(StepResult::Interrupted));
}

#[test]
fn a_reset_clears_the_inhibit_reasons_unless_the_switch_is_closed() {
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
    bench.signals.inhibit.raise(InhibitReason::EmergencyStop);
    assert_eq!(ask(&mut bench, CommissioningStep::Reset, true), StepReport::new(StepResult::SwitchClosed));
    assert!(!bench.signals.inhibit.is_clear());
    // Open for two seconds, as long as the button would be pressed.
    assert_eq!(ask(&mut bench, CommissioningStep::Reset, false), StepReport::new(StepResult::SwitchClosed));
    (0..20).for_each(|_| drop(bench.hold(false, false)));
    assert_eq!(ask(&mut bench, CommissioningStep::Reset, false), StepReport::new(StepResult::Done));
    assert!(bench.signals.inhibit.is_clear());
}
