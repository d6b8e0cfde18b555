//! Complete simulated run: the firmware's leg against the plant, with data that only a simulation has.

use std::time::Instant;

use scarab::ident::{Estimator, Plan};
use scarab::leg::{Activity, ControlRequest, IdentifyPhase, LoggedSample, Step};
use scarab::model::Payload;
use scarab::motion::Periodic;
use scarab::real::sqrt;

use super::error::ToolError;
use super::excite::file::Excitation;
use super::leg_file::LegFile;
use super::pair::{Context, Pair};
use super::perturb::{self, Perturbation};
use super::report::{RunReport, TrackingReport};
use super::scale::Scale;
use super::series::Series;
use super::setup::{PriorChoice, SetupError};
use super::watch::Watch;
use crate::world::TICK_S;

/// Limit of a run, s.
const LONGEST_RUN_S: f64 = 300.0;

/// Kind of simulated drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveModel {
    /// Ideal current with a lag.
    #[default]
    Ideal,
    /// Motor, bridge, shunts, counter and supply, under the board's current loops.
    Full,
}

impl DriveModel {
    /// Name in reports and options.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Full => "full",
        }
    }
}

/// Options of a simulated run.
#[derive(Clone, Debug)]
pub struct SimulationOptions {
    /// Seed of noise, pushes and a wrong prior.
    pub seed: u64,
    /// Seed of the swarm.
    pub swarm_seed: u64,
    /// Replaces the noise of the leg file, percent.
    pub torque_noise_percent: Option<f64>,
    /// Ideal or complete drives.
    pub drive: DriveModel,
    /// One-time or sequential.
    pub plan: Plan,
    /// Prior for the search box.
    pub prior: PriorChoice,
    /// Known mass for a second run, which determines the torque constants.
    pub payload: Option<Payload<f64>>,
    /// Known mass that the leg carries all the time.
    pub load: Option<Payload<f64>>,
    /// Deliberate errors.
    pub perturbations: Vec<Perturbation>,
    /// Estimator; the robust one excludes disturbances and searches Stribeck friction by itself.
    pub estimator: Estimator,
    /// Whether curves are recorded.
    pub with_series: bool,
    /// Replaces the default motion; see [`super::excite::run::check`].
    pub excitation: Option<Excitation>,
}

impl SimulationOptions {
    /// Options for the unchanged leg file, with both seeds equal.
    #[must_use]
    pub fn of_seed(seed: u64) -> Self {
        Self {
            seed,
            swarm_seed: seed,
            torque_noise_percent: None,
            drive: DriveModel::Ideal,
            plan: Plan::OneTime,
            prior: PriorChoice::Default,
            payload: None,
            load: None,
            perturbations: Vec::new(),
            estimator: Estimator::Robust,
            with_series: false,
            excitation: None,
        }
    }
}

/// Result of a simulated run.
#[derive(Clone, Debug)]
pub struct SimulatedRun<const N: usize> {
    /// The report.
    pub report: RunReport,
    /// Samples of the motions identified from and predicted.
    pub log: Vec<LoggedSample<N>>,
    /// Curves; empty unless requested.
    pub series: Series,
}

/// Drives, identifies, validates and tracks one simulated leg.
pub fn simulate<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &SimulationOptions,
) -> Result<SimulatedRun<N>, ToolError> {
    let started = Instant::now();
    let wrong = options.perturbations.as_slice();
    let simulated = perturb::simulated(leg, wrong)?;
    let mut context = Context::<N, B>::new(&perturb::believed(leg, wrong)?, options)?;
    perturb::configure(&mut context, wrong)?;
    let Driven { pair, mut watch, stopped } = drive(leg, &simulated, &context, options)?;
    if stopped.is_some() {
        return watch.report(&pair, options, Vec::new(), stopped, started);
    }
    let tracking = track(&context, &pair);
    watch.scale = Some(Scale::find(&context, &pair, options.payload.as_ref(), options.load.as_ref())?);
    watch.report(&pair, options, tracking, None, started)
}

/// Leg after one identification, with its observation.
pub struct Driven<'a, const N: usize, const B: usize> {
    /// Leg and plant after the verdict.
    pub pair: Pair<N, B>,
    /// Data unknown to the firmware.
    pub watch: Watch<'a, N, B>,
    /// Reason for a missing verdict.
    pub stopped: Option<String>,
}

/// Runs from drive off to the verdict: the firmware of `context` against the plant `simulated`;
/// `leg` is the user's leg.
pub fn drive<'a, const N: usize, const B: usize>(
    leg: &LegFile,
    simulated: &LegFile,
    context: &'a Context<N, B>,
    options: &SimulationOptions,
) -> Result<Driven<'a, N, B>, ToolError> {
    let wrong = options.perturbations.as_slice();
    let mut pair = Pair::new(simulated, context, options.seed)?;
    if let Some(load) = &options.load {
        pair.world.attach(load.joint, load.mass, load.place.into());
    }
    perturb::at_start(leg, &mut pair, wrong)?;
    let mut watch = Watch::new(context);
    if !pair.enable(context.gravity) {
        let words = "the drive refused to be enabled at the start: the leg is not where it may be";
        return Ok(Driven { pair, watch, stopped: Some(words.into()) });
    }
    let mut request = Some(ControlRequest::Identify);
    let largest = (LONGEST_RUN_S / TICK_S) as u64;
    let mut before = Activity::Idle;
    loop {
        // State behind this tick's sensor readings, without noise.
        let (torque, sticking) = (pair.world.motor_torque(), pair.world.sticking());
        let output = pair.tick(request.take(), context.gravity);
        watch.see(&pair, &torque, &sticking, output.logged.as_ref());
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
        match activity {
            Activity::Identify(_) => {}
            _ if pair.leg.control().verdict().is_some() => return Ok(Driven { pair, watch, stopped: None }),
            _ => {
                let stopped = Some(pair.stop_words(leg));
                return Ok(Driven { pair, watch, stopped });
            }
        }
        if pair.ticks > largest {
            return Err(SetupError::new(leg, "identification did not end").into());
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
    let scales = context.configuration.joints.map(|joint| joint.scale);
    let motion = context.configuration.prove(motion).ok()?;
    let mut request = Some(ControlRequest::Track { motion, with_model });
    let (mut squared, mut count) = ([0.0; N], 0_u32);
    let end = pair.ticks + (60.0 / TICK_S) as u64;
    while pair.ticks < end {
        let truth = pair.world.anatomical_position();
        let output = pair.tick(request.take(), context.gravity);
        match pair.leg.control().activity() {
            Activity::Track(Step::Run) => {
                for joint in 0..N {
                    let scale = &scales[joint];
                    let angle = f64::from(scale.anatomy.direction()) * truth[joint]
                        + f64::from(scale.anatomy.zero_offset());
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
