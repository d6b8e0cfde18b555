//! Progress of an identification: filtered torque, its prediction, and the estimate so far.
//!
//! Logged samples pass a recorder equal to that of the identification. Each estimate finishes a copy of it,
//! so an estimate is what least squares would find if the motion ended now. Its standard deviations include
//! the noise level found so far. Rows are predicted by the newest estimate made before them.

use scarab::ident::{
    DECIMATION, Ends, Estimate, Estimator, FilteredRows, Filters, LARGEST_STILL_SHARE, MotionWindow, Plan,
    Problem, Recorder, RowModel, SAMPLE_RATE_HZ, no_stribeck,
};
use scarab::leg::{Segment, Stribeck};
use scarab::model::Parameter;
use scarab::real::dot;
use scarab_base::error::ToolError;

use crate::formats::leg_file::LegFile;
use crate::leg::background::Background;
use crate::leg::setup::{PriorChoice, background};
use crate::report::BaseReport;
use crate::run::resample::{PENDING, TAPS};
use crate::with_leg_size;

/// Rows between two estimates: one second.
const ROWS_PER_ESTIMATE: u32 = SAMPLE_RATE_HZ as u32 / DECIMATION as u32;

/// Sample of a leg at 500 Hz, in chain angles and signs.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainSample {
    /// Angle of each joint, rad.
    pub position_rad: Vec<f32>,
    /// Torque of each joint, N m.
    pub torque_nm: Vec<f32>,
    /// Use of the sample.
    pub segment: Option<Segment>,
}

/// Filtered torque of all joints and its prediction, D-H signs.
#[derive(Clone, Debug, PartialEq)]
pub struct PredictedRow {
    /// Seconds from the row's centre to the newest sample.
    pub age_s: f64,
    /// Filtered torque, N m.
    pub measured: Vec<f32>,
    /// Predicted torque, N m; `None` without a complete estimate, and for a joint at rest.
    pub predicted: Vec<Option<f32>>,
}

/// Recorder and newest estimate of a leg of any size.
pub trait Progress {
    /// Takes one sample; returns the row that it completes. A sample of another number of joints is ignored.
    fn push(&mut self, sample: &ChainSample) -> Option<PredictedRow>;
    /// Separates the next sample from the last one, because samples between them are missing.
    fn break_off(&mut self);
    /// Least squares over the motion so far, each second of the motion to identify from. Predicts from then
    /// on, once every parameter is determined.
    fn estimate(&mut self) -> Option<Vec<BaseReport>>;
    /// Predicts with base values and Stribeck curves of a result from now on.
    fn use_result(&mut self, values: &[f32], stribeck: &[Stribeck<f32>]);
    /// Predicts with base values by name from now on, unknown ones zero, and with Stribeck curves: joint from
    /// 0, surplus in N m, speed in rad/s.
    fn use_named(&mut self, value: &dyn Fn(&str) -> Option<f64>, curves: &[(usize, f64, f64)]);
    /// Number of base parameters.
    fn rank(&self) -> usize;
    /// Reports of base parameters, each a value with its standard deviation.
    fn reports(&self, base: &[[f32; 2]]) -> Vec<BaseReport>;
}

/// How the samples are filtered and estimated.
#[derive(Clone, Debug)]
pub struct ProgressOptions {
    /// Prior of the leg.
    pub prior: PriorChoice,
    /// Seed of a wrong prior.
    pub seed: u64,
    /// Frequency at which the low-pass is 3 dB down, Hz.
    pub bandwidth_hz: f64,
    /// Robust or plain.
    pub estimator: Estimator,
    /// One-time or sequential.
    pub plan: Plan,
    /// Whether the leg file's `truth` is that of the leg, and so is reported.
    pub reports_truth: bool,
}

impl ProgressOptions {
    /// Robust one-time identification with the leg file's prior.
    pub fn new(bandwidth_hz: f64) -> Self {
        Self {
            prior: PriorChoice::Default,
            seed: 0,
            bandwidth_hz,
            estimator: Estimator::Robust,
            plan: Plan::OneTime,
            reports_truth: true,
        }
    }
}

/// Progress of a leg by its file.
///
/// # Errors
/// The leg file is incomplete, or its filter does not fit.
pub fn progress(leg: &LegFile, options: &ProgressOptions) -> Result<Box<dyn Progress>, ToolError> {
    with_leg_size!(leg, of_file(leg, options))
}

fn of_file<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &ProgressOptions,
) -> Result<Box<dyn Progress>, ToolError> {
    let mut background = background::<N, B>(leg, options.prior, options.seed)?;
    background.use_estimator(options.estimator);
    if !options.reports_truth {
        background.truth = None;
    }
    of_background(background, options.bandwidth_hz as f32, options.estimator, options.plan)
}

/// [`progress`] of a leg that is analysed already.
///
/// # Errors
/// The filter does not fit.
pub fn of_background<const N: usize, const B: usize>(
    background: Background<N, B>,
    bandwidth_hz: f32,
    estimator: Estimator,
    plan: Plan,
) -> Result<Box<dyn Progress>, ToolError> {
    let unfit = |_| ToolError::input("the filter does not fit the device: raise bandwidth_hz");
    Filters::<f32, N, B, TAPS, PENDING>::new(bandwidth_hz).map_err(unfit)?;
    let mut recorder = Box::new(Recorder::with_window(bandwidth_hz, MotionWindow::new()).map_err(unfit)?);
    recorder.set_estimator(estimator);
    Ok(Box::new(SizedProgress {
        recorder,
        model: background.device.clone(),
        background,
        plan,
        segment: None,
        values: None,
        estimated: 0,
    }))
}

struct SizedProgress<const N: usize, const B: usize> {
    recorder: Box<Recorder<f32, N, B, TAPS, PENDING>>,
    background: Background<N, B>,
    model: RowModel<f32, N, B>,
    plan: Plan,
    segment: Option<Segment>,
    /// Base values of the prediction.
    values: Option<[f32; B]>,
    /// Rows at the last estimate.
    estimated: u32,
}

impl<const N: usize, const B: usize> SizedProgress<N, B> {
    fn begin(&mut self, segment: Option<Segment>) {
        self.segment = segment;
        let Some(segment) = segment else { return };
        self.recorder.clear(if segment == Segment::Training { Ends::Cut } else { Ends::Whole });
        if segment == Segment::Training {
            self.model.stribeck = no_stribeck();
            (self.values, self.estimated) = (None, 0);
        }
    }

    fn predicted(&self, rows: &FilteredRows<f32, N, B>) -> PredictedRow {
        let lag = self.recorder.delay() + self.recorder.reach();
        let predicted = |joint: usize| {
            let moves = f64::from(rows.still[joint]) <= LARGEST_STILL_SHARE;
            self.values.as_ref().filter(|_| moves).map(|values| dot(&rows.regressor[joint], values))
        };
        PredictedRow {
            age_s: lag as f64 / SAMPLE_RATE_HZ,
            measured: rows.torque.to_vec(),
            predicted: (0..N).map(predicted).collect(),
        }
    }
}

impl<const N: usize, const B: usize> Progress for SizedProgress<N, B> {
    fn push(&mut self, sample: &ChainSample) -> Option<PredictedRow> {
        let position: &[f32; N] = sample.position_rad[..].try_into().ok()?;
        let torque: &[f32; N] = sample.torque_nm[..].try_into().ok()?;
        if sample.segment != self.segment {
            self.begin(sample.segment);
        }
        sample.segment?;
        let progress = self.recorder.push(&self.model, position, torque)?;
        Some(self.predicted(&progress.rows?))
    }

    fn break_off(&mut self) {
        self.recorder.break_off();
    }

    fn estimate(&mut self) -> Option<Vec<BaseReport>> {
        let rows = self.recorder.rows().into_iter().min().unwrap_or(0);
        if self.segment != Some(Segment::Training) || rows < self.estimated + ROWS_PER_ESTIMATE {
            return None;
        }
        self.estimated = rows;
        let record = self.recorder.clone().finish();
        let estimate = Problem::new(&record, &self.model).least_squares(self.plan);
        if estimate.rank() >= self.rank() {
            self.values = Some(estimate.values);
        }
        Some(self.background.base_parameters(&[false; B], &estimate, None))
    }

    fn use_result(&mut self, values: &[f32], stribeck: &[Stribeck<f32>]) {
        self.model = self.background.device.clone();
        self.model.stribeck.iter_mut().zip(stribeck).for_each(|(slot, curve)| *slot = *curve);
        self.values = Some(core::array::from_fn(|base| values.get(base).copied().unwrap_or(0.0)));
    }

    fn use_named(&mut self, value: &dyn Fn(&str) -> Option<f64>, curves: &[(usize, f64, f64)]) {
        let values: [f32; B] =
            core::array::from_fn(|base| value(&self.background.base_name(base)).unwrap_or(0.0) as f32);
        let mut stribeck = self.background.device.stribeck;
        for &(joint, surplus, speed) in curves {
            let coulomb = self.background.device.drive(joint, Parameter::FC);
            let coulomb = coulomb.map_or(0.0, |base| f64::from(values[base]));
            if coulomb > 0.0
                && let Some(slot) = stribeck.get_mut(joint)
            {
                *slot = Stribeck { excess: (surplus / coulomb).max(0.0) as f32, velocity: speed as f32 };
            }
        }
        self.use_result(&values, &stribeck);
    }

    fn rank(&self) -> usize {
        self.background.model.base.rank()
    }

    fn reports(&self, base: &[[f32; 2]]) -> Vec<BaseReport> {
        let mut estimate = Estimate::nothing();
        for (index, [value, sigma]) in base.iter().enumerate().take(B) {
            estimate.values[index] = *value;
            estimate.covariance[index][index] = sigma * sigma;
            estimate.determined[index] = true;
        }
        self.background.base_parameters(&[false; B], &estimate, None)
    }
}
