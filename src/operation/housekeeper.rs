//! Level 6: the operator's contacts, gate drivers, temperatures, calibration and reference, resets.
//!
//! ```text
//! not calibrated --calibrate--> first axis --measured--> next axis --measured--> calibrated --reference--> begun
//!        ^                          |refused, let go                                 |             |
//!        +--------------------------+------------------------ a place or parameters lost ----------+
//! ```
//!
//! An axis of which a calibration was kept is checked against it: everything is measured again, and resistance, inductances and offset have to be
//! the kept ones. One that does not agree is refused, told, and measured anew the next time.
//!
//! A reset takes 24 ms: gate drivers off and on again, configured anew, then faults are forgotten and what still holds comes back.
//! Meanwhile nobody looks at their registers, and contacts do not count: afterwards both have to be open once.

use super::contacts::{Ask, Operator, RATE_HZ, Situation};
use super::stage::{Order, Outcome};
use crate::hal::{AxisSample, JointSample};
use crate::leg::{AxisFault, Calibration, ControlRequest, DriveState, PowerRequest, StoredCalibration};
use crate::motor::reference::{ReferenceStep, StatedPose};
use crate::motor::{Axis, Calibrator};
use crate::real::max;
use crate::safety::{Cause, UpkeepClock, of_gate_driver, of_temperature};
use crate::trace::{Record, words};
use crate::units::Hertz;

mod board;

pub use board::{HousekeepingBoard, HousekeepingSettings};

/// Rounds of a reset for which the gate drivers are off, and until they can be configured: 2 and 22 ms.
const GATES_ON: u8 = 1;
const GATES_READY: u8 = 12;

/// What is known between two rounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Housekeeper<const N: usize> {
    settings: HousekeepingSettings<N>,
    clock: UpkeepClock,
    operator: Operator,
    calibrated: [bool; N],
    /// Kept from before: checked at the motor where it is calibrated, instead of measured anew.
    stored: [Option<StoredCalibration>; N],
    /// The axis that is being calibrated.
    calibrating: Option<usize>,
    /// Joints that are waited for to stand still, and which of them have.
    reference: Option<[(StatedPose, bool); N]>,
    /// The zeros were set in the round before: the servo may begin.
    placed: bool,
    /// Rounds since a reset was asked for.
    resetting: Option<u8>,
    drive: Option<DriveState>,
    round: u32,
    told: u32,
}

impl<const N: usize> Housekeeper<N> {
    /// Nothing calibrated.
    #[must_use]
    pub fn new(settings: HousekeepingSettings<N>) -> Self {
        Self {
            settings,
            clock: UpkeepClock::new(RATE_HZ),
            operator: Operator::default(),
            calibrated: [false; N],
            stored: [None; N],
            calibrating: None,
            reference: None,
            placed: false,
            resetting: None,
            drive: None,
            round: 0,
            told: 0,
        }
    }

    /// Of axes that were calibrated and joints that were referenced elsewhere: they run, and the servo has begun.
    #[must_use]
    pub fn ready(settings: HousekeepingSettings<N>) -> Self {
        Self { calibrated: [true; N], ..Self::new(settings) }
    }

    /// With calibrations that were kept.
    #[must_use]
    pub fn with_stored(self, stored: [Option<StoredCalibration>; N]) -> Self {
        Self { stored, ..self }
    }

    /// One round.
    pub fn round(&mut self, board: &mut impl HousekeepingBoard<N>) {
        self.round = self.round.wrapping_add(1);
        if self.advance_reset(board) {
            return;
        }
        self.look(board);
        let situation = self.situation(board);
        if let Some(ask) = self.operator.tick(&situation) {
            self.accept(ask, board);
        }
        self.advance_reference(board);
    }

    /// The operator lets the leg be enabled by whoever commands it; never while a reset is under way.
    #[must_use]
    pub fn permits(&self) -> bool {
        self.resetting.is_none() && self.operator.holds()
    }

    fn situation(&self, board: &impl HousekeepingBoard<N>) -> Situation {
        let (enabling, start) = board.contacts();
        Situation {
            enabling,
            start,
            blocked: board.causes() != 0 || matches!(self.drive, Some(DriveState::Fault { .. })),
            calibrated: self.is_calibrated(),
            calibrating: self.calibrating.is_some(),
            referenced: board.has_begun(),
            drive: self.drive,
        }
    }

    fn is_calibrated(&self) -> bool {
        self.calibrated.iter().all(|calibrated| *calibrated)
    }

    fn look(&mut self, board: &mut impl HousekeepingBoard<N>) {
        while let Some(drive) = board.drive_state() {
            self.drive = Some(drive);
        }
        let due = self.clock.next();
        if due.gates {
            for axis in 0..N {
                if let Some(cause) = of_gate_driver(board.gate_holds(axis)) {
                    board.raise(cause);
                }
            }
        }
        if due.temperatures {
            // All are damped by the servo, which gives less torque from 20 degrees below on.
            let (mut hottest_c, most) = (f32::MIN, self.settings.hottest_c);
            for axis in 0..N {
                let degrees = board.temperature(axis);
                hottest_c = max(hottest_c, degrees.unwrap_or(most));
                if let Some(code) = of_temperature(degrees, most) {
                    board.report(code, axis);
                }
            }
            board.set_temperature(hottest_c);
        }
        for axis in 0..N {
            if let Some(outcome) = board.outcome(axis) {
                self.hear(axis, &outcome, board);
            }
        }
        if board.take_forgotten() {
            self.stored = [None; N];
        }
        self.tell_causes(board);
    }

    /// Every cause that has come since the last time.
    fn tell_causes(&mut self, board: &mut impl HousekeepingBoard<N>) {
        let causes = board.causes();
        for cause in Cause::ALL {
            if causes & !self.told & cause.bit() != 0 {
                let value = match cause {
                    Cause::GateFault | Cause::GateConfiguration => board.gate_status(),
                    _ => causes,
                };
                board.say(Record::Refused { why: cause.name(), value });
            }
        }
        self.told = causes;
    }

    fn hear(&mut self, axis: usize, outcome: &Outcome, board: &mut impl HousekeepingBoard<N>) {
        let joint = axis as u8 + 1;
        match outcome {
            Outcome::Calibrated(calibration) => {
                board.say(found(joint, calibration));
                board.calibrated(axis, calibration);
                self.run_axis(axis, calibration, board);
            }
            Outcome::Refused(refusal) => {
                let (result, number) = words::calibration(*refusal);
                board.say(refused(joint, result, number));
                self.calibrating = None;
                // Not the motor that was kept, not as it was mounted then, or whatever else that led to: the next one is measured anew.
                if let Some(stored) = self.stored.get_mut(axis) {
                    *stored = None;
                }
            }
            Outcome::Interrupted => {
                board.say(refused(joint, "interrupted", 0));
                self.calibrating = None;
            }
            // The axis runs on, without a zero.
            Outcome::StoodStill => {
                board.say(Record::AxisFault { tick: self.round, joint, name: "zero_forgotten" });
                self.forget_zeros(board);
            }
            Outcome::Fault { fault, lost } => {
                board.say(Record::AxisFault { tick: self.round, joint, name: words::axis_fault(*fault) });
                if *lost {
                    self.forget_zeros(board);
                    if let Some(calibrated) = self.calibrated.get_mut(axis) {
                        *calibrated = false;
                    }
                    // A motor that brakes does so until a reset.
                    if *fault == AxisFault::Parameters {
                        board.order(axis, Order::Off);
                    }
                }
            }
        }
    }

    /// With a place goes the joint's zero, also one that is being looked for.
    fn forget_zeros(&mut self, board: &mut impl HousekeepingBoard<N>) {
        board.end_servo();
        (self.drive, self.reference, self.placed) = (None, None, false);
    }

    /// An axis that passed runs from now on, released; then the next one is measured.
    fn run_axis(&mut self, axis: usize, calibration: &Calibration, board: &mut impl HousekeepingBoard<N>) {
        let sample = AxisSample { encoder_count: board.encoder_count(axis), ..AxisSample::default() };
        let running =
            self.settings.axes.get(axis).and_then(|axis| Axis::new(axis, calibration, &sample).ok());
        let (Some(running), Some(calibrated)) = (running, self.calibrated.get_mut(axis)) else {
            self.calibrating = None;
            return board.raise(Cause::Configuration);
        };
        *calibrated = true;
        // Its counts begin anew, without a zero.
        board.end_servo();
        board.order(axis, Order::Run(running));
        let next = (axis + 1..N).find(|&next| !self.calibrated.get(next).copied().unwrap_or(true));
        self.calibrating = next;
        if let Some(next) = next {
            self.calibrate(next, board);
        }
    }

    fn calibrate(&mut self, axis: usize, board: &mut impl HousekeepingBoard<N>) {
        let settings = self.settings.axes.get(axis).zip(self.settings.calibration.get(axis));
        let stored = self.stored.get(axis).copied().flatten();
        let calibrator = settings.map(|(axis, settings)| match stored {
            // One of another configuration is of no use.
            Some(stored) => {
                Calibrator::from_stored(axis, *settings, stored).or_else(|_| Calibrator::new(axis, *settings))
            }
            None => Calibrator::new(axis, *settings),
        });
        match calibrator {
            Some(Ok(calibrator)) => {
                self.calibrating = Some(axis);
                board.order(axis, Order::Calibrate(calibrator));
            }
            _ => board.raise(Cause::Configuration),
        }
    }

    fn accept(&mut self, ask: Ask, board: &mut impl HousekeepingBoard<N>) {
        let accepted = match ask {
            Ask::Power(request) => board.request(ControlRequest::Power(request)),
            // The servo tells what became of it.
            Ask::Identify => {
                board.request(ControlRequest::Identify);
                return;
            }
            Ask::Calibrate => {
                let first = self.calibrated.iter().position(|calibrated| !calibrated);
                if let Some(first) = first {
                    self.calibrate(first, board);
                }
                first.is_some()
            }
            Ask::EndCalibration => {
                // Asked in every round until it has ended.
                if let Some(axis) = self.calibrating {
                    board.order(axis, Order::Off);
                }
                return;
            }
            Ask::Reference => {
                let pose = StatedPose::new(Hertz(RATE_HZ as f32));
                self.reference = pose.map(|pose| [(pose, false); N]);
                self.reference.is_some()
            }
            Ask::Reset => {
                board.switch_gates(false);
                self.resetting = Some(0);
                return;
            }
        };
        board.say(Record::Request { tick: self.round, name: ask.name(), accepted });
    }

    /// Gate drivers off and on again, faults forgotten: what still holds comes back. Whether a reset is under way.
    fn advance_reset(&mut self, board: &mut impl HousekeepingBoard<N>) -> bool {
        let Some(rounds) = self.resetting else { return false };
        let rounds = rounds + 1;
        self.resetting = Some(rounds).filter(|rounds| *rounds < GATES_READY);
        if rounds == GATES_ON {
            board.switch_gates(true);
        }
        if self.resetting.is_some() {
            return true;
        }
        let configured = board.configure_gates();
        // A switch that was closed meanwhile is not one that is closed after the reset: both contacts have to be open once.
        self.operator = Operator::default();
        board.reset_interlock();
        if !configured {
            board.raise(Cause::GateConfiguration);
        }
        for axis in 0..N {
            board.order(axis, Order::ClearFault);
        }
        board.request(ControlRequest::Power(PowerRequest::ResetFault));
        board.say(Record::Request { tick: self.round, name: Ask::Reset.name(), accepted: true });
        true
    }

    fn advance_reference(&mut self, board: &mut impl HousekeepingBoard<N>) {
        if core::mem::take(&mut self.placed) && self.is_calibrated() {
            board.begin_servo();
        }
        let Some(mut poses) = self.reference else { return };
        let mut standing = true;
        for (joint, (pose, found)) in poses.iter_mut().enumerate() {
            let sample = JointSample { encoder_counts: board.joint_counts(joint), ..JointSample::default() };
            match pose.tick(&sample) {
                ReferenceStep::Running(_) => {}
                ReferenceStep::Found(_) => *found = true,
                ReferenceStep::Refused(_) => standing = false,
            }
        }
        self.reference = Some(poses).filter(|_| standing);
        if !standing {
            board.say(Record::Request { tick: self.round, name: Ask::Reference.name(), accepted: false });
        } else if poses.iter().all(|(_, found)| *found) {
            self.reference = None;
            self.placed = true;
            for axis in 0..N {
                board.order(axis, Order::Place(0));
            }
        }
    }
}

fn found<const N: usize>(joint: u8, calibration: &Calibration) -> Record<N> {
    let [zero_b, zero_c] = calibration.zeros();
    Record::Calibration {
        joint,
        result: "done",
        number: 0,
        resistance_ohm: calibration.resistance().0,
        direct_h: calibration.direct_inductance().0,
        quadrature_h: calibration.quadrature_inductance().0,
        offset_turns: calibration.offset().turns(),
        zero_b,
        zero_c,
    }
}

fn refused<const N: usize>(joint: u8, result: &'static str, number: u32) -> Record<N> {
    Record::Calibration {
        joint,
        result,
        number,
        resistance_ohm: f32::NAN,
        direct_h: f32::NAN,
        quadrature_h: f32::NAN,
        offset_turns: f32::NAN,
        zero_b: f32::NAN,
        zero_c: f32::NAN,
    }
}

#[cfg(test)]
mod tests;
