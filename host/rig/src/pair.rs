//! Leg and plant ticked together, and the data both are built from.
//!
//! A pair can be cloned at any tick and continued. The copies stay equal bit for bit until they receive
//! different requests.

use hal_sim::faults::Injector;
use hal_sim::world::periods::PERIODS_PER_TICK;
use hal_sim::world::{TICK_S, World};
use scarab::hal::{LegDrives, Sample};
use scarab::ident::{Kernel, LowPass, Record, SAMPLE_RATE_HZ, SMOOTHING_BANDWIDTHS};
use scarab::leg::{Activity, ControlOutput, ControlRequest, IdentifyPhase, Leg, LegConfiguration};
use scarab::model::AnatomicalJoint;
use scarab::motion::{MotionState, Periodic};
use scarab::safety::{DriveState, PowerRequest};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::geometry::anatomy;
use scarab_identify::leg::background::Background;
use scarab_identify::leg::board_words::axis_fault;
use scarab_identify::leg::motions::Motions;
use scarab_identify::leg::setup::{background, configuration};
use scarab_identify::leg::words::{drive_stop, leg_error};

use crate::board::levels::{Conditions, Levels};
use crate::options::{DriveModel, SimulationOptions};
use crate::perturb::{self, Perturbation};

/// Taps of the device's filter.
pub const TAPS: usize = 256;
/// Open outputs of that filter.
pub const PENDING: usize = 26;
/// Firmware leg with the device's filter lengths.
pub(crate) type DeviceLeg<const N: usize, const B: usize> = Leg<N, B, TAPS, PENDING>;

/// Evaluations of the search per servo tick: 8,000 per second. One costs about 7,900 instructions
/// of the device at 13 base parameters, so a running search takes half of the processor.
pub const EVALUATIONS_PER_TICK: u32 = 2;

/// Data from which a run is built.
#[derive(Clone, Debug)]
pub struct Context<const N: usize, const B: usize> {
    /// Data about the leg besides its recordings.
    pub background: Background<N, B>,
    /// Configuration of the firmware.
    pub configuration: LegConfiguration<N, B>,
    /// The motions of the run.
    pub motions: Motions<N>,
    /// First stage of the identification's filter chain.
    pub(crate) smoothing: Kernel<f32, TAPS>,
    /// Second stage.
    pub(crate) low_pass: LowPass<f32, TAPS>,
    /// Gravity in the base frame, m/s^2.
    pub gravity: [f32; 3],
    /// Standard deviation of each joint's logged torque, N m.
    pub(crate) noise: [f64; N],
    /// Leg for which the current loops are configured; complete drives only.
    pub(crate) complete: Option<Box<LegFile>>,
    /// Deliberate errors.
    pub(crate) perturbations: Vec<Perturbation>,
}

impl<const N: usize, const B: usize> Context<N, B> {
    /// Prepares a run with complete drives.
    pub(crate) fn with_complete_drives(leg: &LegFile, seed: u64) -> Result<Self, ToolError> {
        Self::new(leg, &SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::with_seed(seed) })
    }

    /// Prepares a run of this leg as the firmware assumes it.
    pub fn new(leg: &LegFile, options: &SimulationOptions) -> Result<Self, ToolError> {
        perturb::check_drives(options)?;
        let mut background = background::<N, B>(leg, options.prior, options.seed)?;
        background.use_estimator(options.estimator);
        let (mut configuration, mut motions) =
            configuration(leg, &background, options.plan, options.swarm_seed)?;
        configuration.estimator = options.estimator;
        let world = World::<N>::new(&leg.description()?, options.seed);
        let percent = options.torque_noise_percent.unwrap_or(leg.torque_noise_percent);
        // The percentage always refers to the default motion, because a sensor's noise does not depend on its
        // later use.
        let mean = mean_absolute_torque(&anatomy(leg)?, &world, &motions.excitation);
        if let Some(excitation) = &options.excitation {
            motions.excitation = excitation.motion()?;
            configuration.excitation = motions.excitation;
        }
        let unfit = |_| leg.error("the filter does not fit the device");
        let (bandwidth, rate) = (configuration.bandwidth_hz, SAMPLE_RATE_HZ as f32);
        let smoothing = Kernel::new(SMOOTHING_BANDWIDTHS as f32 * bandwidth, rate).map_err(unfit)?;
        let low_pass = LowPass::new(bandwidth, rate).map_err(unfit)?;
        let noise = core::array::from_fn(|joint| {
            let own = leg.joints[joint].current_noise_a * leg.joints[joint].torque_per_ampere;
            (percent / 100.0 * mean[joint]).hypot(own)
        });
        let gravity = leg.gravity.map(|element| element as f32);
        let complete = (options.drive == DriveModel::Full).then(|| Box::new(leg.clone()));
        let perturbations = options.perturbations.clone();
        Ok(Self {
            background,
            configuration,
            motions,
            smoothing,
            low_pass,
            gravity,
            noise,
            complete,
            perturbations,
        })
    }

    /// Anatomical to D-H angles of every joint, as the firmware holds them.
    pub(crate) fn anatomy(&self) -> [AnatomicalJoint<f64>; N] {
        self.configuration.joints.map(|joint| joint.scale.anatomy.convert())
    }

    /// Noise of each joint's current, A.
    pub fn current_noise(&self, leg: &LegFile) -> [f64; N] {
        core::array::from_fn(|joint| self.noise[joint] / leg.joints[joint].torque_per_ampere)
    }
}

/// Initial angles of the resting leg, rad: a tenth into the range. A leg whose lower end is the
/// hanging position thus starts near it.
pub fn start_position<const N: usize>(leg: &LegFile) -> [f64; N] {
    core::array::from_fn(|joint| {
        let [low, high] = leg.joints[joint].range_deg;
        (low + 0.1 * (high - low)).to_radians()
    })
}

/// Motor torque of the plant in a state of the model, anatomical.
pub(crate) fn torque_at<const N: usize>(
    anatomy: &[AnatomicalJoint<f64>; N],
    world: &World<N>,
    state: &MotionState<N>,
) -> [f64; N] {
    let angle = |joint: usize| anatomy[joint].angle_from_chain(f64::from(state.position_rad[joint]));
    let from_chain =
        |of: &[f32; N]| core::array::from_fn(|joint| anatomy[joint].from_chain(f64::from(of[joint])));
    world.inverse_dynamics(
        &core::array::from_fn(angle),
        &from_chain(&state.velocity_rad_per_s),
        &from_chain(&state.acceleration_rad_per_s2),
    )
}

/// Mean absolute motor torque along a motion, anatomical.
fn mean_absolute_torque<const N: usize>(
    anatomy: &[AnatomicalJoint<f64>; N],
    world: &World<N>,
    motion: &Periodic<N>,
) -> [f64; N] {
    let mut sum = [0.0; N];
    let ticks = (motion.blend_ticks()..motion.duration_ticks() - motion.blend_ticks()).step_by(8);
    let count = ticks.len().max(1) as f64;
    for tick in ticks {
        let torque = torque_at(anatomy, world, &motion.state_at(tick));
        sum = core::array::from_fn(|joint| sum[joint] + torque[joint].abs() / count);
    }
    sum
}

/// Leg and plant, ticked together.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair<const N: usize, const B: usize> {
    /// The firmware.
    pub leg: Box<DeviceLeg<N, B>>,
    /// The plant.
    pub world: World<N>,
    /// All levels of the board, if the plant's drives are complete.
    pub board: Option<Box<Levels<N>>>,
    /// Last sensor readings.
    pub sample: Sample<N>,
    /// Elapsed servo ticks.
    pub ticks: u64,
    /// Evaluations of the search per tick.
    pub evaluations: u32,
    /// Last output of complete drives.
    output: Option<ControlOutput<N>>,
    /// Joint of the plant at each joint's connectors.
    wiring: [usize; N],
}

impl<const N: usize, const B: usize> Pair<N, B> {
    /// Leg at rest a tenth into its range, drive off.
    pub fn new(leg: &LegFile, context: &Context<N, B>, seed: u64) -> Result<Self, ToolError> {
        let (description, believed) = (leg.description()?, context.complete.as_deref());
        let mut drives = believed.map(|_| leg.complete_description::<N>()).transpose()?;
        if let Some(drives) = &mut drives {
            perturb::drives(drives, &context.perturbations);
        }
        let mut world = match &drives {
            Some(drives) => World::with_complete_drives(&description, drives, seed),
            None => World::new(&description, seed),
        };
        world.set_current_noise(&context.current_noise(leg));
        world.move_to(&start_position(leg));
        let device =
            DeviceLeg::new(&context.configuration).map_err(|error| leg.error(leg_error(leg, error)))?;
        let device = Box::new(device);
        let sample = world.sample();
        let board = match believed.zip(drives.as_ref()) {
            Some((believed, drives)) => {
                let mut board = Levels::ready(believed, drives, &device, &mut world, seed)?;
                board.queues().set_samples(&sample.joints);
                // Requests come from the run. A switch that never opens requests nothing; an open one would
                // stop the leg.
                board.registers.contacts.enabling = true;
                Some(Box::new(board))
            }
            None => None,
        };
        Ok(Self {
            leg: device,
            world,
            board,
            sample,
            ticks: 0,
            evaluations: EVALUATIONS_PER_TICK,
            output: None,
            wiring: core::array::from_fn(|joint| joint),
        })
    }

    /// Exchanges the connectors of two joints, motor and encoder together, before the drive is enabled.
    pub(crate) fn exchange(&mut self, one: usize, other: usize) {
        self.wiring.swap(one, other);
        self.sample.joints.swap(one, other);
        if let Some(board) = &mut self.board {
            board.exchange(one, other);
            board.queues().set_samples(&self.sample.joints);
        }
    }

    /// Runs one servo tick of leg and plant.
    pub fn tick(&mut self, request: Option<ControlRequest>, gravity: [f32; 3]) -> ControlOutput<N> {
        let output = if self.board.is_some() {
            self.tick_board(request, gravity)
        } else {
            let output = self.leg.tick(&self.sample, request, gravity, self.evaluations);
            let mut command = *output.servo.drive();
            for (joint, &wired) in self.wiring.iter().enumerate() {
                command.currents[wired] = output.servo.drive().currents[joint];
            }
            let sample = self.world.tick(&command);
            self.sample.joints = self.wiring.map(|wired| sample.joints[wired]);
            output
        };
        self.ticks += 1;
        output
    }

    /// Runs one servo tick of all levels of the board, and six periods of the plant.
    fn tick_board(&mut self, request: Option<ControlRequest>, gravity: [f32; 3]) -> ControlOutput<N> {
        let Some(board) = &mut self.board else { unreachable!("called with a board") };
        if let Some(request) = request {
            board.ask(request);
        }
        let first = self.ticks * u64::from(PERIODS_PER_TICK);
        for period in first..first + u64::from(PERIODS_PER_TICK) {
            if Levels::<N>::is_round_due(period) {
                board.registers.sense(&self.world, &mut Injector::new(0), period);
                board.housekeeping();
            }
            if core::mem::take(&mut board.registers.servo_due) {
                self.output = board.servo(self.leg.halves().0, gravity).or(self.output);
                board.assist();
                board.identify(&mut self.leg, self.evaluations);
            }
            let mut commands = board.registers.commands;
            for (joint, &wired) in self.wiring.iter().enumerate() {
                commands[wired] = board.registers.commands[joint];
            }
            let samples = self.world.period(&commands, f64::from(board.registers.brake));
            for (joint, &wired) in self.wiring.iter().enumerate() {
                board.current(joint, period, &samples[wired], Conditions::SOUND);
            }
            board.watch(period);
        }
        if let Some(joints) = board.samples() {
            self.sample = self.world.observe(&Sample { joints });
            board.queues().set_samples(&self.sample.joints);
        }
        self.output.expect("a ready board ticks its leg at once")
    }

    /// Runs the exciting motion up to its record; `None` if the drive does not complete it.
    pub fn recorded(&mut self, gravity: [f32; 3], longest_s: f64) -> Option<Record<f32, N, B>> {
        let mut request = Some(ControlRequest::Identify);
        for _ in 0..(longest_s / TICK_S) as u32 {
            let output = self.tick(request.take(), gravity);
            match (self.leg.control().activity(), self.leg.identification().solver()) {
                (Activity::Identify(IdentifyPhase::Solve), Some(solver)) => {
                    return Some(solver.record().clone());
                }
                (Activity::Identify(_), _) if !output.refused => {}
                _ => break,
            }
        }
        None
    }

    /// Reason why the drive is no longer enabled.
    pub fn stop_words(&self, leg: &LegFile) -> String {
        let Some((joint, fault)) = self.board.as_ref().and_then(|board| board.fault()) else {
            return drive_stop(leg, self.leg.control().state());
        };
        let name = leg.joints.get(joint).map_or("?", |joint| joint.name.as_str());
        format!("axis `{name}` turned its bridge off, and all others too: {}", axis_fault(fault))
    }

    /// Enables the drive and returns whether it is enabled.
    pub fn enable(&mut self, gravity: [f32; 3]) -> bool {
        self.tick(None, gravity);
        for power in [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation] {
            self.tick(Some(ControlRequest::Power(power)), gravity);
        }
        self.leg.control().state() == DriveState::OperationEnabled
    }
}
