//! `replay`: the firmware's identification on recordings.

mod cleaning;
mod known_mass;
mod logging_errors;
mod predictions;
mod recordings;
mod screening;
pub mod warnings;

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::PathBuf;
use std::time::Instant;

use scarab::ident::{
    Choice, ConstantRatio, Ends, Estimator, HeldOut, KernelError, Plan, Progress, Recorder, SAMPLE_RATE_HZ,
    SearchState, Solver, Stretches, Thresholds, Unused,
};
use scarab::model::{AnatomicalJoint, Payload};
use scarab_base::error::ToolError;

use crate::formats::leg_file::LegFile;
use crate::formats::leg_file::geometry::anatomy;
use crate::formats::recording::import::Import;
use crate::formats::recording::{Read, Recording};
use crate::leg::background::Background;
use crate::leg::setup::{DEFAULT_SEED, PriorChoice, background};
use crate::report::findings::FindingReport;
use crate::report::reading::ReadReport;
use crate::report::scale::{MassReport, ScaleReport};
use crate::report::series::{Anatomy, Reader, Role, Series};
use crate::report::{RunReport, Source};
use crate::run::analysis::{Circumstances, Motion};
use crate::run::logging_errors::encoder::Encoders;
use crate::run::resample::{BandwidthWarning, Resampled};
use cleaning::cleaned;
use known_mass::{load_base, settled};
use logging_errors::{
    Subject, Whole, chosen_bandwidth, corrected, encoders, is_explained_by_noise, noise_density, sample_noise,
};
use predictions::{Prediction, write_predictions};
use screening::{Continuity, Screening, refuse_copies};

/// Reserved filter taps: bandwidths from 1 Hz.
const TAPS: usize = 2048;
/// Open outputs of that filter.
const PENDING: usize = 205;
/// Sample time of the firmware, s.
const GRID_S: f64 = 1.0 / SAMPLE_RATE_HZ;
/// Evaluations between two updates of the search.
const SLICE: u32 = 20;
/// Lowest bandwidth, tenths of a Hz.
const LOWEST_TENTHS: u32 = 10;

/// Recordings of a replay, each with how it was read.
#[derive(Clone, Debug, Default)]
pub struct Recordings {
    /// Training set.
    pub training: Vec<Read>,
    /// Held out for validation.
    pub held_out: Vec<Read>,
    /// Recorded with the leg's `payload`; they determine the scale of the torques.
    pub with_payload: Vec<Read>,
}

/// Options of a replay.
#[derive(Clone, Debug)]
pub struct ReplayOptions {
    /// Share of each training recording that trains; the rest validates.
    pub split: Option<f64>,
    /// Frequency at which the low-pass is 3 dB down, Hz.
    pub bandwidth_hz: f64,
    /// Whether the bandwidth is chosen by the encoders' steps instead.
    pub chooses_bandwidth: bool,
    /// One-time or sequential.
    pub plan: Plan,
    /// Prior for the search box.
    pub prior: PriorChoice,
    /// Estimator; only the robust one excludes disturbances and searches Stribeck friction.
    pub estimator: Estimator,
    /// Seed of the swarm.
    pub swarm_seed: u64,
    /// Output file for the predicted torque of the validation part.
    pub csv: Option<PathBuf>,
    /// Delay of the torque against the angle to be removed, ms: none, one for all joints, or one for each.
    pub torque_delay_ms: Vec<f64>,
    /// Whether an even clock replaces the time stamps.
    pub even_stamps: bool,
    /// Known load in all recordings, to be subtracted.
    pub load: Option<Payload<f64>>,
    /// Known mass in [`Recordings::with_payload`].
    pub payload: Option<Payload<f64>>,
    /// How the recordings were read from files, for options that read them otherwise.
    pub import: Option<Import>,
}

impl ReplayOptions {
    /// Defaults for a leg: its bandwidth and prior, one-time, robust, nothing held out.
    #[must_use]
    pub fn of(leg: &LegFile) -> Self {
        Self {
            split: None,
            bandwidth_hz: leg.bandwidth_hz,
            chooses_bandwidth: false,
            plan: Plan::OneTime,
            prior: PriorChoice::Default,
            estimator: Estimator::Robust,
            swarm_seed: DEFAULT_SEED,
            csv: None,
            torque_delay_ms: Vec::new(),
            even_stamps: false,
            load: None,
            payload: None,
            import: None,
        }
    }

    /// Checks what concerns several options.
    fn check(&self, recordings: &Recordings) -> Result<(), ToolError> {
        let Recordings { held_out, with_payload, .. } = recordings;
        let refused = |reason: &str| Err(ToolError::input(reason));
        if self.split.is_some_and(|share| !(share > 0.0 && share < 1.0)) {
            return refused("--split: must be above 0 and below 1");
        }
        if self.split.is_some() && !held_out.is_empty() {
            return refused("--split and --validate exclude each other");
        }
        match (self.payload.is_some(), with_payload.is_empty()) {
            (true, true) => refused("--payload needs --with-payload: recordings of the leg with that mass"),
            (false, false) => refused("--with-payload needs --payload: the mass in those recordings"),
            _ => Ok(()),
        }
    }
}

type HostRecorder<const N: usize, const B: usize> = Recorder<f32, N, B, TAPS, PENDING>;

/// Result of a replay with its files.
#[derive(Clone, Debug)]
pub struct Replayed {
    /// Bandwidth, Hz.
    pub bandwidth_hz: f64,
    /// Report of the identification.
    pub run: RunReport,
    /// Files, training first.
    pub sources: Vec<Source>,
    /// Curves of every file.
    pub series: Series,
    /// Doubts about recordings and leg that do not change the result, in words.
    pub warnings: Vec<String>,
}

/// One file on the firmware's grid, as D-H angles and torques.
struct Samples<const N: usize> {
    file: PathBuf,
    /// Outliers replaced before resampling, converted to samples of the grid.
    replaced: [u32; N],
    /// Doubt about the bandwidth at this rate.
    warning: Option<BandwidthWarning>,
    rate_hz: f64,
    start_s: f64,
    /// Points without a valid sample, in order.
    excluded: Vec<Range<usize>>,
    position: Vec<[f32; N]>,
    torque: Vec<[f32; N]>,
}

impl<const N: usize> Samples<N> {
    fn of(
        recording: &Recording,
        anatomy: &[AnatomicalJoint<f64>; N],
        options: &ReplayOptions,
        screening: &Screening,
    ) -> Self {
        let (clean, replaced) = cleaned::<N>(recording);
        let (recording, replaced) = match options.estimator {
            Estimator::Robust => (&clean, replaced),
            Estimator::Plain => (recording, [0; N]),
        };
        let grid = Resampled::of(recording);
        // Unit: samples of the grid, as in the recorder.
        let share = grid.len() as f64 / recording.time_s.len() as f64;
        let replaced = replaced.map(|count| (f64::from(count) * share).round() as u32);
        let points = 0..grid.len();
        let position = points.clone().filter_map(|point| grid.position_rad::<N>(point));
        let torque = points.filter_map(|point| grid.torque_nm::<N>(point));
        Self {
            file: recording.file.clone(),
            replaced,
            warning: grid.bandwidth_warning(options.bandwidth_hz),
            rate_hz: grid.native_rate_hz,
            start_s: grid.start_s,
            excluded: screening.excluded(recording, grid.start_s),
            position: position
                .map(|q| core::array::from_fn(|joint| anatomy[joint].angle_to_chain(q[joint]) as f32))
                .collect(),
            torque: torque
                .map(|tau| core::array::from_fn(|joint| anatomy[joint].to_chain(tau[joint]) as f32))
                .collect(),
        }
    }

    /// Doubt about the bandwidth, with the file's name.
    fn warning(&self) -> Option<String> {
        self.warning.as_ref().map(|warning| format!("{}: {warning}", self.file.display()))
    }

    fn duration_s(&self) -> f64 {
        self.position.len() as f64 / SAMPLE_RATE_HZ
    }
}

/// Identifies from recordings and validates on the held-out ones.
pub fn replay<const N: usize, const B: usize>(
    leg: &LegFile,
    recordings: &Recordings,
    options: &ReplayOptions,
) -> Result<Replayed, ToolError> {
    options.check(recordings)?;
    let mut background = background::<N, B>(leg, options.prior, options.swarm_seed)?;
    background.use_estimator(options.estimator);
    let mut options = options.clone();
    if options.chooses_bandwidth {
        options.bandwidth_hz = chosen_bandwidth(leg, &background, recordings, &options)?;
    }
    let options = &options;
    let Some(payload) = &options.payload else {
        return identified(leg, background, recordings, options, None);
    };
    let known_mass::Found { scale, read, warnings } =
        known_mass::scale(leg, &background, recordings, options, payload)?;
    let mut replayed = identified(leg, background, recordings, options, scale.trusted())?;
    replayed.run.read.get_or_insert_default().extend(read);
    replayed.warnings.extend(warnings);
    let used = core::array::from_fn(|joint| leg.joints[joint].torque_per_ampere);
    replayed.run.scale = ScaleReport::of(&scale, &used);
    Ok(replayed)
}

/// Identifies; torques are divided by `scale`, recorded over true torque of each joint.
fn identified<const N: usize, const B: usize>(
    leg: &LegFile,
    mut background: Background<N, B>,
    recordings: &Recordings,
    options: &ReplayOptions,
    scale: Option<[ConstantRatio<f32>; N]>,
) -> Result<Replayed, ToolError> {
    let started = Instant::now();
    let anatomy = anatomy::<N>(leg)?;
    let ratios = scale.map_or([1.0; N], |scale| scale.map(|found| f64::from(found.ratio)));
    let mut recorder = Box::new(new_recorder::<N, B>(options.bandwidth_hz)?);
    recorder.set_estimator(options.estimator);
    let Parts { training, held_out, wholes, screening, read } = parts(recordings, options, leg, &ratios)?;
    let mut warnings: Vec<String> = warnings::of_geometry(leg).collect();
    warnings.extend(wholes.iter().flat_map(|whole| warnings::of_another_leg(&whole.recording, leg)));
    warnings.extend(screening.warnings());
    let encoders: Encoders<N> = encoders(&wholes, leg);
    encoders.describe(leg, options.bandwidth_hz, &mut background.model);
    encoders.describe(leg, options.bandwidth_hz, &mut background.device);
    let noise = [&training, &held_out].map(|files| noise_density::<N>(files, options.bandwidth_hz));
    let on_grid = |recordings: &[Recording]| -> Vec<Samples<N>> {
        recordings.iter().map(|recording| Samples::of(recording, &anatomy, options, &screening)).collect()
    };
    let (training, held_out) = (on_grid(&training), on_grid(&held_out));
    warnings.extend(training.iter().chain(&held_out).filter_map(Samples::warning));
    // Both parts of a file that is split give the same warning.
    let mut seen = BTreeSet::new();
    warnings.retain(|warning| seen.insert(warning.clone()));

    let mut sources = feed(&mut recorder, &background, &training, "training", |_, _, _| {});
    // The bias of the parameters is judged instead (`logging_errors::encoder`).
    let thresholds = Thresholds { largest_pulse_share: f32::INFINITY, ..Thresholds::default() };
    let mut record = recorder.finish();
    for (count, joint) in record.outliers.replaced.iter_mut().zip(0..) {
        *count += training.iter().map(|samples: &Samples<N>| samples.replaced[joint]).sum::<u32>();
    }
    record.noise = sample_noise(&noise[0]);
    let noise_is_known = is_explained_by_noise(&record);
    if !noise_is_known {
        record.noise = [0.0; N];
    }
    let mut solver = settled(&background, record, options);
    let load = load_base(&background, options);
    let with_load = |values: [f32; B]| core::array::from_fn(|base| values[base] + load[base]);
    let as_recorded = solver.record().clone();
    if options.load.is_some() {
        solver = settled(&background, as_recorded.corrected(&[1.0; N], &load), options);
    }
    for (joint, found) in scale.iter().flatten().enumerate() {
        let mut moved = [1.0; N];
        moved[joint] += found.sigma / found.ratio;
        let moved = settled(&background, as_recorded.corrected(&moved, &load), options);
        solver.widen(moved.least_squares());
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
    if options.estimator == Estimator::Robust {
        let values = with_load(solver.found());
        let record = if options.load.is_some() { &as_recorded } else { solver.record() };
        let stretches = Stretches::new(&background.device, record, &values);
        time_disturbances(&mut recorder, &background, &training, stretches, &mut solver);
        recorder.clear(Ends::Whole);
    }
    if !noise_is_known {
        recorder.count_disturbances();
    }
    let mut predictions = Vec::new();
    let values = with_load(solver.values());
    let mut looked_at = Box::new(HeldOut::<f32, N, B, PENDING>::new(recorder.reach()));
    let dropped = &solver.record().selection.dropped;
    looked_at.begin(&values, &solver.unexpected(), &solver.row_noise(), dropped);
    let mut continuity = Continuity::default();
    sources.extend(feed(&mut recorder, &background, &held_out, "validation", |file, time_s, progress| {
        if continuity.breaks(file, time_s) {
            looked_at.break_off();
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
    if options.load.is_some() {
        unused = unused.corrected(&[1.0; N], &load);
    }
    unused.noise = if noise_is_known { sample_noise(&noise[1]) } else { [0.0; N] };
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
    let mut run =
        background.report(&solver, verdict, &[motion(solver.record().clone())], &validation, &circumstances);
    let searches_stribeck = |hz: f64| {
        let mut model = background.model.clone();
        encoders.describe(leg, hz, &mut model);
        (0..N).all(|joint| {
            model.stribeck_choice[joint] == Choice::Off || model.stribeck_choice(joint).is_possible()
        })
    };
    let largest = |hz: f64| {
        let tenths = (LOWEST_TENTHS..=(10.0 * hz) as u32).rev().map(|tenth| f64::from(tenth) / 10.0);
        std::iter::once(hz).chain(tenths).find(|hz| searches_stribeck(*hz))
    };
    // A misfit above the noise may be vibration; a larger bandwidth passes more of it. Beyond the bandwidths
    // of the Stribeck search it would bias friction.
    let proposed_hz = if noise_is_known && !options.chooses_bandwidth {
        let larger = chosen_bandwidth(leg, &background, recordings, options)?;
        largest(larger).filter(|hz| *hz > options.bandwidth_hz)
    } else {
        None
    };
    let stribeck_hz = if options.estimator == Estimator::Robust && !searches_stribeck(options.bandwidth_hz) {
        largest(options.bandwidth_hz)
    } else {
        None
    };
    let subject = Subject {
        leg,
        background: &background,
        anatomy: &anatomy,
        solver: &solver,
        wholes: &wholes,
        options,
        noise: noise[0],
        screening: &screening,
        load,
        proposed_hz,
        stribeck_hz,
    };
    warnings.extend(subject.examine(&mut run)?);
    run.scale.load = options.load.as_ref().map(MassReport::from);
    run.wall_s = started.elapsed().as_secs_f64();
    run.samples = Some(screening.into_findings());
    run.read = Some(read);
    let series = Series {
        excess: progress,
        floor_chi2: Some(optimum.above),
        ..series(&background, &anatomy, &solver, values, options.bandwidth_hz, &training, &held_out)?
    };
    Ok(Replayed { bandwidth_hz: options.bandwidth_hz, run, sources, series, warnings })
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

/// Curves of every file, predicted by `values`.
fn series<const N: usize, const B: usize>(
    background: &Background<N, B>,
    anatomy: &[AnatomicalJoint<f64>; N],
    solver: &Solver<f32, N, B>,
    values: [f32; B],
    bandwidth_hz: f64,
    training: &[Samples<N>],
    held_out: &[Samples<N>],
) -> Result<Series, ToolError> {
    let anatomy = Anatomy {
        direction: anatomy.map(|joint| joint.direction()),
        zero_rad: anatomy.map(|joint| joint.zero_offset()),
    };
    let model = &background.device;
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

/// Recordings as they are used.
struct Parts {
    /// Training parts.
    training: Vec<Recording>,
    /// Held-out parts.
    held_out: Vec<Recording>,
    /// Whole files.
    wholes: Vec<Whole>,
    /// Findings about the samples.
    screening: Screening,
    /// How each recording was read.
    read: Vec<ReadReport>,
}

/// Corrects all recordings, examines them, and splits them as requested.
fn parts(
    recordings: &Recordings,
    options: &ReplayOptions,
    leg: &LegFile,
    ratios: &[f64],
) -> Result<Parts, ToolError> {
    let of = |reads: &[Read]| -> Result<Vec<Recording>, ToolError> {
        reads.iter().map(|read| corrected(read.recording.clone(), options, ratios)).collect()
    };
    let (mut training, mut held_out) = (of(&recordings.training)?, of(&recordings.held_out)?);
    let read = recordings.training.iter().chain(&recordings.held_out).map(|read| read.report.clone());
    let share =
        |recording: &Recording| options.split.map_or(f64::INFINITY, |share| share * recording.duration_s());
    let whole = |recording: &Recording, training_s| Whole { recording: recording.clone(), training_s };
    let mut wholes: Vec<Whole> = training.iter().map(|file| whole(file, share(file))).collect();
    wholes.extend(held_out.iter().map(|file| whole(file, 0.0)));
    refuse_copies(&training, &held_out, "--validate")?;
    let all: Vec<&Recording> = training.iter().chain(&held_out).collect();
    let screening = Screening::of(&all, leg, options.bandwidth_hz);
    if let Some(fraction) = options.split {
        let parts = training.iter().map(|whole| whole.split(fraction)).collect::<Result<Vec<_>, _>>()?;
        let (first, rest): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        training = first;
        held_out.extend(rest);
    }
    Ok(Parts { training, held_out, wholes, screening, read: read.collect() })
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
        let (mut rows, mut cut, before) = (0, 0, recorder.rows());
        let mut is_running = true;
        let mut take = |index: usize, progress: Option<Progress<f32, N, B>>| {
            let Some(progress) = progress else { return };
            let time_s = samples.start_s + (index - reach) as f64 / SAMPLE_RATE_HZ;
            seen(number + 1, time_s, &progress);
            rows += u32::from(progress.rows.is_some());
        };
        for (index, (position, torque)) in samples.position.iter().zip(&samples.torque).enumerate() {
            let is_excluded = samples.excluded.iter().any(|points| points.contains(&index));
            if is_excluded && is_running {
                for late in index.. {
                    let Some(progress) = recorder.flush(&background.device) else { break };
                    take(late, progress);
                }
                cut += recorder.break_off();
            }
            is_running = !is_excluded;
            if is_running {
                take(index, recorder.push(&background.device, position, torque));
            }
        }
        let mut index = samples.position.len();
        while let Some(progress) = recorder.flush(&background.device) {
            take(index, progress);
            index += 1;
        }
        rows += cut + recorder.break_off();
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
