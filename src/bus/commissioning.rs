//! Objects 2160 and 2170: commissioning steps that a host asks for, and the telemetry of the board.
//!
//! ```text
//! 2160:1  command: 1 calibrate, 2 take the reference, 3 reset     passed on once, see `operation::Operator`
//! 2160:2  state of the board, bits                                2160:3 to :6  result of the last command
//! 2170    inhibit reasons, temperatures, phase currents, longest interrupts
//! ```
//!
//! Both exist at each node; temperatures and currents are those of the node's axis. A host has the rights of
//! the operator's start button and no others: the same code accepts or refuses both. The enabling switch
//! stays with the operator.

use super::abort::Abort;
use crate::listed::listed;

listed! {
    /// Step of commissioning that a host asks for.
    #[repr(u8)]
    pub enum CommissioningStep {
        /// All steps, in the order of their numbers.
        ALL;
        /// Calibrate all axes. The motors turn, unless stored values can be checked at standstill.
        Calibrate = 1;
        /// Take the joints' present pose as their zero.
        Reference = 2;
        /// Clear faults and inhibit reasons.
        Reset = 3;
    }
}

impl CommissioningStep {
    /// Returns the step with this number.
    pub(crate) fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|step| *step as u32 == number)
    }
}

listed! {
    /// Progress or result of the last step (2160:3).
    #[derive(Default)]
    #[repr(u8)]
    pub enum StepResult {
        /// All results, in the order of their numbers.
        ALL,
        /// Words of the data sheet.
        words;
        /// No step since the start.
        #[default]
        None = 0, "none";
        /// Not ended yet.
        UnderWay = 1, "under way";
        /// Succeeded.
        Done = 2, "done";
        /// Refused: the enabling switch is open.
        SwitchOpen = 3, "the enabling switch is open";
        /// Refused: the enabling switch is closed.
        SwitchClosed = 4, "the enabling switch is closed";
        /// Refused: since the start or the last reset the operator's contacts were not open at the same time.
        ContactsNotOpened = 5, "the contacts were not open together since the start";
        /// Refused: an inhibit reason is set.
        Inhibited = 6, "an inhibit reason is set";
        /// Refused: the drive is on.
        DriveOn = 7, "the drive is on";
        /// Refused: a calibration is under way.
        Calibrating = 8, "a calibration is under way";
        /// Refused: the axes are calibrated, or the joints have their zeros.
        AlreadyDone = 9, "done before";
        /// Refused: an axis is not calibrated.
        NotCalibrated = 10, "an axis is not calibrated";
        /// Failed: the calibration refused an axis (2160:4 and 5 say which, and why).
        CalibrationRefused = 11, "the calibration refused an axis";
        /// Failed: the calibration was interrupted by switch, inhibit reason or fault.
        Interrupted = 12, "the calibration was interrupted";
        /// Failed: a joint moved, or its encoder did not answer.
        JointMoved = 13, "a joint moved, or its encoder did not answer";
    }
}

/// Result of the last step, and the axis and reason of a refused calibration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct StepReport {
    /// Progress or result.
    pub(crate) result: u8,
    /// Axis that the calibration refused, from 1.
    pub(crate) axis: u8,
    /// Reason, see [`crate::leg::CalibrationRefusal::number`].
    pub(crate) reason: u8,
    /// Number beside the reason, see [`crate::leg::CalibrationRefusal::detail`]; 255 if it is larger.
    pub(crate) detail: u8,
}

impl StepReport {
    /// Report without a refused axis.
    pub const fn new(result: StepResult) -> Self {
        Self { result: result as u8, axis: 0, reason: 0, detail: 0 }
    }
}

/// State of the board, bits of 2160:2.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BoardState(pub u8);

impl BoardState {
    /// Every axis is calibrated.
    pub const CALIBRATED: u8 = 1;
    /// The joints have their zeros.
    pub const REFERENCED: u8 = 1 << 1;
    /// A calibration is under way.
    pub(crate) const CALIBRATING: u8 = 1 << 2;
    /// The enabling switch is closed and counts.
    pub const SWITCH_CLOSED: u8 = 1 << 3;
}

/// State and telemetry of a board with `N` axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BoardStatus<const N: usize> {
    /// State of the board.
    pub(crate) state: BoardState,
    /// Result of the last step.
    pub(crate) report: StepReport,
    /// Inhibit reasons, one bit each.
    pub(crate) causes: u32,
    /// Temperature of each bridge, degrees Celsius.
    pub(crate) bridge_c: [f32; N],
    /// Temperature of each winding, degrees Celsius.
    pub(crate) winding_c: [f32; N],
    /// Currents in the phases B and C of each motor, A; that in A is minus their sum.
    pub(crate) currents_a: [[f32; 2]; N],
    /// Longest interrupt of the current loops and longest tick of the servo, ns, in the last report's time.
    pub(crate) longest_ns: [u32; 2],
}

impl<const N: usize> BoardStatus<N> {
    /// State before the first report.
    pub const NONE: Self = Self {
        state: BoardState(0),
        report: StepReport::new(StepResult::None),
        causes: 0,
        bridge_c: [f32::NAN; N],
        winding_c: [f32::NAN; N],
        currents_a: [[0.0; 2]; N],
        longest_ns: [0; 2],
    };
}

/// Objects 2160 and 2170 of a board.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BoardObjects<const N: usize> {
    status: BoardStatus<N>,
    command: u8,
    asked: Option<CommissioningStep>,
}

/// Low bytes of a number that saturates.
fn fixed(value: f32, unit: f32) -> u32 {
    // The conversion of NaN is 0, which would be a plausible temperature.
    let number = if value.is_nan() { i16::MIN } else { (value / unit) as i16 };
    i32::from(number).cast_unsigned()
}

impl<const N: usize> BoardObjects<N> {
    /// Objects before the first report.
    pub(crate) const NEW: Self = Self { status: BoardStatus::NONE, command: 0, asked: None };

    /// Takes over the board's state.
    pub(crate) fn update(&mut self, status: &BoardStatus<N>) {
        self.status = *status;
        if self.asked.is_some() {
            self.status.report = StepReport::new(StepResult::UnderWay);
        }
    }

    /// Takes the step that a host asked for.
    pub(crate) fn take_step(&mut self) -> Option<CommissioningStep> {
        self.asked.take()
    }

    /// Reads 2160.
    pub(super) fn commissioning(&self, sub: u8) -> Result<u32, Abort> {
        let StepReport { result, axis, reason, detail } = self.status.report;
        Ok(u32::from(match sub {
            1 => self.command,
            2 => self.status.state.0,
            3 => result,
            4 => axis,
            5 => reason,
            6 => detail,
            _ => return Err(Abort::NoSubindex),
        }))
    }

    /// Writes 2160:1; 0 asks for nothing.
    pub(super) fn ask(&mut self, sub: u8, value: u32) -> Result<(), Abort> {
        let step = CommissioningStep::from_number(value);
        if sub != 1 || value != 0 && step.is_none() {
            return Err(Abort::Range);
        }
        self.command = value as u8;
        if step.is_some() {
            self.asked = step;
            self.status.report = StepReport::new(StepResult::UnderWay);
        }
        Ok(())
    }

    /// Reads 2170 of a node.
    pub(super) fn telemetry(&self, joint: usize, sub: u8) -> Result<u32, Abort> {
        let status = &self.status;
        let of_joint = |values: &[f32; N]| values.get(joint).copied().unwrap_or(f32::NAN);
        let current = |phase: usize| {
            status.currents_a.get(joint).and_then(|phases| phases.get(phase)).copied().unwrap_or(f32::NAN)
        };
        let [current_ns, servo_ns] = status.longest_ns;
        Ok(match sub {
            1 => status.causes,
            2 => fixed(of_joint(&status.bridge_c), 0.1),
            3 => fixed(of_joint(&status.winding_c), 0.1),
            4 => fixed(-current(0) - current(1), 0.01),
            5 => fixed(current(0), 0.01),
            6 => fixed(current(1), 0.01),
            7 => current_ns,
            8 => servo_ns,
            _ => return Err(Abort::NoSubindex),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_passed_on_once_and_hides_the_result_of_the_one_before() {
        let mut board = BoardObjects::<2>::NEW;
        let done = BoardStatus { report: StepReport::new(StepResult::Done), ..BoardStatus::NONE };
        board.update(&done);
        assert_eq!(board.commissioning(3), Ok(StepResult::Done as u32));
        assert_eq!(board.ask(1, 4), Err(Abort::Range));
        assert_eq!(board.ask(1, CommissioningStep::Reference as u32), Ok(()));
        board.update(&done);
        assert_eq!(board.commissioning(3), Ok(StepResult::UnderWay as u32));
        assert_eq!(board.take_step(), Some(CommissioningStep::Reference));
        assert_eq!(board.take_step(), None);
    }

    #[test]
    fn telemetry_has_the_units_of_the_data_sheet() {
        let mut board = BoardObjects::<2>::NEW;
        assert_eq!(board.telemetry(0, 2), Ok(i32::from(i16::MIN).cast_unsigned()), "unknown");
        board.update(&BoardStatus {
            causes: 5,
            bridge_c: [41.26, 50.0],
            winding_c: [30.0, -12.3],
            currents_a: [[0.0; 2], [12.5, -30.25]],
            longest_ns: [6500, 40_000],
            ..BoardStatus::NONE
        });
        let read = |joint, sub| board.telemetry(joint, sub).expect("an object").cast_signed();
        assert_eq!([read(0, 2), read(1, 3), read(1, 5), read(1, 6)], [412, -123, 1250, -3025]);
        assert_eq!([read(1, 4), read(0, 1), read(0, 7), read(1, 8)], [1775, 5, 6500, 40_000]);
    }
}
