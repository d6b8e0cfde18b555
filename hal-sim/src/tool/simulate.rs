//! A whole run in simulation: the firmware's leg against the plant, and what only a simulation knows.

use std::time::Instant;

use scarab::hal::{LegDrives, Sample};
use scarab::ident::{
    Ends, Factor, FilteredRows, Kernel, LARGEST_STILL_SHARE, LowPass, Plan, RowFilter, SAMPLE_RATE_HZ,
    SMOOTHING_BANDWIDTHS, Smoothed, Smoother,
};
use scarab::leg::{Activity, ControlRequest, Leg, LegConfiguration, LoggedSample, Segment, Step};
use scarab::motion::Periodic;
use scarab::safety::{DriveState, PowerRequest};

use super::analysis::{Background, Circumstances, Costs, Motion as RecordedMotion, TruthFit};
use super::leg_file::LegFile;
use super::motions::{Motions, VALIDATION_NAMES};
use super::report::{RunReport, TrackingReport};
use super::setup::{PriorChoice, SetupError, background, configuration};
use crate::world::{TICK_S, World};

/// Taps of the device's filter.
pub const TAPS: usize = 256;
/// Open outputs that go with them.
pub const PENDING: usize = 26;
/// The leg as the device holds it.
pub type DeviceLeg<const N: usize, const B: usize> = Leg<N, B, TAPS, PENDING>;

/// Evaluations of the search in the time left by one servo tick: 8,000 per second, which 26 base parameters take
/// about 30 % of the processor for.
const EVALUATIONS_PER_TICK: u32 = 2;
/// No run takes longer, s.
const LONGEST_RUN_S: f64 = 300.0;

/// What to simulate.
#[derive(Clone, Debug)]
pub struct SimulationOptions {
    /// Of noise, pushes and a wrong prior.
    pub seed: u64,
    /// Of the swarm.
    pub swarm_seed: u64,
    /// Instead of the leg file's.
    pub torque_noise_percent: Option<f64>,
    /// One-time or sequential.
    pub plan: Plan,
    /// Prior for the search box.
    pub prior: PriorChoice,
}

/// A run with what it left behind.
#[derive(Clone, Debug)]
pub struct SimulatedRun<const N: usize> {
    /// The report.
    pub report: RunReport,
    /// Training samples.
    pub log: Vec<LoggedSample<N>>,
}

/// Noise-free torque and sticking, through the same filter chain as the measured torque.
struct TruthChain<const N: usize, const B: usize> {
    torque: Box<Smoother<f32, N, TAPS>>,
    sticking: Box<Smoother<f32, N, TAPS>>,
    filter: Box<RowFilter<f32, N, B, PENDING>>,
    rows: Vec<FilteredRows<f32, N, B>>,
}

impl<const N: usize, const B: usize> TruthChain<N, B> {
    fn new() -> Self {
        Self {
            torque: Box::default(),
            sticking: Box::default(),
            filter: Box::new(RowFilter::new(Ends::Whole)),
            rows: Vec::new(),
        }
    }

    fn start(&mut self) -> Vec<FilteredRows<f32, N, B>> {
        self.torque.clear();
        self.sticking.clear();
        self.filter.clear();
        core::mem::take(&mut self.rows)
    }

    fn push(&mut self, context: &Context<N, B>, position: &[f32; N], torque: &[f32; N], sticking: &[f32; N]) {
        let sticking = self.sticking.push(&context.smoothing, position, sticking);
        let instant: Option<Smoothed<f32, N>> = self.torque.push(&context.smoothing, position, torque);
        if let (Some(instant), Some(sticking)) = (instant, sticking) {
            let mut rows = context.background.device.rows(&instant);
            rows.still = sticking.torque;
            self.rows.extend(self.filter.push(&context.low_pass, &rows));
        }
    }
}

/// Comparison of base values with the noise-free torque of one motion.
fn truth_fit<const N: usize, const B: usize>(
    rows: &[FilteredRows<f32, N, B>],
    values: &[f32; B],
) -> [TruthFit; N] {
    core::array::from_fn(|joint| {
        let (mut squared, mut absolute, mut used) = (0.0, 0.0, 0_usize);
        for row in rows.iter().filter(|row| f64::from(row.still[joint]) <= LARGEST_STILL_SHARE) {
            let predicted: f32 =
                row.regressor[joint].iter().zip(values).map(|(element, value)| element * value).sum();
            squared += f64::from(predicted - row.torque[joint]).powi(2);
            absolute += f64::from(row.torque[joint].abs());
            used += 1;
        }
        let count = used.max(1) as f64;
        TruthFit {
            percent_of_mean_abs: 100.0 * (squared / count).sqrt() / (absolute / count),
            sticking_share: 1.0 - used as f64 / rows.len().max(1) as f64,
        }
    })
}

struct Context<const N: usize, const B: usize> {
    background: Background<N, B>,
    configuration: LegConfiguration<N, B>,
    motions: Motions<N>,
    smoothing: Kernel<f32, TAPS>,
    low_pass: LowPass<f32, TAPS>,
    gravity: [f32; 3],
    /// Standard deviation of each joint's logged torque, N m.
    noise: [f64; N],
}

/// Leg and plant, ticked together.
#[derive(Clone)]
struct Pair<const N: usize, const B: usize> {
    leg: Box<DeviceLeg<N, B>>,
    world: World<N>,
    sample: Sample<N>,
    ticks: u64,
}

impl<const N: usize, const B: usize> Pair<N, B> {
    fn tick(
        &mut self,
        request: Option<ControlRequest<N>>,
        gravity: [f32; 3],
    ) -> scarab::leg::ControlOutput<N> {
        let output = self.leg.tick(&self.sample, request, gravity, EVALUATIONS_PER_TICK);
        self.sample = self.world.tick(output.servo.drive());
        self.ticks += 1;
        output
    }

    fn enable(&mut self, gravity: [f32; 3]) -> bool {
        self.tick(None, gravity);
        for power in [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation] {
            self.tick(Some(ControlRequest::Power(power)), gravity);
        }
        self.leg.control().state() == DriveState::OperationEnabled
    }
}

/// Drives, identifies, validates and tracks one simulated leg.
pub fn simulate<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &SimulationOptions,
) -> Result<SimulatedRun<N>, super::error::ToolError> {
    let started = Instant::now();
    let context = context::<N, B>(leg, options)?;
    let mut pair = pair(leg, &context, options)?;
    if !pair.enable(context.gravity) {
        return Err(SetupError::new(leg, "the drive refused to be enabled at the start").into());
    }
    let mut run = Watch::new(&context);
    let mut request = Some(ControlRequest::Identify);
    let largest = (LONGEST_RUN_S / TICK_S) as u64;
    loop {
        // What the sensors of this tick saw, without noise.
        let (torque, sticking) = (pair.world.motor_torque(), pair.world.sticking());
        let output = pair.tick(request.take(), context.gravity);
        run.see(&pair, &torque, &sticking, output.logged.as_ref());
        match pair.leg.control().activity() {
            Activity::Identify(_) => {}
            _ if pair.leg.control().verdict().is_some() => break,
            _ => {
                let state = pair.leg.control().state();
                return Err(SetupError::new(
                    leg,
                    format!("the drive stopped during identification: {state:?}"),
                )
                .into());
            }
        }
        if pair.ticks > largest {
            return Err(SetupError::new(leg, "identification did not end").into());
        }
    }
    let tracking = track(&context, &pair);
    run.report(&pair, options, tracking, started)
}

fn context<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &SimulationOptions,
) -> Result<Context<N, B>, super::error::ToolError> {
    let background = background::<N, B>(leg, options.prior, options.seed)?;
    let (configuration, motions) = configuration(leg, &background, options.plan, options.swarm_seed)?;
    let unfit = |_| SetupError::new(leg, "the filter does not fit the device");
    let (bandwidth, rate) = (configuration.bandwidth_hz, SAMPLE_RATE_HZ as f32);
    let smoothing = Kernel::new(SMOOTHING_BANDWIDTHS as f32 * bandwidth, rate).map_err(unfit)?;
    let low_pass = LowPass::new(bandwidth, rate).map_err(unfit)?;
    let world = World::<N>::new(&leg.description()?, options.seed);
    let percent = options.torque_noise_percent.unwrap_or(leg.torque_noise_percent);
    let mean = mean_absolute_torque(leg, &world, &motions.excitation);
    let noise = core::array::from_fn(|joint| {
        let own = leg.joints[joint].current_noise_a * leg.joints[joint].torque_per_ampere;
        (percent / 100.0 * mean[joint]).hypot(own)
    });
    let gravity = leg.gravity.map(|element| element as f32);
    Ok(Context { background, configuration, motions, smoothing, low_pass, gravity, noise })
}

/// Of the motor torque along a motion, anatomical.
fn mean_absolute_torque<const N: usize>(leg: &LegFile, world: &World<N>, motion: &Periodic<N>) -> [f64; N] {
    let mut sum = [0.0; N];
    let ticks = (motion.blend_ticks()..motion.duration_ticks() - motion.blend_ticks()).step_by(8);
    let count = ticks.len().max(1) as f64;
    for tick in ticks {
        let state = motion.state_at(tick);
        let sign = |joint: usize| if leg.joints[joint].direction < 0 { -1.0 } else { 1.0 };
        let offset = |joint: usize| leg.joints[joint].zero_offset_deg.to_radians();
        let torque = world.inverse_dynamics(
            &core::array::from_fn(|joint| {
                sign(joint) * (f64::from(state.position_rad[joint]) - offset(joint))
            }),
            &core::array::from_fn(|joint| sign(joint) * f64::from(state.velocity_rad_per_s[joint])),
            &core::array::from_fn(|joint| sign(joint) * f64::from(state.acceleration_rad_per_s2[joint])),
        );
        sum = core::array::from_fn(|joint| sum[joint] + torque[joint].abs() / count);
    }
    sum
}

fn pair<const N: usize, const B: usize>(
    leg: &LegFile,
    context: &Context<N, B>,
    options: &SimulationOptions,
) -> Result<Pair<N, B>, super::error::ToolError> {
    let mut world = World::new(&leg.description()?, options.seed);
    world.set_current_noise(&core::array::from_fn(|joint| {
        context.noise[joint] / leg.joints[joint].torque_per_ampere
    }));
    // A tenth into the range: inside it, and near to hanging for a leg that hangs at its lower end.
    world.place(&core::array::from_fn(|joint| {
        let [low, high] = leg.joints[joint].range_deg;
        (low + 0.1 * (high - low)).to_radians()
    }));
    let device = DeviceLeg::new(&context.configuration)
        .map_err(|error| SetupError::new(leg, format!("the firmware refuses this leg: {error:?}")))?;
    let sample = world.sample();
    Ok(Pair { leg: Box::new(device), world, sample, ticks: 0 })
}

/// Everything that is looked at during a run and that the firmware does not know.
struct Watch<'a, const N: usize, const B: usize> {
    context: &'a Context<N, B>,
    chain: TruthChain<N, B>,
    torque_sum: [f64; N],
    sticking_sum: [f64; N],
    segment: Option<Segment>,
    training_rows: Vec<FilteredRows<f32, N, B>>,
    validation_rows: [Vec<FilteredRows<f32, N, B>>; VALIDATION_NAMES.len()],
    log: Vec<LoggedSample<N>>,
    information: Factor<f64, B>,
    costs: Option<Costs<B>>,
    iterations_seen: u32,
    to_half: Option<u32>,
}

impl<'a, const N: usize, const B: usize> Watch<'a, N, B> {
    fn new(context: &'a Context<N, B>) -> Self {
        Self {
            context,
            chain: TruthChain::new(),
            torque_sum: [0.0; N],
            sticking_sum: [0.0; N],
            segment: None,
            training_rows: Vec::new(),
            validation_rows: Default::default(),
            log: Vec::new(),
            information: Factor::new(),
            costs: None,
            iterations_seen: 0,
            to_half: None,
        }
    }

    fn see(
        &mut self,
        pair: &Pair<N, B>,
        torque: &[f64; N],
        sticking: &[bool; N],
        logged: Option<&LoggedSample<N>>,
    ) {
        for joint in 0..N {
            self.torque_sum[joint] += torque[joint] / 8.0;
            self.sticking_sum[joint] += f64::from(u8::from(sticking[joint])) / 8.0;
        }
        self.watch_search(pair);
        let Some(logged) = logged else { return };
        if logged.segment != self.segment {
            let rows = self.chain.start();
            self.keep(rows);
            self.segment = logged.segment;
        }
        if logged.segment.is_some() {
            let direction =
                |joint: usize| f64::from(self.context.configuration.joints[joint].scale.anatomy.direction());
            let torque = core::array::from_fn(|joint| (direction(joint) * self.torque_sum[joint]) as f32);
            let sticking = self.sticking_sum.map(|share| share as f32);
            self.chain.push(self.context, &logged.sample.position_rad, &torque, &sticking);
        }
        if logged.segment == Some(Segment::Training) {
            self.log.push(*logged);
            self.inform(pair);
        }
        (self.torque_sum, self.sticking_sum) = ([0.0; N], [0.0; N]);
    }

    /// Adds what the noise-free motion of this sample tells of the base parameters.
    fn inform(&mut self, pair: &Pair<N, B>) {
        let truth = pair.world.truth();
        let scales = self.context.configuration.joints.map(|joint| joint.scale);
        let sign = |joint: usize| f64::from(scales[joint].anatomy.direction());
        let rows = self.context.background.model.rows(&Smoothed {
            position: core::array::from_fn(|joint| {
                sign(joint) * truth.position[joint] + f64::from(scales[joint].anatomy.zero_offset())
            }),
            velocity: core::array::from_fn(|joint| sign(joint) * truth.velocity[joint]),
            acceleration: core::array::from_fn(|joint| sign(joint) * truth.acceleration[joint]),
            torque: [0.0; N],
        });
        for joint in 0..N {
            if !truth.sticking[joint] {
                let weight = 1.0 / self.context.noise[joint].max(1e-12);
                self.information.insert(&rows.regressor[joint].map(|element| element * weight), 0.0);
            }
        }
    }

    fn keep(&mut self, rows: Vec<FilteredRows<f32, N, B>>) {
        match self.segment {
            Some(Segment::Training) => self.training_rows = rows,
            Some(Segment::Validation(motion)) => {
                if let Some(slot) = self.validation_rows.get_mut(usize::from(motion)) {
                    *slot = rows;
                }
            }
            None => {}
        }
    }

    fn watch_search(&mut self, pair: &Pair<N, B>) {
        let Some(solver) = pair.leg.identification().solver() else { return };
        let iterations = solver.search().iterations();
        if iterations == self.iterations_seen && self.costs.is_some() {
            return;
        }
        self.iterations_seen = iterations;
        let costs = self.costs.get_or_insert_with(|| self.context.background.costs(solver));
        if self.to_half.is_none() {
            let excess = costs.factor.excess(&solver.search().values().map(f64::from)) - costs.above;
            self.to_half = (excess <= 0.5).then_some(iterations);
        }
    }

    fn report(
        mut self,
        pair: &Pair<N, B>,
        options: &SimulationOptions,
        tracking: Vec<TrackingReport>,
        started: Instant,
    ) -> Result<SimulatedRun<N>, super::error::ToolError> {
        let rows = self.chain.start();
        self.keep(rows);
        let identification = pair.leg.identification();
        let (Some(solver), Some(verdict)) = (identification.solver(), pair.leg.control().verdict()) else {
            return Err(super::error::ToolError::input("the identification ended without a result"));
        };
        let values = solver.estimate().values;
        let training = RecordedMotion {
            name: "fourier".into(),
            record: solver.record().clone(),
            truth: Some(truth_fit(&self.training_rows, &values)),
        };
        let validation: Vec<_> = VALIDATION_NAMES
            .iter()
            .zip(identification.validation())
            .zip(&self.validation_rows)
            .filter_map(|((name, record), rows)| {
                let record = record.clone()?;
                Some(RecordedMotion { name: (*name).into(), record, truth: Some(truth_fit(rows, &values)) })
            })
            .collect();
        let rank = self.context.background.model.base.rank();
        let inverse = self.information.inverse(rank);
        let cramer_rao = core::array::from_fn(|base| {
            inverse[base].iter().map(|element| element * element).sum::<f64>().sqrt()
        });
        let circumstances = Circumstances {
            seed: Some(options.seed),
            cramer_rao: Some(cramer_rao),
            iterations_to_half_chi2: self.to_half,
            tracking,
            simulated_s: pair.ticks as f64 * TICK_S,
            wall: started.elapsed(),
        };
        let report =
            self.context.background.report(solver, verdict, &[training], &validation, &circumstances);
        Ok(SimulatedRun { report, log: self.log })
    }
}

/// Position error on the 3 s gait, feedback alone and with the model, from the same instant.
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
                    squared[joint] += (f64::from(output.motion.position_rad[joint]) - angle).powi(2);
                }
                count += 1;
            }
            Activity::Track(Step::Approach) => {}
            _ => break,
        }
    }
    (count > 0).then(|| squared.map(|sum| (sum / f64::from(count)).sqrt().to_degrees()))
}
