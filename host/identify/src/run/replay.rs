//! `replay`: the firmware's identification on recordings.

mod cleaning;
mod judge;
mod known_mass;
mod logging_errors;
mod predictions;
mod read;
mod recordings;
mod rows;
mod screening;
mod solve;
pub mod warnings;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

use scarab::ident::{Choice, ConstantRatio, Estimator, Plan};
use scarab::model::{AnatomicalJoint, Payload};
use scarab_base::error::ToolError;

use crate::formats::leg_file::LegFile;
use crate::formats::leg_file::check::ACCEPTED_PERCENT;
use crate::formats::leg_file::geometry::anatomy;
use crate::formats::recording::Read;
use crate::formats::recording::import::Import;
use crate::leg::additional_torque::Additional;
use crate::leg::background::Background;
use crate::leg::setup::{DEFAULT_SEED, PriorChoice, background};
use crate::report::model_choice::ModelChoiceReport;
use crate::report::scale::{MassReport, ScaleReport};
use crate::report::series::{Reader, Role, Series};
use crate::report::{RunReport, Source};
use crate::run::analysis::{Circumstances, Motion};
use crate::run::logging_errors::encoder::Encoders;
use crate::run::resample::{PENDING, TAPS};
use crate::with_leg_size;
use judge::{Judged, judge};
use logging_errors::{Subject, chosen_bandwidth, encoders, noise_density};
use predictions::{Prediction, write_predictions};
use read::{Parts, parts};
use rows::{Samples, bandwidth_error, new_recorder};
use solve::{Solved, solve};

/// Most identifications with additional torques after the first.
const ROUNDS: usize = 4;
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
    /// Error accepted beside noise, percent of the rms torque.
    pub accept_error_percent: f64,
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
    pub fn from_leg(leg: &LegFile) -> Self {
        Self {
            split: None,
            bandwidth_hz: leg.bandwidth_hz,
            chooses_bandwidth: false,
            plan: Plan::OneTime,
            prior: PriorChoice::Default,
            accept_error_percent: leg.accept_error_percent,
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
        if !ACCEPTED_PERCENT.contains(&self.accept_error_percent) {
            return refused("--accept-error: must be 0 to 70 percent of the rms torque");
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

/// Identifies from recordings and validates on the held-out ones.
///
/// # Errors
/// The options exclude each other, or leg and recordings do not fit.
pub fn replay(
    leg: &LegFile,
    recordings: &Recordings,
    options: &ReplayOptions,
) -> Result<Replayed, ToolError> {
    with_leg_size!(leg, replay_sized(leg, recordings, options))
}

fn replay_sized<const N: usize, const B: usize>(
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
        return settled(leg, &background, recordings, options, None);
    };
    let known_mass::Found { scale, read, warnings } =
        known_mass::scale(leg, &background, recordings, options, payload)?;
    let mut replayed = settled(leg, &background, recordings, options, scale.trusted())?;
    replayed.run.read.get_or_insert_default().extend(read);
    replayed.warnings.extend(warnings);
    let used = core::array::from_fn(|joint| leg.joints[joint].torque_per_ampere);
    replayed.run.scale = ScaleReport::new(&scale, &used);
    Ok(replayed)
}

/// An identification with what is needed for another.
struct Identified<const N: usize> {
    replayed: Replayed,
    predictions: Vec<Prediction<N>>,
    /// Additional torques with which to identify again.
    additional: Option<Additional>,
}

/// Identifies, then again without the additional torques that the leg file demands or the misfit shows. Where
/// the leg file leaves them to the data and the recordings are refused all the same, the first result holds.
fn settled<const N: usize, const B: usize>(
    leg: &LegFile,
    background: &Background<N, B>,
    recordings: &Recordings,
    options: &ReplayOptions,
    scale: Option<[ConstantRatio<f32>; N]>,
) -> Result<Replayed, ToolError> {
    let again =
        |additional: &Additional| identified(leg, background.clone(), recordings, options, scale, additional);
    let mut chosen = again(&Additional::default())?;
    let mut next = chosen.additional.take();
    for _ in 0..ROUNDS {
        let Some(additional) = next.take() else { break };
        let mut latest = again(&additional)?;
        next = latest.additional.take();
        let is_demanded =
            latest.replayed.run.model_choice.iter().any(ModelChoiceReport::is_demanded_addition);
        if is_demanded || latest.replayed.run.accepted() {
            chosen = latest;
        }
    }
    if let Some(path) = &options.csv {
        write_predictions(path, &chosen.predictions, &anatomy::<N>(leg)?)?;
    }
    Ok(chosen.replayed)
}

/// Identifies; torques are divided by `scale`, recorded over true torque of each joint, and the additional
/// ones subtracted.
///
/// | stage | from | to |
/// | --- | --- | --- |
/// | [`read`](parts) | recordings | corrected, examined and split |
/// | [`rows`] | each file | samples of the firmware's grid, cleaned |
/// | [`solve`](solve()) | samples of the training part | least squares, swarm, disturbances |
/// | [`judge`](judge()) | the result, and samples of the held-out part | verdict and its tests |
/// | [`logging_errors`] | whole recordings and the result | likely causes, widened sigma |
fn identified<const N: usize, const B: usize>(
    leg: &LegFile,
    mut background: Background<N, B>,
    recordings: &Recordings,
    options: &ReplayOptions,
    scale: Option<[ConstantRatio<f32>; N]>,
    additional: &Additional,
) -> Result<Identified<N>, ToolError> {
    let started = Instant::now();
    let anatomy = anatomy::<N>(leg)?;
    let recorder = Box::new(new_recorder(options.bandwidth_hz)?);
    let ratios = scale.map_or([1.0; N], |scale| scale.map(|found| f64::from(found.ratio)));
    let parts = parts(recordings, options, leg, &ratios, additional)?;
    let encoders = encoders(&parts.wholes, leg);
    encoders.describe(leg, options.bandwidth_hz, &mut background.model);
    encoders.describe(leg, options.bandwidth_hz, &mut background.device);
    // What is known of an offset is not known of its sum with a spring's torque at rest.
    for joint in additional.springs() {
        for choice in [&mut background.model.drive_choice[joint], &mut background.device.drive_choice[joint]]
        {
            choice.within_nm = None;
        }
    }
    let noise = [&parts.training, &parts.held_out].map(|part| noise_density::<N>(part, options.bandwidth_hz));
    let [training, held_out] = [&parts.training, &parts.held_out].map(|part| {
        let samples = part.iter().map(|file| Samples::new(file, &anatomy, options, &parts.screening));
        samples.collect::<Vec<_>>()
    });
    let mut warnings = doubts(leg, &parts, training.iter().chain(&held_out));

    let mut solved = solve(&mut background, recorder, &training, &noise[0], options, scale);
    let accepted_error = options.accept_error_percent / 100.0;
    let mut judged = judge(&background, &mut solved, &held_out, &noise[1], accepted_error);
    let predictions = std::mem::take(&mut judged.predictions);
    let sources = solved.sources.iter().chain(&judged.sources).cloned().collect();
    let simulated_s = training.iter().chain(&held_out).map(Samples::duration_s).sum();
    let mut run = report(&background, &solved, judged, options, simulated_s);

    let [proposed_hz, stribeck_hz] =
        bandwidths(leg, &background, &encoders, recordings, options, solved.is_explained)?;
    let subject = Subject {
        leg,
        background: &background,
        anatomy: &anatomy,
        solver: &solved.solver,
        wholes: &parts.wholes,
        options,
        noise: noise[0],
        screening: &parts.screening,
        load: solved.load.unwrap_or([0.0; B]),
        additional,
        proposed_hz,
        stribeck_hz,
    };
    let examined = subject.examine(&mut run)?;
    warnings.extend(examined.warning);
    run.scale.load = options.load.as_ref().map(MassReport::from);
    run.samples = Some(parts.screening.findings);
    run.read = Some(parts.read);
    run.wall_s = started.elapsed().as_secs_f64();
    let series = series(&background, &anatomy, &solved, options.bandwidth_hz, &training, &held_out)?;
    let replayed = Replayed { bandwidth_hz: options.bandwidth_hz, run, sources, series, warnings };
    Ok(Identified { replayed, predictions, additional: examined.additional })
}

/// Doubts that do not change the result, each once: both parts of a file that is split give the same one.
fn doubts<'a, const N: usize>(
    leg: &LegFile,
    parts: &Parts,
    files: impl Iterator<Item = &'a Samples<N>>,
) -> Vec<String> {
    let mut warnings: Vec<String> = warnings::of_geometry(leg).collect();
    warnings.extend(parts.read.iter().filter_map(|read| read.warning.clone()));
    warnings.extend(parts.wholes.iter().flat_map(|whole| warnings::of_another_leg(&whole.recording, leg)));
    warnings.extend(parts.screening.warnings());
    warnings.extend(files.filter_map(Samples::warning));
    let mut seen = BTreeSet::new();
    warnings.retain(|warning| seen.insert(warning.clone()));
    warnings
}

/// Report of the identification, without the causes that the recordings show.
fn report<const N: usize, const B: usize>(
    background: &Background<N, B>,
    solved: &Solved<N, B>,
    judged: Judged<N, B>,
    options: &ReplayOptions,
    simulated_s: f64,
) -> RunReport {
    let motion = |record| Motion { name: "recording".into(), record, truth: None };
    let circumstances = Circumstances {
        findings: judged.findings,
        estimator: options.estimator,
        iterations_to_half_chi2: solved.search.to_half,
        simulated_s,
        ..Circumstances::default()
    };
    let training = [motion(solved.solver.record().clone())];
    let validation: Vec<_> = judged.unused.map(motion).into_iter().collect();
    background.report(&solved.solver, judged.verdict, &training, &validation, &circumstances)
}

/// Bandwidths to propose: a larger one that the encoders allow, and the largest of the Stribeck search where
/// they are too coarse for it at the present one.
///
/// A misfit above the noise may be vibration; a larger bandwidth passes more of it. Beyond the bandwidths of
/// the Stribeck search it would bias friction.
fn bandwidths<const N: usize, const B: usize>(
    leg: &LegFile,
    background: &Background<N, B>,
    encoders: &Encoders,
    recordings: &Recordings,
    options: &ReplayOptions,
    is_explained: bool,
) -> Result<[Option<f64>; 2], ToolError> {
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
    let present = options.bandwidth_hz;
    let mut proposed = None;
    if is_explained && !options.chooses_bandwidth {
        let larger = chosen_bandwidth(leg, background, recordings, options)?;
        proposed = largest(larger).filter(|hz| *hz > present);
    }
    let is_too_coarse = options.estimator == Estimator::Robust && !searches_stribeck(present);
    Ok([proposed, is_too_coarse.then(|| largest(present)).flatten()])
}

/// Curves of every file, predicted by the result, and the search's.
fn series<const N: usize, const B: usize>(
    background: &Background<N, B>,
    anatomy: &[AnatomicalJoint<f64>; N],
    solved: &Solved<N, B>,
    bandwidth_hz: f64,
    training: &[Samples<N>],
    held_out: &[Samples<N>],
) -> Result<Series, ToolError> {
    let model = &background.device;
    let mut reader =
        Reader::<N, B, TAPS, PENDING>::new(model, *anatomy, solved.values(), bandwidth_hz as f32)
            .map_err(|error| bandwidth_error(bandwidth_hz, error))?;
    let parts = training.iter().map(|file| (file, Role::Training));
    let parts = parts.chain(held_out.iter().map(|file| (file, Role::Validation)));
    let motions = parts.map(|(file, role)| {
        let name = file.file.file_name().unwrap_or(file.file.as_os_str()).to_string_lossy();
        let samples = file.position.iter().copied().zip(file.torque.iter().copied());
        reader.motion(name, role, file.start_s, samples)
    });
    let motions = motions.collect();
    let (series, search) = (reader.series(&solved.solver, motions), &solved.search);
    Ok(Series { excess: search.excess.clone(), floor_chi2: Some(search.floor), ..series })
}
