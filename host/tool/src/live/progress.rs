//! Progress of an identification: filtered torque, its prediction, and the estimate so far.
//!
//! Logged samples pass a recorder equal to that of the identification. Each estimate finishes a copy of it,
//! so an estimate is what least squares would find if the motion ended now. Its standard deviations include
//! the noise level found so far. Rows are predicted by the newest estimate made before them.

use scarab::ident::{
    Ends, Estimate, Estimator, FilteredRows, Filters, LARGEST_STILL_SHARE, MotionWindow, Plan, Problem,
    Recorder, RowModel, SAMPLE_RATE_HZ, no_stribeck,
};
use scarab::leg::{LoggedSample, Segment, Stribeck};
use scarab::model::Parameter;
use scarab_base::error::ToolError;
use scarab_identify::leg::background::Background;

use crate::live::report::RATE_HZ;

/// Reserved filter taps: bandwidths from 1 Hz.
const TAPS: usize = 2048;
/// Open outputs of that filter.
const PENDING: usize = 205;

/// Recorder and newest estimate of one leg.
pub(crate) struct Progress<const N: usize, const B: usize> {
    recorder: Box<Recorder<f32, N, B, TAPS, PENDING>>,
    model: RowModel<f32, N, B>,
    segment: Option<Segment>,
    /// Base values of the prediction.
    values: Option<[f32; B]>,
    /// Rows at the last estimate.
    estimated: u32,
}

/// Filtered torque of all joints and its prediction, D-H signs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PredictedRow<const N: usize> {
    /// Seconds from the row's centre to the newest sample.
    pub(crate) age_s: f64,
    /// Filtered torque, N m.
    pub(crate) measured: [f32; N],
    /// Predicted torque, N m; `None` without a complete estimate, and for a joint at rest.
    pub(crate) predicted: [Option<f32>; N],
}

impl<const N: usize, const B: usize> Progress<N, B> {
    /// Creates a recorder with the filters and the estimator of the identification.
    ///
    /// # Errors
    /// The filter does not fit.
    pub fn new(
        model: &RowModel<f32, N, B>,
        bandwidth_hz: f32,
        estimator: Estimator,
    ) -> Result<Self, ToolError> {
        let unfit = |_| ToolError::input("the filter does not fit the device: raise bandwidth_hz");
        Filters::<f32, N, B, TAPS, PENDING>::new(bandwidth_hz).map_err(unfit)?;
        let window = MotionWindow::new();
        let mut recorder = Box::new(Recorder::with_window(bandwidth_hz, window).map_err(unfit)?);
        recorder.set_estimator(estimator);
        Ok(Self { recorder, model: model.clone(), segment: None, values: None, estimated: 0 })
    }

    /// Takes one logged sample; returns the row that it completes.
    pub(crate) fn push(&mut self, logged: &LoggedSample<N>) -> Option<PredictedRow<N>> {
        if logged.segment != self.segment {
            self.begin(logged.segment);
        }
        logged.segment?;
        let sample = &logged.sample;
        let progress = self.recorder.push(&self.model, &sample.position_rad, &sample.torque_nm)?;
        Some(self.predicted(&progress.rows?))
    }

    fn begin(&mut self, segment: Option<Segment>) {
        self.segment = segment;
        let Some(segment) = segment else { return };
        self.recorder.clear(if segment == Segment::Training { Ends::Cut } else { Ends::Whole });
        if segment == Segment::Training {
            self.model.stribeck = no_stribeck();
            (self.values, self.estimated) = (None, 0);
        }
    }

    fn predicted(&self, rows: &FilteredRows<f32, N, B>) -> PredictedRow<N> {
        let lag = self.recorder.delay() + self.recorder.reach();
        PredictedRow {
            age_s: lag as f64 / SAMPLE_RATE_HZ,
            measured: rows.torque,
            predicted: core::array::from_fn(|joint| {
                let moves = f64::from(rows.still[joint]) <= LARGEST_STILL_SHARE;
                let torque = |values: &[f32; B]| -> f32 {
                    rows.regressor[joint].iter().zip(values).map(|(element, value)| element * value).sum()
                };
                self.values.as_ref().filter(|_| moves).map(torque)
            }),
        }
    }

    /// Separates the next sample from the last one, because samples between them are missing.
    pub(crate) fn break_off(&mut self) {
        self.recorder.break_off();
    }

    /// Whether an estimate is due: each second of the motion to identify from.
    pub(crate) fn is_due(&self) -> bool {
        let rows = self.recorder.rows().into_iter().min().unwrap_or(0);
        self.segment == Some(Segment::Training) && rows >= self.estimated + RATE_HZ
    }

    /// Least squares over the motion so far. Predicts from now on, once it determines `rank` parameters.
    pub(crate) fn estimate(&mut self, plan: Plan, rank: usize) -> Estimate<f32, B> {
        self.estimated = self.recorder.rows().into_iter().min().unwrap_or(0);
        let record = self.recorder.clone().finish();
        let estimate = Problem::new(&record, &self.model).least_squares(plan);
        if estimate.rank() >= rank {
            self.values = Some(estimate.values);
        }
        estimate
    }

    /// Predicts with a result from now on.
    pub(crate) fn use_result(&mut self, model: &RowModel<f32, N, B>, values: &[f32; B]) {
        self.model = model.clone();
        self.values = Some(*values);
    }

    /// Predicts with base values by name from now on, unknown ones zero, and with Stribeck curves: joint from
    /// 0, surplus in N m, speed in rad/s.
    pub(crate) fn use_named(
        &mut self,
        background: &Background<N, B>,
        value: impl Fn(&str) -> Option<f64>,
        curves: impl Iterator<Item = (usize, f64, f64)>,
    ) {
        let mut model = background.device.clone();
        let values: [f32; B] =
            core::array::from_fn(|base| value(&background.base_name(base)).unwrap_or(0.0) as f32);
        for (joint, surplus, speed) in curves {
            let coulomb = model.drive(joint, Parameter::FC).map_or(0.0, |base| f64::from(values[base]));
            if coulomb > 0.0
                && let Some(slot) = model.stribeck.get_mut(joint)
            {
                *slot = Stribeck { excess: (surplus / coulomb).max(0.0) as f32, velocity: speed as f32 };
            }
        }
        self.use_result(&model, &values);
    }
}
