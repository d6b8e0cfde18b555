//! Results of an identification as plain values, equal for every recipient.
//!
//! Value of a parameter: its own value if it was measured alone. If a prior says how to split a group or an
//! unseen parameter, the value of the completed leg. Otherwise `None`, since any number would be invented. A
//! parameter that is not estimated is zero in the model, and so here.

use core::borrow::BorrowMut;

use super::identification::Identification;
use crate::ident::{Estimate, MotionWindow, Record, Status, status};
use crate::model::{Parameter, Standing};

/// Result for one of a joint's fourteen parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundParameter {
    /// Value in SI units; `None` if neither torque nor a prior determines it.
    pub(crate) value: Option<f32>,
    /// Standard deviation; `None` unless the parameter was measured alone.
    pub(crate) sigma: Option<f32>,
    /// Origin of the value.
    pub(crate) status: Status,
}

/// Result for one base parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundBase {
    /// Joint (from 0) and parameter of its column.
    pub(crate) carrier: (usize, Parameter),
    /// Whether other parameters are regrouped into it.
    pub(crate) grouped: bool,
    /// Whether it was held at zero because the data do not determine it.
    pub(crate) dropped: bool,
    /// Identified value; `None` if the data do not determine it.
    pub(crate) value: Option<f32>,
    /// Standard deviation.
    pub(crate) sigma: Option<f32>,
    /// Value of the closed-form least squares.
    pub(crate) least_squares: f32,
}

/// Quality of fit of one joint's torque for one motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundFit {
    /// Filtered rows in which the joint moved.
    pub(crate) rows: u32,
    /// Root mean square of measured minus predicted torque, N m.
    pub(crate) rms_nm: Option<f32>,
    /// Mean absolute torque, N m.
    pub(crate) mean_absolute_nm: f32,
    /// Root mean square torque, N m.
    pub(crate) torque_rms_nm: f32,
    /// Root mean square speed, rad/s.
    pub(crate) speed_rms: f32,
    /// Share of the rows that lost more than half of their weight.
    pub(crate) disturbed_share: f32,
    /// Longest stretch of such rows, s.
    pub(crate) disturbed_longest_s: f32,
    /// Number of outliers that were replaced.
    pub(crate) replaced: u32,
}

impl<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize, W>
    Identification<N, B, TAPS, PENDING, W>
where
    W: BorrowMut<MotionWindow<f32, N, B>>,
{
    /// Base parameters to be judged; `None` before there is a solver.
    pub(crate) fn estimate(&self) -> Option<Estimate<f32, B>> {
        Some(self.solver()?.estimate())
    }

    /// Result for one parameter of a joint (from 0), given [`Self::estimate`].
    pub(crate) fn parameter(
        &self,
        estimate: &Estimate<f32, B>,
        joint: usize,
        parameter: Parameter,
    ) -> Option<FoundParameter> {
        let solver = self.solver()?;
        let record = solver.record();
        let model = self.model();
        let status = status(model, record, estimate, joint, parameter);
        let alone = match model.base.standing(joint, parameter) {
            Standing::Alone(base) if !record.selection.dropped.get(base).copied().unwrap_or(true) => {
                Some(base)
            }
            _ => None,
        };
        let base = alone.filter(|&base| estimate.determined.get(base).copied().unwrap_or(false));
        let is_zero = model.base.standing(joint, parameter) == Standing::Off
            || record.selection.drops(model, joint, parameter);
        let value = match base {
            _ if is_zero => Some(0.0),
            Some(base) => estimate.values.get(base).copied(),
            None => solver
                .parameters()
                .filter(|_| self.has_prior())
                .and_then(|leg| leg.get(joint)?.get(parameter.index()).copied()),
        };
        Some(FoundParameter { value, sigma: base.and_then(|base| estimate.sigma(base)), status })
    }

    /// Result for one base parameter, given [`Self::estimate`]; `None` beyond the last.
    pub(crate) fn base_parameter(&self, estimate: &Estimate<f32, B>, base: usize) -> Option<FoundBase> {
        let solver = self.solver()?;
        let model = self.model();
        let carrier = model.base.independent(base)?;
        let terms = model.base.terms(base).as_flattened().iter().filter(|factor| **factor != 0.0).count();
        let determined = estimate.determined.get(base).copied().unwrap_or(false);
        Some(FoundBase {
            carrier,
            grouped: terms > 1,
            dropped: solver.record().selection.dropped.get(base).copied().unwrap_or(false),
            value: estimate.values.get(base).copied().filter(|_| determined),
            sigma: estimate.sigma(base),
            least_squares: solver.least_squares().values.get(base).copied().unwrap_or(0.0),
        })
    }

    /// Fit of one joint (from 0) for one motion, given [`Self::estimate`]. Motion 0 is the training motion,
    /// the others are the validation motions. `None` if the motion was not recorded.
    pub(crate) fn fit(&self, estimate: &Estimate<f32, B>, motion: usize, joint: usize) -> Option<FoundFit> {
        let record = self.motion(motion)?;
        let size = record.torque.get(joint)?;
        Some(FoundFit {
            rows: *record.rows.get(joint)?,
            rms_nm: record.torque_error(joint, &estimate.values),
            mean_absolute_nm: size.mean_absolute,
            torque_rms_nm: size.root_mean_square,
            speed_rms: size.speed,
            disturbed_share: *record.outliers.disturbed_share.get(joint)?,
            disturbed_longest_s: *record.outliers.longest_s.get(joint)?,
            replaced: *record.outliers.replaced.get(joint)?,
        })
    }

    /// Record of a motion, counted as in [`Self::fit`].
    pub(crate) fn motion(&self, motion: usize) -> Option<&Record<f32, N, B>> {
        match motion.checked_sub(1) {
            None => Some(self.solver()?.record()),
            Some(unused) => self.validation().get(unused)?.as_ref(),
        }
    }
}
