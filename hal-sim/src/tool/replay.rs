//! `replay`: the firmware's identification on recordings.

mod cleaning;
mod predictions;

use std::path::{Path, PathBuf};
use std::time::Instant;

use cleaning::cleaned;
use predictions::{Prediction, write_predictions};

use scarab::ident::{
    Ends, Estimator, HeldOut, KernelError, Plan, Progress, Recorder, SearchState, Solver, Thresholds, Unused,
};
use scarab::model::AnatomicalJoint;

use super::analysis::{Background, Circumstances, Motion};
use super::error::ToolError;
use super::findings::FindingReport;
use super::leg_file::LegFile;
use super::recording::{Recording, RecordingError};
use super::report::RunReport;
use super::resample::Resampled;
use super::series::{Anatomy, Reader, Role, Series};
use super::setup::{PriorChoice, anatomy, background};

/// Reserved filter taps: bandwidths from 1 Hz.
const TAPS: usize = 2048;
/// Open outputs of that filter.
const PENDING: usize = 205;
/// Sample time of the firmware.
const GRID_S: f64 = 0.002;
/// Evaluations between two updates of the search.
const SLICE: u32 = 20;
/// Excess over the leg's range from which a warning is printed.
const RANGE_MARGIN_DEG: f64 = 5.0;

/// Options of a replay.
#[derive(Clone, Debug)]
pub struct ReplayOptions {
    /// Recordings of the training set.
    pub files: Vec<PathBuf>,
    /// Recordings held out for validation.
    pub validate: Vec<PathBuf>,
    /// Share of each file that trains; the rest validates.
    pub split: Option<f64>,
    /// Frequency at which the low-pass is 3 dB down, Hz.
    pub bandwidth_hz: f64,
    /// One-time or sequential.
    pub plan: Plan,
    /// Prior for the search box.
    pub prior: PriorChoice,
    /// Estimator; the robust one excludes disturbances and searches Stribeck friction by itself.
    pub estimator: Estimator,
    /// Seed of the swarm.
    pub swarm_seed: u64,
    /// Output file for the predicted torque of the validation part.
    pub csv: Option<PathBuf>,
}

type HostRecorder<const N: usize, const B: usize> = Recorder<f32, N, B, TAPS, PENDING>;

/// Result of a replay with its files.
#[derive(Clone, Debug)]
pub struct Replayed {
    /// Report of the identification.
    pub run: RunReport,
    /// Files, training first.
    pub sources: Vec<Source>,
    /// Curves of every file.
    pub series: Series,
}

/// One file, or a part of one, and its use.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    /// Name as given.
    pub file: PathBuf,
    /// `training` or `validation`.
    pub role: &'static str,
    /// Start on the recording's clock, s.
    pub start_s: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Rate of the recording, Hz.
    pub rate_hz: f64,
    /// Filtered rows at 50 Hz, equal for all joints.
    pub rows: u32,
    /// Rows used for each joint; it stood still in the others.
    pub used: Vec<u32>,
}

/// One file on the firmware's grid, as D-H angles and torques.
struct Samples<const N: usize> {
    file: PathBuf,
    /// Outliers replaced before resampling, converted to samples of the grid.
    replaced: [u32; N],
    rate_hz: f64,
    start_s: f64,
    /// Whether the recording has the firmware's sampling instants, so that its scatter is the sensor's own.
    native: bool,
    position: Vec<[f32; N]>,
    torque: Vec<[f32; N]>,
}

impl<const N: usize> Samples<N> {
    fn of(recording: &Recording, anatomy: &[AnatomicalJoint<f64>; N], options: &ReplayOptions) -> Self {
        let (clean, replaced) = cleaned::<N>(recording);
        let (recording, replaced) = match options.estimator {
            Estimator::Robust => (&clean, replaced),
            Estimator::Plain => (recording, [0; N]),
        };
        let grid = Resampled::of(recording);
        // Unit: samples of the grid, as in the recorder.
        let share = grid.len() as f64 / recording.time_s.len() as f64;
        let replaced = replaced.map(|count| (f64::from(count) * share).round() as u32);
        if let Some(warning) = grid.bandwidth_warning(options.bandwidth_hz) {
            warn(&recording.file, &warning);
        }
        let points = 0..grid.len();
        let position = points.clone().filter_map(|point| grid.position_rad::<N>(point));
        let torque = points.filter_map(|point| grid.torque_nm::<N>(point));
        Self {
            file: recording.file.clone(),
            replaced,
            rate_hz: grid.native_rate_hz,
            start_s: grid.start_s,
            native: recording.time_s.windows(2).all(|pair| (pair[1] - pair[0] - GRID_S).abs() < 1e-6),
            position: position
                .map(|q| core::array::from_fn(|joint| anatomy[joint].angle_to_chain(q[joint]) as f32))
                .collect(),
            torque: torque
                .map(|tau| core::array::from_fn(|joint| anatomy[joint].to_chain(tau[joint]) as f32))
                .collect(),
        }
    }

    fn duration_s(&self) -> f64 {
        self.position.len() as f64 / 500.0
    }
}

/// Identifies from recordings and validates on the held-out ones.
pub fn replay<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &ReplayOptions,
) -> Result<Replayed, ToolError> {
    let started = Instant::now();
    if let Some(twice) = options.validate.iter().find(|file| options.files.contains(file)) {
        return Err(ToolError::input(format!(
            "--validate {}: the file is identified from, it cannot be held out as well (--split holds out a part)",
            twice.display()
        )));
    }
    let mut background = background::<N, B>(leg, options.prior, options.swarm_seed)?;
    let anatomy = anatomy::<N>(leg)?;
    background.use_estimator(options.estimator);
    let mut recorder = Box::new(new_recorder::<N, B>(options.bandwidth_hz)?);
    recorder.set_estimator(options.estimator);
    let (training, held_out) = read_all(options, leg)?;
    let on_grid = |recordings: &[Recording]| -> Vec<Samples<N>> {
        recordings.iter().map(|recording| Samples::of(recording, &anatomy, options)).collect()
    };
    let (training, held_out) = (on_grid(&training), on_grid(&held_out));

    let mut sources = feed(&mut recorder, &background, &training, "training", |_, _, _| {});
    let thresholds = Thresholds::default();
    let mut record = recorder.finish();
    for (count, joint) in record.outliers.replaced.iter_mut().zip(0..) {
        *count += training.iter().map(|samples: &Samples<N>| samples.replaced[joint]).sum::<u32>();
    }
    if !training.iter().all(|samples| samples.native) {
        record.noise = [0.0; N];
    }
    let prior = background.prior.map(|prior| prior.map(|link| link.convert()));
    let mut solver =
        Solver::new(&background.device, record, options.plan, prior.as_ref(), options.swarm_seed);
    while !solver.is_selected() {
        solver.advance(&background.device, 1);
    }
    let optimum = background.costs(&solver);
    let (mut to_half, mut progress) = (None, Vec::<(u32, f64)>::new());
    loop {
        let state = solver.advance(&background.device, SLICE);
        let excess = optimum.factor.excess(&solver.search().values().map(f64::from)) - optimum.above;
        let seen = solver.search().iterations();
        if !matches!(state, SearchState::Failed(_)) && progress.last().is_none_or(|(last, _)| *last != seen) {
            progress.push((seen, excess));
        }
        if excess <= 0.5 && to_half.is_none() && !matches!(state, SearchState::Failed(_)) {
            to_half = Some(solver.search().iterations());
        }
        if state != SearchState::Running {
            break;
        }
    }

    background.device.stribeck = solver.stribeck(&background.device);
    recorder.clear(Ends::Whole);
    let noise_is_known = held_out.iter().all(|samples| samples.native);
    if !noise_is_known {
        recorder.count_disturbances();
    }
    let mut predictions = Vec::new();
    let values = solver.values();
    let mut looked_at = Box::new(HeldOut::<f32, N, B, PENDING>::new(recorder.reach()));
    let dropped = &solver.record().selection.dropped;
    looked_at.begin(&values, &solver.unexpected(), &solver.row_noise(), dropped);
    let mut current = 0;
    sources.extend(feed(&mut recorder, &background, &held_out, "validation", |file, time_s, progress| {
        if file != current {
            looked_at.break_off();
            current = file;
        }
        looked_at.take(&background.device, progress);
        let instant = &progress.instant;
        let rows = background.device.rows(instant);
        predictions.push(Prediction {
            file,
            time_s,
            measured: instant.torque,
            predicted: core::array::from_fn(|joint| {
                rows.regressor[joint].iter().zip(&values).map(|(element, value)| element * value).sum()
            }),
        });
    }));
    looked_at.break_off();
    let mut unused = recorder.finish();
    if !noise_is_known {
        unused.noise = [0.0; N];
    }
    let validated = !held_out.is_empty();
    let mut findings = Vec::new();
    let records = Unused { record: &unused, residual: looked_at.residual() };
    let verdict = solver.judge(
        &background.device,
        &thresholds,
        validated.then_some(records).into_iter(),
        &looked_at.alignment().misalignments(),
        &mut |piece| findings.push(FindingReport::new(piece, &["recording"])),
    );
    if let Some(path) = &options.csv {
        write_predictions(path, &predictions, &anatomy)?;
    }
    let motion = |record| Motion { name: "recording".into(), record, truth: None };
    let circumstances = Circumstances {
        findings,
        estimator: options.estimator,
        iterations_to_half_chi2: to_half,
        simulated_s: training.iter().chain(&held_out).map(Samples::duration_s).sum(),
        wall: started.elapsed(),
        ..Circumstances::default()
    };
    let validation = if validated { vec![motion(unused)] } else { Vec::new() };
    let run =
        background.report(&solver, verdict, &[motion(solver.record().clone())], &validation, &circumstances);
    let series = Series {
        excess: progress,
        floor_chi2: Some(optimum.above),
        ..series(&background, &anatomy, &solver, options.bandwidth_hz, &training, &held_out)?
    };
    Ok(Replayed { run, sources, series })
}

/// Curves of every file.
fn series<const N: usize, const B: usize>(
    background: &Background<N, B>,
    anatomy: &[AnatomicalJoint<f64>; N],
    solver: &Solver<f32, N, B>,
    bandwidth_hz: f64,
    training: &[Samples<N>],
    held_out: &[Samples<N>],
) -> Result<Series, ToolError> {
    let anatomy = Anatomy {
        direction: anatomy.map(|joint| joint.direction()),
        zero_rad: anatomy.map(|joint| joint.zero_offset()),
    };
    let (model, values) = (&background.device, solver.estimate().values);
    let mut reader = Reader::<N, B, TAPS, PENDING>::new(model, anatomy, values, bandwidth_hz as f32)
        .map_err(|error| bandwidth_error(bandwidth_hz, error))?;
    let parts = training.iter().map(|file| (file, Role::Training));
    let parts = parts.chain(held_out.iter().map(|file| (file, Role::Validation)));
    let motions = parts.map(|(file, role)| {
        let name = file.file.file_name().unwrap_or(file.file.as_os_str()).to_string_lossy();
        let samples = file.position.iter().copied().zip(file.torque.iter().copied());
        reader.motion(name, role, file.start_s, samples)
    });
    let motions = motions.collect();
    Ok(reader.series(solver, motions))
}

/// Above this bandwidth, 50 Hz rows alias the noise that the low-pass passes, and sigma becomes too small.
const LARGEST_BANDWIDTH_HZ: f64 = 25.0;

fn new_recorder<const N: usize, const B: usize>(bandwidth_hz: f64) -> Result<HostRecorder<N, B>, ToolError> {
    if bandwidth_hz > LARGEST_BANDWIDTH_HZ {
        return Err(ToolError::input(format!(
            "--bandwidth {bandwidth_hz}: at most {LARGEST_BANDWIDTH_HZ} Hz"
        )));
    }
    HostRecorder::new(bandwidth_hz as f32).map_err(|error| bandwidth_error(bandwidth_hz, error))
}

fn bandwidth_error(bandwidth_hz: f64, error: KernelError) -> ToolError {
    ToolError::input(match error {
        KernelError::Bandwidth => format!("--bandwidth {bandwidth_hz}: must be a positive number"),
        KernelError::TooLong { .. } => format!("--bandwidth {bandwidth_hz}: at least 1 Hz"),
        KernelError::TooShort => format!("--bandwidth {bandwidth_hz}: at most {LARGEST_BANDWIDTH_HZ} Hz"),
    })
}

fn warn(file: &Path, warning: &dyn std::fmt::Display) {
    eprintln!("warning: {}: {warning}", file.display());
}

fn read_all(options: &ReplayOptions, leg: &LegFile) -> Result<(Vec<Recording>, Vec<Recording>), ToolError> {
    let read = |path: &PathBuf| {
        let recording = Recording::read(path, leg.joints.len())?;
        warn_of_another_leg(&recording, leg);
        Ok::<_, RecordingError>(recording)
    };
    let mut training = options.files.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let mut held_out = options.validate.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    if let Some(fraction) = options.split {
        let parts = training.iter().map(|whole| whole.split(fraction)).collect::<Result<Vec<_>, _>>()?;
        let (first, rest): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        training = first;
        held_out.extend(rest);
    }
    Ok((training, held_out))
}

/// Warns of signs that the recording is from another machine.
fn warn_of_another_leg(recording: &Recording, leg: &LegFile) {
    let (in_file, in_leg) = (recording.joints_in_file, leg.joints.len());
    if in_file > in_leg {
        let warning = format!(
            "holds {in_file} joints, the leg `{}` has {in_leg}: the others are ignored, as if they did not move",
            leg.name
        );
        warn(&recording.file, &warning);
    }
    for (number, (series, joint)) in recording.joints.iter().zip(&leg.joints).enumerate() {
        let angles = series.position_rad.iter().map(|angle| angle.to_degrees());
        let (low, high) =
            angles.fold((f64::MAX, f64::MIN), |(low, high), angle| (low.min(angle), high.max(angle)));
        let [lower, upper] = joint.range_deg;
        if low < lower - RANGE_MARGIN_DEG || high > upper + RANGE_MARGIN_DEG {
            let warning = format!(
                "q{}_rad goes from {low:.0} to {high:.0} deg, the range of `{}` is {lower:.0} to {upper:.0} deg: are \
                 column, unit, direction and zero right?",
                number + 1,
                joint.name
            );
            warn(&recording.file, &warning);
        }
    }
}

/// Every file is a separate motion: windows never span two files.
fn feed<const N: usize, const B: usize>(
    recorder: &mut HostRecorder<N, B>,
    background: &Background<N, B>,
    files: &[Samples<N>],
    role: &'static str,
    mut seen: impl FnMut(usize, f64, &Progress<f32, N, B>),
) -> Vec<Source> {
    let mut sources = Vec::with_capacity(files.len());
    let reach = recorder.delay();
    for (number, samples) in files.iter().enumerate() {
        let (mut rows, before) = (0, recorder.rows());
        let mut take = |index: usize, progress: Option<Progress<f32, N, B>>| {
            let Some(progress) = progress else { return };
            let time_s = samples.start_s + (index - reach) as f64 / 500.0;
            seen(number + 1, time_s, &progress);
            rows += u32::from(progress.rows.is_some());
        };
        for (index, (position, torque)) in samples.position.iter().zip(&samples.torque).enumerate() {
            take(index, recorder.push(&background.device, position, torque));
        }
        let mut index = samples.position.len();
        while let Some(progress) = recorder.flush(&background.device) {
            take(index, progress);
            index += 1;
        }
        rows += recorder.break_off();
        let used = recorder.rows().iter().zip(before).map(|(after, before)| after - before).collect();
        sources.push(Source {
            file: samples.file.clone(),
            role,
            start_s: samples.start_s,
            duration_s: samples.duration_s(),
            rate_hz: samples.rate_hz,
            rows,
            used,
        });
    }
    sources
}
