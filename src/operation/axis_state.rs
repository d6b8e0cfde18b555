//! State of one axis: off, under calibration, or running.
//!
//! Until an axis runs, its counter and index pulses are followed, so that a stored calibration can be checked
//! without motion ([`IndexSearch`]).

use crate::hal::{AxisCommand, AxisSample};
use crate::leg::{Calibration, CalibrationRefusal};
use crate::motor::{Axis, AxisFault, AxisRequest, BridgeRequest, CalibrationStep, Calibrator, IndexSearch};
use crate::safety::Bridges;
use crate::units::Hertz;

/// Order for an axis, effective from its next tick.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Turn the outputs off.
    Off,
    /// Calibrate, with the index that was found until now.
    Calibrate(Calibrator),
    /// Control the current.
    Run(Axis),
    /// Set the joint's position to these counts.
    SetCounts(i32),
    /// Count the rotor position as lost: an absolute encoder contradicts it.
    LosePosition,
    /// Set the bandwidth of the current loop.
    Bandwidth(Hertz),
    /// Clear a fault.
    ClearFault,
}

/// Event of an axis for the housekeeping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The calibration succeeded.
    Calibrated(Calibration),
    /// The calibration was refused.
    Refused(CalibrationRefusal),
    /// The interlock or an order ended the calibration.
    Interrupted,
    /// The axis turned its outputs off, or brakes.
    Fault {
        /// Kind of fault.
        fault: AxisFault,
        /// A new calibration is required.
        lost: bool,
    },
    /// An index pulse came while the axis was off.
    Index(IndexSearch),
    /// The flash was erased. The joint may have moved by any amount during the erase, so its zero is unknown.
    StoodStill,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum AxisMode {
    Off,
    Calibrating(Calibrator),
    Running(Axis),
}

/// State of one axis; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisState {
    mode: AxisMode,
    /// Fault that was already reported.
    faulted: Option<AxisFault>,
    /// Index pulses since the axis was last calibrated, for the next calibration.
    search: IndexSearch,
}

impl AxisState {
    /// Initial state: outputs off.
    pub const OFF: Self = Self { mode: AxisMode::Off, faulted: None, search: IndexSearch::EMPTY };

    /// A running axis that was calibrated elsewhere.
    pub const fn running(axis: Axis) -> Self {
        Self { mode: AxisMode::Running(axis), ..Self::OFF }
    }

    /// Returns whether the axis has a calibration.
    pub const fn is_running(&self) -> bool {
        matches!(self.mode, AxisMode::Running(_))
    }

    /// The axis, if it runs.
    #[inline(always)]
    pub fn axis_mut(&mut self) -> Option<&mut Axis> {
        match &mut self.mode {
            AxisMode::Running(axis) => Some(axis),
            AxisMode::Off | AxisMode::Calibrating(_) => None,
        }
    }

    /// The fault of a running axis.
    pub fn fault(&self) -> Option<AxisFault> {
        match &self.mode {
            AxisMode::Running(axis) => axis.fault(),
            AxisMode::Off | AxisMode::Calibrating(_) => None,
        }
    }

    /// Square of the motor's current vector at this tick, A^2.
    #[inline(always)]
    pub(crate) const fn square_a2(&self) -> f32 {
        match &self.mode {
            AxisMode::Off => 0.0,
            AxisMode::Calibrating(calibrator) => calibrator.square_a2(),
            AxisMode::Running(axis) => axis.square_a2(),
        }
    }

    /// Executes an order. Returns a calibration that it interrupts, or a lost rotor position.
    #[inline(never)]
    pub fn apply_order(&mut self, order: Order) -> Option<Outcome> {
        match order {
            Order::Off => {
                let measuring = matches!(self.mode, AxisMode::Calibrating(_));
                self.mode = AxisMode::Off;
                return measuring.then_some(Outcome::Interrupted);
            }
            Order::Calibrate(mut calibrator) => {
                calibrator.take_index(&self.search);
                self.mode = AxisMode::Calibrating(calibrator);
            }
            Order::Run(axis) => *self = Self::running(axis),
            Order::SetCounts(counts) => {
                if let Some(axis) = self.axis_mut() {
                    axis.set_counts(counts);
                }
            }
            Order::LosePosition => {
                if let Some(axis) = self.axis_mut() {
                    axis.lose_position();
                }
            }
            Order::Bandwidth(bandwidth) => {
                if let Some(axis) = self.axis_mut() {
                    axis.set_bandwidth(bandwidth);
                }
            }
            Order::ClearFault => {
                // A lost rotor position stays lost until a new calibration, so the fault is reported again. A
                // braking motor is turned off and has to be calibrated as well.
                let fault = self.fault();
                let is_lost = self.axis_mut().is_some_and(|axis| !axis.clear_fault());
                self.faulted = None;
                if is_lost {
                    self.mode = AxisMode::Off;
                    return fault.map(|fault| Outcome::Fault { fault, lost: true });
                }
            }
        }
        None
    }

    /// Resumes after a flash write, during which no tick ran and the bridge was off. `long` marks a stall in
    /// which the joint's motion is unknown. Returns whether there is an axis that followed the motion before.
    #[cold]
    #[inline(never)]
    pub(crate) fn stood_still(&mut self, sample: &AxisSample, long: bool) -> bool {
        // Counter and index of an axis that is not calibrated may have missed a pulse.
        self.search = IndexSearch::EMPTY;
        let axis = self.axis_mut();
        axis.map(|axis| axis.resume(sample, long)).is_some()
    }

    /// Runs one PWM period. Returns the bridge's command for the next one; `react` gets an event to report
    /// and may replace the command. Its flag states whether the bridge was requested to switch; it is
    /// `false` without a fault.
    ///
    /// Why a closure: a returned outcome, 64 bytes, would be copied in every tick.
    #[inline(always)]
    pub fn tick(
        &mut self,
        sample: &AxisSample,
        bridges: Bridges,
        target: AxisRequest,
        react: impl FnOnce(Outcome, bool, AxisCommand) -> AxisCommand,
    ) -> AxisCommand {
        let AxisMode::Running(running) = &mut self.mode else {
            return match self.tick_before(sample, bridges) {
                (command, None) => command,
                (command, Some(outcome)) => react(outcome, false, command),
            };
        };
        let request = match bridges {
            Bridges::Follow => target.into(),
            Bridges::Brake => BridgeRequest::Brake,
            Bridges::Off => BridgeRequest::Off,
        };
        let command = running.act(sample, request);
        match running.fault() {
            Some(fault) if self.faulted != Some(fault) => {
                self.faulted = Some(fault);
                let lost = running.is_lost();
                react(Outcome::Fault { fault, lost }, request != BridgeRequest::Off, command)
            }
            _ => command,
        }
    }

    /// Runs one PWM period of an axis that is off or under calibration. Not inlined: a running axis never
    /// needs it.
    #[inline(never)]
    fn tick_before(&mut self, sample: &AxisSample, bridges: Bridges) -> (AxisCommand, Option<Outcome>) {
        // Also during a calibration: an interrupted check at standstill can be repeated at once.
        let has_pulse = self.search.follow(sample);
        let AxisMode::Calibrating(calibrator) = &mut self.mode else {
            return (AxisCommand::OFF, has_pulse.then_some(Outcome::Index(self.search)));
        };
        let outcome = if bridges == Bridges::Follow {
            match calibrator.tick(sample) {
                CalibrationStep::Running(command) => return (command, None),
                CalibrationStep::Done(calibration) => Outcome::Calibrated(calibration),
                CalibrationStep::Refused(refusal) => Outcome::Refused(refusal),
            }
        } else {
            Outcome::Interrupted
        };
        self.mode = AxisMode::Off;
        (AxisCommand::OFF, Some(outcome))
    }
}
