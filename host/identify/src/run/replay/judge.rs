//! From the swarm's result to the verdict, with the held-out part.

use scarab::ident::{HeldOut, Record, Thresholds, Unused, Verdict};
use scarab::real::dot;

use super::logging_errors::sample_noise;
use super::predictions::Prediction;
use super::rows::{PENDING, Samples, feed};
use super::screening::Continuity;
use super::solve::Solved;
use crate::leg::background::Background;
use crate::report::Source;
use crate::report::findings::FindingReport;

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

/// Judges the result by the held-out part, whose torques have this noise.
pub(super) fn judge<const N: usize, const B: usize>(
    background: &Background<N, B>,
    solved: &mut Solved<N, B>,
    held_out: &[Samples<N>],
    noise: &[Option<f64>; N],
) -> Judged<N, B> {
    let (values, model) = (solved.values(), &background.device);
    let Solved { solver, recorder, load, noise_is_known, .. } = solved;
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
    unused.noise = if *noise_is_known { sample_noise(noise) } else { [0.0; N] };
    let unused = (!held_out.is_empty()).then_some(unused);
    // The bias of the parameters is judged instead (`logging_errors::encoder`).
    let thresholds = Thresholds { largest_pulse_share: f32::INFINITY, ..Thresholds::default() };
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
