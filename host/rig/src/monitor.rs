//! `monitor`: a leg is identified and walks while load or friction change; reports the firmware's
//! detection and update.
//!
//! The leg walks the paper's gait with a 3 s cycle, which hardly excites it: the information is
//! that of a wearer's normal day. The simulated operator accepts every offered update.

mod update;

use crate::report::monitor::{AlarmReport, MonitorRun};
use hal_sim::world::TICK_S;
use scarab::leg::{Activity, ControlRequest, ProvedMotion, Step};
use scarab::model::Payload;
use scarab::motion::Periodic;
use scarab::safety::PowerRequest;
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::Second;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::{LegFile, PushesFile};
use scarab_identify::with_leg_size;

use crate::identified::identify;
use crate::options::SimulationOptions;
use crate::pair::{Context, Pair};
use update::update_report;

/// Limit after which a change counts as not detected.
const LONGEST_WAIT_S: f64 = 600.0;
/// Limit for repeated attempts of the quick update.
const LONGEST_UPDATE_S: f64 = 120.0;
/// Walking time with the update in use.
const AFTER_S: f64 = 60.0;
/// Rest after a false alarm: damping until standstill.
const REST_S: f64 = 4.0;
/// Step in which a slow change of friction is simulated.
const FRICTION_STEP_S: f64 = 1.0;

/// Change to a leg while it walks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disturbance {
    /// Point mass fixed to a link, or removed.
    Payload(Payload<f64>),
    /// Change of Coulomb and viscous friction of all joints.
    Friction {
        /// Factor on the original friction.
        factor: f64,
        /// Duration of the change, s.
        over_s: f64,
    },
}

/// Options of the simulation.
#[derive(Clone, Debug)]
pub struct MonitorOptions {
    /// Seed of noise and pushes.
    pub seed: u64,
    /// Changes to simulate.
    pub disturbances: Vec<Disturbance>,
    /// Walking time before the change, s.
    pub at_s: f64,
    /// Walking time without a change, hours.
    pub hours: f64,
    /// Pushes by the wearer while walking.
    pub pushes: Option<PushesFile>,
}

fn ticks(seconds: f64) -> u64 {
    (seconds / TICK_S) as u64
}

/// Gait with a 3 s cycle for a duration.
fn gait<const N: usize, const B: usize>(
    leg: &LegFile,
    context: &Context<N, B>,
    seconds: f64,
) -> Result<ProvedMotion<N>, ToolError> {
    let unfit = || leg.error("no gait of this length fits the limits");
    let curve = *context.motions.validation[1].curve();
    let cycles = (seconds / f64::from(curve.period().0)).ceil() as u32 + 1;
    let motion = Periodic::new(curve, Second(1.0), cycles, SERVO_RATE_HZ).map_err(|_| unfit())?;
    Ok(context.configuration.prove(motion).map_err(|_| unfit())?)
}

/// Identified pair at rest; `Err` holds the reason for rejection.
fn identified<const N: usize, const B: usize>(
    leg: &LegFile,
    context: &Context<N, B>,
    seed: u64,
) -> Result<Result<Pair<N, B>, Vec<&'static str>>, ToolError> {
    let mut pair = Pair::new(leg, context, seed)?;
    Ok(identify(leg, context, &mut pair)?.map(|()| pair))
}

/// Walking pair with its tracking error.
struct Walk<'a, const N: usize, const B: usize> {
    leg: &'a LegFile,
    context: &'a Context<N, B>,
    pair: Pair<N, B>,
    /// Active changes and the tick of their start.
    changing: Option<(&'a [Disturbance], u64)>,
    squared: f64,
    count: u64,
}

impl<'a, const N: usize, const B: usize> Walk<'a, N, B> {
    /// Starts the gait from rest.
    fn begin(
        leg: &'a LegFile,
        context: &'a Context<N, B>,
        pair: Pair<N, B>,
        seconds: f64,
        pushes: Option<PushesFile>,
    ) -> Result<Self, ToolError> {
        let motion = gait(leg, context, seconds)?;
        let mut walk = Self { leg, context, pair, changing: None, squared: 0.0, count: 0 };
        walk.pair.world.set_pushes(pushes.as_ref().map(PushesFile::description));
        if !walk.pair.leg.set_tracked(motion) {
            return Err(ToolError::input("the leg tracks another motion"));
        }
        walk.tick(Some(ControlRequest::Track { with_model: true }))?;
        while walk.activity() != Activity::Track(Step::Run) {
            walk.tick(None)?;
        }
        walk.error_deg();
        Ok(walk)
    }

    fn activity(&self) -> Activity {
        self.pair.leg.control().activity()
    }

    fn tick(&mut self, request: Option<ControlRequest>) -> Result<(), ToolError> {
        if let Some((disturbances, since)) = self.changing {
            let tick = self.pair.ticks - since;
            disturb(&mut self.pair, disturbances, tick);
        }
        let output = self.pair.tick(request, self.context.gravity);
        self.squared +=
            output.servo.tracking_error.iter().map(|error| f64::from(error.0).powi(2)).sum::<f64>();
        self.count += 1;
        if matches!(self.activity(), Activity::Track(_)) {
            return Ok(());
        }
        Err(self.leg.error(self.pair.stop_words(self.leg)).into())
    }

    /// Root mean square position error of all joints since the last call, degrees.
    fn error_deg(&mut self) -> f64 {
        let mean = self.squared / (N as f64 * self.count.max(1) as f64);
        (self.squared, self.count) = (0.0, 0);
        mean.sqrt().to_degrees()
    }

    /// Walks until an alarm, or up to a limit; returns the elapsed seconds.
    fn until_alarm(&mut self, longest_s: f64) -> Result<Option<f64>, ToolError> {
        for tick in 0..ticks(longest_s) {
            self.tick(None)?;
            if self.pair.leg.control().change().is_some() {
                return Ok(Some((tick + 1) as f64 * TICK_S));
            }
        }
        Ok(None)
    }

    fn run(&mut self, seconds: f64) -> Result<(), ToolError> {
        for _ in 0..ticks(seconds) {
            self.tick(None)?;
        }
        Ok(())
    }

    /// Damps the leg to a standstill and enables it again.
    fn rest(mut self) -> Result<Pair<N, B>, ToolError> {
        self.pair.tick(Some(ControlRequest::Power(PowerRequest::QuickStop)), self.context.gravity);
        for _ in 0..ticks(REST_S) {
            self.pair.tick(None, self.context.gravity);
        }
        if self.pair.enable(self.context.gravity) {
            return Ok(self.pair);
        }
        Err(self.leg.error("the drive refused to be enabled after a false alarm").into())
    }
}

/// Runs one seed: identification, false alarms, change.
///
/// # Errors
/// The leg file cannot be used.
pub fn watch(leg: &LegFile, options: &MonitorOptions) -> Result<MonitorRun, ToolError> {
    with_leg_size!(leg, watch_sized(leg, options))
}

fn watch_sized<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &MonitorOptions,
) -> Result<MonitorRun, ToolError> {
    let simulation = SimulationOptions::with_seed(options.seed);
    let context = Context::<N, B>::new(leg, &simulation)?;
    let pair = match identified(leg, &context, options.seed)? {
        Ok(pair) => pair,
        Err(reasons) => return Ok(MonitorRun::refused(options.seed, reasons)),
    };
    let model_monitor = pair.leg.identification().model_monitor();
    let baseline = model_monitor
        .baseline()
        .ok_or_else(|| leg.error("the firmware does not monitor the accepted model"))?;
    let mut run = MonitorRun {
        row_sigma_nm: baseline
            .row_variance
            .iter()
            .map(|variance| f64::from(variance.sqrt()).into())
            .collect(),
        limit: f64::from(model_monitor.monitor().limit()).into(),
        hours: options.hours,
        seed: options.seed,
        ..MonitorRun::default()
    };
    if options.hours > 0.0 {
        run.false_alarms_at_s = false_alarms(leg, &context, pair.clone(), options)?;
    }
    if !options.disturbances.is_empty() {
        change(leg, &context, pair, options, &mut run)?;
    }
    Ok(run)
}

fn false_alarms<const N: usize, const B: usize>(
    leg: &LegFile,
    context: &Context<N, B>,
    mut pair: Pair<N, B>,
    options: &MonitorOptions,
) -> Result<Vec<f64>, ToolError> {
    let (mut alarms, mut walked) = (Vec::new(), 0.0);
    let whole = options.hours * 3600.0;
    while walked < whole {
        let mut walk = Walk::begin(leg, context, pair, whole - walked, options.pushes)?;
        match walk.until_alarm(whole - walked)? {
            Some(after) => {
                walked += after;
                alarms.push(walked);
            }
            None => break,
        }
        pair = walk.rest()?;
    }
    Ok(alarms)
}

fn change<const N: usize, const B: usize>(
    leg: &LegFile,
    context: &Context<N, B>,
    pair: Pair<N, B>,
    options: &MonitorOptions,
    run: &mut MonitorRun,
) -> Result<(), ToolError> {
    run.changed = true;
    let longest = options.at_s + 2.0 * LONGEST_WAIT_S + AFTER_S;
    let mut walk = Walk::begin(leg, context, pair, longest, options.pushes)?;
    if let Some(early) = walk.until_alarm(options.at_s)? {
        run.false_alarms_at_s.push(early);
        return Ok(());
    }
    run.error_deg_before = walk.error_deg().into();
    walk.changing = Some((&options.disturbances, walk.pair.ticks));
    let noticed = walk.until_alarm(LONGEST_WAIT_S)?;
    let (Some(after_s), Some(alarm)) = (noticed, walk.pair.leg.control().change().copied()) else {
        return Ok(());
    };
    run.alarm = Some(AlarmReport {
        after_s,
        since_s: alarm.since_s.into(),
        joints: (0..N)
            .filter(|joint| alarm.joints[*joint])
            .map(|joint| leg.joints[joint].name.clone())
            .collect(),
        statistic: alarm.statistic.iter().map(|sum| f64::from(*sum).into()).collect(),
    });
    let mut waited = 0;
    while !walk.pair.leg.control().is_update_offered() && waited < ticks(LONGEST_UPDATE_S) {
        walk.tick(None)?;
        waited += 1;
    }
    run.error_deg_changed = walk.error_deg().into();
    let Some(update) = walk.pair.leg.identification().model_monitor().update() else { return Ok(()) };
    run.still_changing = options
        .disturbances
        .iter()
        .any(|disturbance| matches!(disturbance, Disturbance::Friction { over_s, .. } if *over_s > after_s));
    // Without a final truth there is no reference.
    let known: &[_] = if run.still_changing { &[] } else { &options.disturbances };
    let thresholds = &context.configuration.thresholds;
    let waited_s = waited as f64 * TICK_S;
    run.update = Some(update_report(leg, update, thresholds, &options.disturbances, known, waited_s));
    if !update.is_change() {
        return Ok(());
    }
    walk.tick(Some(ControlRequest::TakeUpdate))?;
    walk.run(2.0)?;
    walk.error_deg();
    run.alarm_after_update = walk.until_alarm(AFTER_S)?.is_some();
    run.error_deg_updated = walk.error_deg().into();
    Ok(())
}

/// Applies the changes at this tick after their start.
fn disturb<const N: usize, const B: usize>(pair: &mut Pair<N, B>, disturbances: &[Disturbance], tick: u64) {
    for disturbance in disturbances {
        match *disturbance {
            Disturbance::Payload(payload) if tick == 0 => {
                pair.world.attach(payload.joint, payload.mass, payload.position.into());
            }
            Disturbance::Payload(_) => {}
            Disturbance::Friction { factor, over_s } => {
                let steps = (over_s / FRICTION_STEP_S).floor().max(1.0);
                let reached = |step: f64| 1.0 + (factor - 1.0) * step / steps;
                let step = tick / ticks(FRICTION_STEP_S);
                if tick.is_multiple_of(ticks(FRICTION_STEP_S)) && (step as f64) < steps {
                    pair.world.scale_friction(reached(step as f64 + 1.0) / reached(step as f64));
                }
            }
        }
    }
}
