//! What one axis does: nothing, being measured, or running.

use crate::hal::{AxisCommand, AxisSample};
use crate::leg::{Calibration, CalibrationRefusal};
use crate::motor::{Axis, AxisFault, AxisRequest, CalibrationStep, Calibrator, Wish};
use crate::safety::Bridges;

/// What an axis is to do from its next tick on.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Bridge released.
    Off,
    /// Measure.
    Calibrate(Calibrator),
    /// Control its current.
    Run(Axis),
    /// The joint now stands at these counts.
    Place(i32),
    /// Forget a fault.
    ClearFault,
}

/// What came of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Measured.
    Calibrated(Calibration),
    /// Not measured.
    Refused(CalibrationRefusal),
    /// The interlock or an order ended the measurement.
    Interrupted,
    /// It released itself, or brakes.
    Fault {
        /// Why.
        fault: AxisFault,
        /// It has to be calibrated anew.
        lost: bool,
    },
    /// The flash was erased, and the joint may have gone any way meanwhile: its zero is not known.
    StoodStill,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Doing {
    Nothing,
    Calibrating(Calibrator),
    Running(Axis),
}

/// One axis' stage; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    doing: Doing,
    /// What was told of.
    faulted: Option<AxisFault>,
}

impl Stage {
    /// Nothing.
    pub const OFF: Self = Self { doing: Doing::Nothing, faulted: None };

    /// An axis that was calibrated elsewhere.
    #[must_use]
    pub const fn running(axis: Axis) -> Self {
        Self { doing: Doing::Running(axis), faulted: None }
    }

    /// It has a calibration.
    #[must_use]
    pub const fn is_running(&self) -> bool {
        matches!(self.doing, Doing::Running(_))
    }

    /// The axis, if it runs.
    #[inline(always)]
    pub fn axis_mut(&mut self) -> Option<&mut Axis> {
        match &mut self.doing {
            Doing::Running(axis) => Some(axis),
            Doing::Nothing | Doing::Calibrating(_) => None,
        }
    }

    /// The fault of a running axis.
    #[must_use]
    pub fn fault(&self) -> Option<AxisFault> {
        match &self.doing {
            Doing::Running(axis) => axis.fault(),
            Doing::Nothing | Doing::Calibrating(_) => None,
        }
    }

    /// Takes an order; a measurement that it ends is told, and a place that turns out to be lost.
    #[inline(never)]
    pub fn obey(&mut self, order: Order) -> Option<Outcome> {
        match order {
            Order::Off => {
                let measuring = matches!(self.doing, Doing::Calibrating(_));
                self.doing = Doing::Nothing;
                return measuring.then_some(Outcome::Interrupted);
            }
            Order::Calibrate(calibrator) => self.doing = Doing::Calibrating(calibrator),
            Order::Run(axis) => *self = Self::running(axis),
            Order::Place(counts) => {
                if let Some(axis) = self.axis_mut() {
                    axis.set_counts(counts);
                }
            }
            Order::ClearFault => {
                // A place that was lost stays lost: only a new calibration helps, and the fault is told again. A motor that brakes is
                // let go, and to be calibrated as well.
                let fault = self.fault();
                let is_lost = self.axis_mut().is_some_and(|axis| !axis.clear_fault());
                self.faulted = None;
                if is_lost {
                    self.doing = Doing::Nothing;
                    return fault.map(|fault| Outcome::Fault { fault, lost: true });
                }
            }
        }
        None
    }

    /// The flash was written and nothing was looked at since the last tick, with the bridge released; `long` where nobody knows how far the
    /// joint went. Whether there is an axis that followed it before.
    #[cold]
    #[inline(never)]
    pub fn stood_still(&mut self, sample: &AxisSample, long: bool) -> bool {
        let axis = self.axis_mut();
        axis.map(|axis| axis.resume(sample, long)).is_some()
    }

    /// One PWM period: what the bridge does in the next one, and what is to be told; with a fault whether the axis was to do anything.
    #[inline(always)]
    pub fn tick(
        &mut self,
        sample: &AxisSample,
        bridges: Bridges,
        target: AxisRequest,
    ) -> (AxisCommand, Option<(Outcome, bool)>) {
        match &mut self.doing {
            Doing::Nothing => (AxisCommand::RELEASED, None),
            Doing::Calibrating(_) if bridges != Bridges::Follow => self.end(Outcome::Interrupted),
            Doing::Calibrating(calibrator) => match calibrator.tick(sample) {
                CalibrationStep::Running(command) => (command, None),
                CalibrationStep::Done(calibration) => self.end(Outcome::Calibrated(calibration)),
                CalibrationStep::Refused(refusal) => self.end(Outcome::Refused(refusal)),
            },
            Doing::Running(running) => {
                let wish = match bridges {
                    Bridges::Follow => target.into(),
                    Bridges::Brake => Wish::Brake,
                    Bridges::Release => Wish::Released,
                };
                let command = running.act(sample, wish);
                let told = running.fault().filter(|fault| self.faulted != Some(*fault)).map(|fault| {
                    self.faulted = Some(fault);
                    (Outcome::Fault { fault, lost: running.is_lost() }, wish != Wish::Released)
                });
                (command, told)
            }
        }
    }

    fn end(&mut self, outcome: Outcome) -> (AxisCommand, Option<(Outcome, bool)>) {
        self.doing = Doing::Nothing;
        (AxisCommand::RELEASED, Some((outcome, false)))
    }
}
