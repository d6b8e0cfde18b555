//! From samples to the swarm's result.

use scarab::ident::{ConstantRatio, Ends, Estimator, Solver, Stretches};

use super::ReplayOptions;
use super::known_mass::{load_base, settled};
use super::logging_errors::{is_explained_by_noise, sample_noise};
use super::rows::{HostRecorder, Samples, feed};
use super::screening::Continuity;
use crate::leg::background::Background;
use crate::report::Source;
use crate::run::analysis::Search;
use crate::run::consistent;

/// Result of the search over the training part.
pub(super) struct Solved<const N: usize, const B: usize> {
    pub(crate) solver: Solver<f32, N, B>,
    /// Recorder of the training part, cleared: held-out parts are judged by its noise.
    pub(crate) recorder: Box<HostRecorder<N, B>>,
    pub(crate) sources: Vec<Source>,
    /// Base parameters of a known load, which the recorded torque contains.
    pub(crate) load: Option<[f32; B]>,
    /// Whether the torques' noise explains the misfit of every joint.
    pub(crate) is_explained: bool,
    pub(crate) search: Search,
}

impl<const N: usize, const B: usize> Solved<N, B> {
    /// The found base parameters with those of the load.
    pub(super) fn values(&self) -> [f32; B] {
        with(self.solver.values(), &self.load.unwrap_or([0.0; B]))
    }
}

/// Identifies from the training part, whose torques have this noise. `scale` is the recorded over the true
/// torque of each joint, which is divided out already; its sigma is added.
pub(super) fn solve<const N: usize, const B: usize>(
    background: &mut Background<N, B>,
    mut recorder: Box<HostRecorder<N, B>>,
    training: &[Samples<N>],
    noise: &[Option<f64>; N],
    options: &ReplayOptions,
    scale: Option<[ConstantRatio<f32>; N]>,
) -> Solved<N, B> {
    recorder.set_estimator(options.estimator);
    let sources = feed(&mut recorder, background, training, "training", |_, _, _| {});
    let mut record = recorder.finish();
    for (count, joint) in record.outliers.replaced.iter_mut().zip(0..) {
        *count += training.iter().map(|samples| samples.replaced[joint]).sum::<u32>();
    }
    record.noise = sample_noise(noise);
    let is_explained = is_explained_by_noise(&record);
    let mut solver = settled(background, record, options);
    let load = load_base(background, options);
    let as_recorded = solver.record().clone();
    if options.load.is_some() {
        solver = settled(background, as_recorded.corrected(&[1.0; N], &load), options);
    }
    for (joint, found) in scale.iter().flatten().enumerate() {
        let mut moved = [1.0; N];
        moved[joint] += found.sigma / found.ratio;
        let moved = settled(background, as_recorded.corrected(&moved, &load), options);
        solver.widen(moved.least_squares());
    }
    let search = background.search(&mut solver);
    consistent::finish(background, &mut solver);
    background.device.stribeck = solver.stribeck(&background.device);
    recorder.clear(Ends::Whole);
    if options.estimator == Estimator::Robust {
        let record = if options.load.is_some() { &as_recorded } else { solver.record() };
        let stretches = Stretches::new(&background.device, record, &with(solver.found(), &load));
        time_disturbances(&mut recorder, background, training, stretches, &mut solver);
        recorder.clear(Ends::Whole);
    }
    if !is_explained {
        recorder.count_disturbances();
    }
    let load = options.load.is_some().then_some(load);
    Solved { solver, recorder, sources, load, is_explained, search }
}

fn with<const B: usize>(values: [f32; B], load: &[f32; B]) -> [f32; B] {
    core::array::from_fn(|base| values[base] + load[base])
}

/// Takes the durations of disturbances from the rows themselves, because blocks of a long motion are long.
fn time_disturbances<const N: usize, const B: usize>(
    recorder: &mut HostRecorder<N, B>,
    background: &Background<N, B>,
    training: &[Samples<N>],
    mut stretches: Stretches<f32, N, B>,
    solver: &mut Solver<f32, N, B>,
) {
    let mut continuity = Continuity::default();
    feed(recorder, background, training, "training", |file, time_s, progress| {
        if continuity.breaks(file, time_s) {
            stretches.break_off();
        }
        if let Some(rows) = &progress.rows {
            stretches.take(rows);
        }
    });
    solver.time_disturbances(&stretches);
}
