//! Complete simulated run: the firmware's leg against the plant, with data that only a simulation provides.

use std::path::Path;
use std::time::Instant;

use hal_sim::world::TICK_S;
use scarab::leg::{Activity, ControlRequest, IdentifyPhase, LegConfiguration, LoggedSample, Segment, Step};
use scarab::motion::Periodic;
use scarab::real::sqrt;
use scarab::servo::{SERVO_RATE_HZ, TICKS_PER_LOG};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::recording::{JointSeries, Recording};
use scarab_identify::report::series::Series;
use scarab_identify::report::{RunReport, TrackingReport};
use scarab_identify::run::progress::{self, Progress};
use scarab_identify::with_leg_size;

use crate::options::SimulationOptions;
use crate::pair::{Context, Pair};
use crate::run_state::{RunState, Tick};
use crate::shaking::Shaking;
use crate::watch::Watch;
use crate::{perturb, scale};

/// Limit of a run, s.
const LONGEST_RUN_S: f64 = 300.0;

/// Result of a simulated run.
#[derive(Clone, Debug)]
pub struct SimulatedRun {
    /// The report.
    pub report: RunReport,
    /// The motion identified from, then those that were predicted.
    pub recordings: Vec<Recording>,
    /// Curves; empty unless requested.
    pub series: Series,
}

/// Sees a run while it is simulated.
pub trait Observer {
    /// Begins a run; `progress` makes an estimator of its samples.
    ///
    /// # Errors
    /// The estimator's filter does not fit.
    fn begin(&mut self, progress: &dyn Fn() -> Result<Box<dyn Progress>, ToolError>)
    -> Result<(), ToolError>;
    /// Sees the tick just run.
    fn tick(&mut self, run: &dyn RunState);
}

/// Sees nothing.
impl Observer for () {
    fn begin(&mut self, _: &dyn Fn() -> Result<Box<dyn Progress>, ToolError>) -> Result<(), ToolError> {
        Ok(())
    }
    fn tick(&mut self, _: &dyn RunState) {}
}

/// Drives, identifies, validates and tracks one simulated leg.
///
/// # Errors
/// The leg file cannot be used, or a perturbation does not fit.
pub fn simulate(leg: &LegFile, options: &SimulationOptions) -> Result<SimulatedRun, ToolError> {
    simulate_observed(leg, options, &mut ())
}

/// [`simulate`] with an observer, which sees all but the tracking after the verdict.
///
/// # Errors
/// Those of [`simulate`].
pub fn simulate_observed(
    leg: &LegFile,
    options: &SimulationOptions,
    observer: &mut dyn Observer,
) -> Result<SimulatedRun, ToolError> {
    with_leg_size!(leg, simulate_observed_sized(leg, options, observer))
}

fn simulate_observed_sized<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &SimulationOptions,
    observer: &mut dyn Observer,
) -> Result<SimulatedRun, ToolError> {
    let started = Instant::now();
    let wrong = options.perturbations.as_slice();
    let simulated = perturb::simulated(leg, wrong)?;
    let mut context = Context::<N, B>::new(&perturb::believed(leg, wrong)?, options)?;
    perturb::configure(&mut context, wrong)?;
    let LegConfiguration { bandwidth_hz, estimator, plan, .. } = context.configuration;
    let progress = || progress::of_background(context.background.clone(), bandwidth_hz, estimator, plan);
    observer.begin(&progress)?;
    let Driven { pair, mut watch, stopped, shaking } = drive(leg, &simulated, &context, options, observer)?;
    let (mut report, series, log) = if stopped.is_some() {
        watch.report(&pair, options, Vec::new(), stopped, started)?
    } else {
        let tracking = track(&context, &pair);
        watch.scale = Some(scale::find(&context, &pair, options.payload.as_ref(), options.load.as_ref())?);
        watch.report(&pair, options, tracking, None, started)?
    };
    shaking.explain(&simulated, &mut report);
    Ok(SimulatedRun { report, recordings: recordings(leg, &log), series })
}

/// Recordings of a log: the training motion, which may be empty, then each validation motion.
fn recordings<const N: usize>(leg: &LegFile, log: &[LoggedSample<N>]) -> Vec<Recording> {
    let of = |segment: Segment| {
        let samples = log.iter().filter(|logged| logged.segment == Some(segment));
        recorded(Path::new("simulation"), leg, samples)
    };
    let validation = (0..=u8::MAX).map(|motion| of(Segment::Validation(motion)));
    let validation = validation.take_while(|recording| !recording.time_s.is_empty());
    core::iter::once(of(Segment::Training)).chain(validation).collect()
}

/// Recording of samples of a log: anatomical angles and torques. `name` stands for the file.
pub(crate) fn recorded<'a, const N: usize>(
    name: &Path,
    leg: &LegFile,
    log: impl IntoIterator<Item = &'a LoggedSample<N>>,
) -> Recording {
    let mut recording = Recording {
        file: name.to_owned(),
        time_s: Vec::new(),
        joints: vec![JointSeries::default(); N],
        joints_in_file: N,
    };
    let mut first = None;
    for logged in log {
        let ticks = logged.sample.tick.wrapping_sub(*first.get_or_insert(logged.sample.tick));
        recording.time_s.push(f64::from(ticks) / f64::from(SERVO_RATE_HZ));
        for (joint, series) in recording.joints.iter_mut().enumerate() {
            let file = &leg.joints[joint];
            let radian_per_count = file.encoder.step_rad();
            let counts = f64::from(logged.sample.counts_sum[joint]) / f64::from(TICKS_PER_LOG);
            let direction = if file.direction < 0 { -1.0 } else { 1.0 };
            series.position_rad.push(leg.side.mounting() * counts * radian_per_count);
            series.torque_nm.push(direction * f64::from(logged.sample.torque_nm[joint]));
        }
    }
    recording
}

/// Leg after one identification, with its observation.
pub struct Driven<'a, const N: usize, const B: usize> {
    /// Leg and plant after the verdict.
    pub pair: Pair<N, B>,
    /// Data unknown to the firmware.
    pub watch: Watch<'a, N, B>,
    /// Reason for a missing verdict.
    pub stopped: Option<String>,
    /// Speed of the plant beside its command.
    pub(crate) shaking: Shaking<N>,
}

/// Runs from drive off to the verdict: the firmware of `context` against the plant `simulated`;
/// `leg` is the user's leg.
pub fn drive<'a, const N: usize, const B: usize>(
    leg: &LegFile,
    simulated: &LegFile,
    context: &'a Context<N, B>,
    options: &SimulationOptions,
    observer: &mut dyn Observer,
) -> Result<Driven<'a, N, B>, ToolError> {
    let wrong = options.perturbations.as_slice();
    let mut pair = Pair::new(simulated, context, options.seed)?;
    if let Some(load) = &options.load {
        pair.world.attach(load.joint, load.mass, load.position.into());
    }
    perturb::at_start(leg, &mut pair, wrong)?;
    let mut shaking = Shaking::new(context.anatomy());
    let mut watch = Watch::new(context);
    if !pair.enable(context.gravity) {
        let words = "the drive refused to be enabled at the start: the leg is outside its range";
        return Ok(Driven { pair, watch, stopped: Some(words.into()), shaking });
    }
    let mut request = Some(ControlRequest::Identify);
    let largest = (LONGEST_RUN_S / TICK_S) as u64;
    let mut before = Activity::Idle;
    loop {
        // State behind this tick's sensor readings, without noise.
        let (torque, sticking) = (pair.world.motor_torque(), pair.world.sticking());
        let output = pair.tick(request.take(), context.gravity);
        watch.see(&pair, &torque, &sticking, output.logged.as_ref());
        shaking.take(&pair.world, &output.motion);
        observer.tick(&Tick { context, pair: &pair, output: &output });
        let activity = pair.leg.control().activity();
        if activity != before {
            match activity {
                Activity::Identify(IdentifyPhase::Excite) => {
                    perturb::at_excitation(simulated, context, &mut pair, wrong);
                }
                Activity::Identify(IdentifyPhase::Settle) => {
                    perturb::after_excitation(simulated, &mut pair, wrong);
                }
                Activity::Identify(IdentifyPhase::Validate { motion: 0, step: Step::Approach }) => {
                    perturb::before_validation(context, &mut pair, wrong);
                }
                _ => {}
            }
            before = activity;
        }
        if !matches!(activity, Activity::Identify(_)) {
            let stopped = pair.leg.control().verdict().is_none().then(|| pair.stop_words(leg));
            return Ok(Driven { pair, watch, stopped, shaking });
        }
        if pair.ticks > largest {
            return Err(leg.error("identification did not end").into());
        }
    }
}

/// Position error on the 3 s gait, with feedback alone and with the model, from the same instant.
fn track<const N: usize, const B: usize>(context: &Context<N, B>, pair: &Pair<N, B>) -> Vec<TrackingReport> {
    let motion = context.motions.validation[1];
    let error = |with_model: bool| -> Option<[f64; N]> {
        (!with_model || pair.leg.control().model().is_some())
            .then(|| tracking_error(context, pair.clone(), motion, with_model))
            .flatten()
    };
    let (without, with) = (error(false), error(true));
    (0..N)
        .map(|joint| TrackingReport {
            joint: joint + 1,
            rms_deg_without_model: without.map(|error| error[joint]).into(),
            rms_deg_with_model: with.map(|error| error[joint]).into(),
        })
        .collect()
}

fn tracking_error<const N: usize, const B: usize>(
    context: &Context<N, B>,
    mut pair: Pair<N, B>,
    motion: Periodic<N>,
    with_model: bool,
) -> Option<[f64; N]> {
    let anatomy = context.anatomy();
    let motion = context.configuration.prove(motion).ok()?;
    if !pair.leg.set_tracked(motion) {
        return None;
    }
    let mut request = Some(ControlRequest::Track { with_model });
    let (mut squared, mut count) = ([0.0; N], 0_u32);
    let end = pair.ticks + (60.0 / TICK_S) as u64;
    while pair.ticks < end {
        let truth = pair.world.anatomical_position();
        let output = pair.tick(request.take(), context.gravity);
        match pair.leg.control().activity() {
            Activity::Track(Step::Run) => {
                for joint in 0..N {
                    let angle = anatomy[joint].angle_to_chain(truth[joint]);
                    let error = f64::from(output.motion.position_rad[joint]) - angle;
                    squared[joint] += error * error;
                }
                count += 1;
            }
            Activity::Track(Step::Approach) => {}
            _ => break,
        }
    }
    (count > 0).then(|| squared.map(|sum| sqrt(sum / f64::from(count)).to_degrees()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_identify::formats::leg_file::DEFAULT_LEG;

    #[test]
    fn a_run_without_samples_has_an_empty_training_motion() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let recordings = recordings::<2>(&leg, &[]);
        let mut text = Vec::new();
        recordings[0].write(&mut text).expect("memory can be written");
        assert_eq!((recordings.len(), &text[..]), (1, &b"t_s,q1_rad,q2_rad,tau1_Nm,tau2_Nm\n"[..]));
    }
}
