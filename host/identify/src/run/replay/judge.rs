//! From the swarm's result to the verdict, with the held-out part.

use scarab::ident::{HeldOut, Record, Thresholds, Unused, Verdict};
use scarab::real::dot;

use super::logging_errors::sample_noise;
use super::predictions::Prediction;
use super::rows::{Samples, feed};
use super::screening::Continuity;
use super::solve::Solved;
use crate::leg::background::Background;
use crate::report::Source;
use crate::report::findings::FindingReport;
use crate::run::resample::PENDING;

/// Largest held-out error over the training error where noise does not explain the latter.
const LARGEST_ERROR_RATIO: f32 = 2.0;

/// Verdict and what it rests on.
pub(super) struct Judged<const N: usize, const B: usize> {
    pub(crate) verdict: Verdict,
    /// Every test of the verdict.
    pub(crate) findings: Vec<FindingReport>,
    /// Record of the held-out part, if there is one.
    pub(crate) unused: Option<Record<f32, N, B>>,
    pub(crate) predictions: Vec<Prediction<N>>,
    pub(crate) sources: Vec<Source>,
}

/// Judges the result by the held-out part, whose torques have this noise. Errors of this share of the torque
/// are accepted.
pub(super) fn judge<const N: usize, const B: usize>(
    background: &Background<N, B>,
    solved: &mut Solved<N, B>,
    held_out: &[Samples<N>],
    noise: &[Option<f64>; N],
    accepted_error: f64,
) -> Judged<N, B> {
    let (values, model) = (solved.values(), &background.device);
    let Solved { solver, recorder, load, is_explained, .. } = solved;
    let mut evaluation = Box::new(HeldOut::<f32, N, B, PENDING>::new(recorder.reach()));
    let dropped = &solver.record().selection.dropped;
    evaluation.begin(&values, &solver.unexpected(), &solver.row_noise(), dropped);
    let (mut predictions, mut continuity) = (Vec::new(), Continuity::default());
    let sources = feed(recorder, background, held_out, "validation", |file, time_s, progress| {
        if continuity.breaks(file, time_s) {
            evaluation.break_off();
        }
        evaluation.take(model, progress);
        let rows = model.rows(&progress.instant);
        predictions.push(Prediction {
            file,
            time_s,
            measured: progress.instant.torque,
            predicted: rows.regressor.each_ref().map(|row| dot(row, &values)),
        });
    });
    evaluation.break_off();
    let mut unused = recorder.finish();
    if let Some(load) = load {
        unused = unused.corrected(&[1.0; N], load);
    }
    unused.noise = sample_noise(noise);
    let unused = (!held_out.is_empty()).then_some(unused);
    let thresholds = thresholds(*is_explained, accepted_error);
    let mut findings = Vec::new();
    let verdict = solver.judge(
        model,
        &thresholds,
        unused.iter().map(|record| Unused { record, residual: evaluation.residual() }),
        &evaluation.alignment().misalignments(),
        &mut |piece| findings.push(FindingReport::new(piece, &["recording"])),
    );
    Judged { verdict, findings, unused, predictions, sources }
}

/// Limits for a recording whose misfit the noise explains or not. Where not, errors of length and zero come
/// from the model's own errors, which are not white: three times the tolerance.
fn thresholds(is_explained: bool, accepted_error: f64) -> Thresholds<f32> {
    // The bias of the parameters is judged instead (`logging_errors::encoder`).
    let plain = Thresholds {
        largest_pulse_share: f32::INFINITY,
        accepted_error_share: accepted_error as f32,
        ..Thresholds::default()
    };
    if is_explained {
        return plain;
    }
    Thresholds {
        largest_error_ratio: LARGEST_ERROR_RATIO,
        forgives_disturbances: false,
        largest_length_error: 3.0 * plain.largest_length_error,
        largest_zero_error: 3.0 * plain.largest_zero_error,
        ..plain
    }
}
