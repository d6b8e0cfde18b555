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
use super::queues::HousekeepingEnds;
use super::signals::Signals;
use super::stage::{Order, Outcome};
use crate::hal::{AxisSample, Contacts, Hardware, JointSample};
use crate::leg::{AxisFault, Calibration, ControlRequest, DriveState, PowerRequest, StoredCalibration};
use crate::motor::reference::{ReferenceStep, StatedPose};
use crate::motor::{Axis, AxisConfiguration, CalibrationSettings, Calibrator};
use crate::real::max;
use crate::safety::{Cause, UpkeepClock, of_gate_driver, of_temperature};
use crate::trace::{Record, words};
use crate::units::Hertz;

/// Rounds of a reset for which the gate drivers are off, and until they can be configured: 2 and 22 ms.
const GATES_ON: u8 = 1;
const GATES_READY: u8 = 12;

/// What the housekeeping is built from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HousekeepingSettings<const N: usize> {
    /// Configuration of each axis.
    pub axes: [AxisConfiguration; N],
    /// Limits of a calibration of each axis.
    pub calibration: [CalibrationSettings; N],
    /// A bridge that is not cooler is too hot, degrees Celsius.
    pub hottest_c: f32,
}

/// What a round reads and writes.
struct Level<'a, 'q, const N: usize, H> {
    ends: &'a mut HousekeepingEnds<'q, N>,
    signals: &'a Signals<N>,
    hardware: &'a mut H,
}

impl<const N: usize, H> Level<'_, '_, N, H> {
    fn order(&mut self, axis: usize, order: Order) {
        if let Some(orders) = self.ends.orders.get_mut(axis) {
            let _ = orders.enqueue(order);
        }
    }

    /// Asks the servo; whether there was room. While a host has the drive, closing the enabling switch permits and does not ask.
    fn request(&mut self, request: ControlRequest<N>) -> bool {
        let enables = matches!(request, ControlRequest::Power(power) if power.enables());
        !(enables && self.signals.is_hosted()) && self.ends.requests.enqueue(request).is_ok()
    }

    fn record(&mut self, record: Record<N>) {
        if self.ends.notes.enqueue(record).is_err() {
            self.signals.statistics.records_lost.add();
        }
    }
}

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

    /// One round, with the count of it that the watchdog waits for, and whether the operator lets the leg be enabled.
    pub fn round<H: Hardware<N>>(
        &mut self,
        ends: &mut HousekeepingEnds<'_, N>,
        signals: &Signals<N>,
        hardware: &mut H,
    ) {
        signals.statistics.rounds.add();
        self.act(&mut Level { ends, signals, hardware });
        signals.set_permits(self.permits());
        signals.set_calibrated(self.is_calibrated());
    }

    fn act(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        self.round = self.round.wrapping_add(1);
        if self.advance_reset(level) {
            return;
        }
        self.look(level);
        let situation = self.situation(level);
        if let Some(ask) = self.operator.tick(&situation) {
            self.accept(ask, level);
        }
        self.advance_reference(level);
    }

    /// The operator lets the leg be enabled by whoever commands it; never while a reset is under way.
    fn permits(&self) -> bool {
        self.resetting.is_none() && self.operator.holds()
    }

    fn situation(&self, level: &Level<'_, '_, N, impl Hardware<N>>) -> Situation {
        let Contacts { enabling, start } = level.hardware.contacts();
        Situation {
            enabling,
            start,
            blocked: !level.signals.inhibit.is_clear()
                || matches!(self.drive, Some(DriveState::Fault { .. })),
            calibrated: self.is_calibrated(),
            calibrating: self.calibrating.is_some(),
            referenced: level.signals.has_begun(),
            drive: self.drive,
        }
    }

    fn is_calibrated(&self) -> bool {
        self.calibrated.iter().all(|calibrated| *calibrated)
    }

    fn look(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        while let Some(drive) = level.ends.drive.dequeue() {
            self.drive = Some(drive);
        }
        let due = self.clock.next();
        if due.gates {
            for axis in 0..N {
                if let Some(cause) = of_gate_driver(level.hardware.gate_holds(axis)) {
                    level.signals.inhibit.raise(cause);
                }
            }
        }
        if due.temperatures {
            // All are damped by the servo, which gives less torque from 20 degrees below on.
            let (mut hottest_c, most) = (f32::MIN, self.settings.hottest_c);
            for axis in 0..N {
                let degrees = level.hardware.temperature(axis);
                hottest_c = max(hottest_c, degrees.unwrap_or(most));
                if let Some(fault) = of_temperature(degrees, most) {
                    level.signals.report(fault, axis);
                }
            }
            level.signals.set_hottest_c(hottest_c);
        }
        for axis in 0..N {
            let outcome = level.ends.outcomes.get_mut(axis).and_then(|outcomes| outcomes.dequeue());
            if let Some(outcome) = outcome {
                self.hear(axis, &outcome, level);
            }
        }
        if level.signals.take_forgotten() {
            self.stored = [None; N];
        }
        self.tell_causes(level);
    }

    /// Records every cause that came since the last round; those of the gate drivers with the status of each driver.
    fn tell_causes(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let causes = level.signals.inhibit.causes();
        for cause in Cause::ALL.into_iter().filter(|cause| causes & !self.told & cause.bit() != 0) {
            let why = cause.name();
            level.record(Record::Refused { why, value: causes });
            if matches!(cause, Cause::GateFault | Cause::GateConfiguration) {
                for axis in 0..N {
                    let status = level.hardware.gate_status(axis);
                    level.record(Record::GateDriver { why, joint: axis as u8 + 1, status });
                }
            }
        }
        self.told = causes;
    }

    fn hear(&mut self, axis: usize, outcome: &Outcome, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let joint = axis as u8 + 1;
        match outcome {
            Outcome::Calibrated(calibration) => {
                level.record(found(joint, calibration));
                let _ = level.ends.calibrated.enqueue((axis, calibration.stored()));
                self.run_axis(axis, calibration, level);
            }
            Outcome::Refused(refusal) => {
                let (result, number) = words::calibration(*refusal);
                level.record(refused(joint, result, number));
                self.calibrating = None;
                // Not the motor that was kept, not as it was mounted then, or whatever else that led to: the next one is measured anew.
                if let Some(stored) = self.stored.get_mut(axis) {
                    *stored = None;
                }
            }
            Outcome::Interrupted => {
                level.record(refused(joint, "interrupted", 0));
                self.calibrating = None;
            }
            // The axis runs on, without a zero.
            Outcome::StoodStill => {
                level.record(Record::AxisFault { tick: self.round, joint, name: "zero_forgotten" });
                self.forget_zeros(level);
            }
            Outcome::Fault { fault, lost } => {
                level.record(Record::AxisFault { tick: self.round, joint, name: words::axis_fault(*fault) });
                if *lost {
                    self.forget_zeros(level);
                    if let Some(calibrated) = self.calibrated.get_mut(axis) {
                        *calibrated = false;
                    }
                    // A motor that brakes does so until a reset.
                    if *fault == AxisFault::Parameters {
                        level.order(axis, Order::Off);
                    }
                }
            }
        }
    }

    /// With a place goes the joint's zero, also one that is being looked for.
    fn forget_zeros(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        level.signals.end_servo();
        (self.drive, self.reference, self.placed) = (None, None, false);
    }

    /// An axis that passed runs from now on, released; then the next one is measured.
    fn run_axis(
        &mut self,
        axis: usize,
        calibration: &Calibration,
        level: &mut Level<'_, '_, N, impl Hardware<N>>,
    ) {
        let encoder_count = level.hardware.encoder_count(axis);
        let sample = AxisSample { encoder_count, ..AxisSample::default() };
        let running =
            self.settings.axes.get(axis).and_then(|axis| Axis::new(axis, calibration, &sample).ok());
        let (Some(running), Some(calibrated)) = (running, self.calibrated.get_mut(axis)) else {
            self.calibrating = None;
            return level.signals.inhibit.raise(Cause::Configuration);
        };
        *calibrated = true;
        // Its counts begin anew, without a zero.
        level.signals.end_servo();
        level.order(axis, Order::Run(running));
        let next = (axis + 1..N).find(|&next| !self.calibrated.get(next).copied().unwrap_or(true));
        self.calibrating = next;
        if let Some(next) = next {
            self.calibrate(next, level);
        }
    }

    fn calibrate(&mut self, axis: usize, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
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
                level.order(axis, Order::Calibrate(calibrator));
            }
            _ => level.signals.inhibit.raise(Cause::Configuration),
        }
    }

    fn accept(&mut self, ask: Ask, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let accepted = match ask {
            Ask::Power(request) => level.request(ControlRequest::Power(request)),
            // The servo tells what became of it.
            Ask::Identify => {
                level.request(ControlRequest::Identify);
                return;
            }
            Ask::Calibrate => {
                let first = self.calibrated.iter().position(|calibrated| !calibrated);
                if let Some(first) = first {
                    self.calibrate(first, level);
                }
                first.is_some()
            }
            Ask::EndCalibration => {
                // Asked in every round until it has ended.
                if let Some(axis) = self.calibrating {
                    level.order(axis, Order::Off);
                }
                return;
            }
            Ask::Reference => {
                let pose = StatedPose::new(Hertz(RATE_HZ as f32));
                self.reference = pose.map(|pose| [(pose, false); N]);
                self.reference.is_some()
            }
            Ask::Reset => {
                // Motors that brake are released first: drivers that restart measure currents with another gain.
                level.signals.inhibit.raise(Cause::GateConfiguration);
                level.hardware.release_all();
                level.hardware.switch_gates(false);
                self.resetting = Some(0);
                return;
            }
        };
        level.record(Record::Request { tick: self.round, name: ask.name(), accepted });
    }

    /// Gate drivers off and on again, faults forgotten: what still holds comes back. Whether a reset is under way.
    fn advance_reset(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) -> bool {
        let Some(rounds) = self.resetting else { return false };
        let rounds = rounds + 1;
        self.resetting = Some(rounds).filter(|rounds| *rounds < GATES_READY);
        if rounds == GATES_ON {
            level.hardware.switch_gates(true);
        }
        if self.resetting.is_some() {
            return true;
        }
        let configured = level.hardware.configure_gates();
        // A switch that was closed meanwhile is not one that is closed after the reset: both contacts have to be open once.
        self.operator = Operator::default();
        level.signals.inhibit.reset();
        if !configured {
            level.signals.inhibit.raise(Cause::GateConfiguration);
        }
        for axis in 0..N {
            level.order(axis, Order::ClearFault);
        }
        level.request(ControlRequest::Power(PowerRequest::ResetFault));
        level.record(Record::Request { tick: self.round, name: Ask::Reset.name(), accepted: true });
        true
    }

    fn advance_reference(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        if core::mem::take(&mut self.placed) && self.is_calibrated() {
            level.signals.begin_servo();
        }
        let Some(mut poses) = self.reference else { return };
        let mut standing = true;
        for (joint, (pose, found)) in poses.iter_mut().enumerate() {
            let counts =
                level.signals.statistics.counts.get(joint).map_or(0, |count| count.get().cast_signed());
            let sample = JointSample { encoder_counts: counts, ..JointSample::default() };
            match pose.tick(&sample) {
                ReferenceStep::Running(_) => {}
                ReferenceStep::Found(_) => *found = true,
                ReferenceStep::Refused(_) => standing = false,
            }
        }
        self.reference = Some(poses).filter(|_| standing);
        if !standing {
            level.record(Record::Request { tick: self.round, name: Ask::Reference.name(), accepted: false });
        } else if poses.iter().all(|(_, found)| *found) {
            self.reference = None;
            self.placed = true;
            for axis in 0..N {
                level.order(axis, Order::Place(0));
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
