//! Simulated leg that identifies itself, as a source of a live picture.
//!
//! The run is that of `identify` with the same options; an observer reports it and waits for the clock.

use core::mem::replace;

use hal_sim::world::TICK_S;
use scarab::ident::Estimate;
use scarab::leg::{Activity, ControlOutput, DriveState, IdentifyPhase, LimitCode, LimitCodes, Step};
use scarab::trace::words;
use scarab_base::error::ToolError;
use scarab_base::names::VALIDATION_NAMES;
use scarab_base::number::Number;
use scarab_client::activity_words::{doing, not_enabled, waits_for};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::geometry::anatomy;
use scarab_identify::report::RunReport;
use scarab_identify::report::findings::FindingReport;
use scarab_rig::options::SimulationOptions;
use scarab_rig::pair::{Context, Pair};
use scarab_rig::simulate::{Observer, simulate_observed};

use crate::live::clock::{Clock, PERIOD_TICKS};
use crate::live::picture::{Picture, scene};
use crate::live::progress::Progress;
use crate::live::report::{EstimateOrigin, LiveOutcome, LiveStatus, LiveUpdate, Severity};

/// Ticks between two statuses: 0.2 s.
const STATUS_TICKS: u64 = 10 * PERIOD_TICKS;

/// Options of a live run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LiveOptions {
    /// Simulated seconds per second.
    pub(crate) speed: f64,
    /// Identifications, one after the other, with growing seeds.
    pub(crate) runs: u32,
}

/// Identifies a simulated leg and reports it to `out`; returns the report of the last run.
///
/// # Errors
/// Those of `identify`.
pub(crate) fn identify<const N: usize, const B: usize>(
    leg: &LegFile,
    options: &SimulationOptions,
    live: &LiveOptions,
    out: &dyn Fn(LiveUpdate),
) -> Result<RunReport, ToolError> {
    let source = format!("simulated leg, {} drives, seed {}", options.drive.name(), options.seed);
    out(LiveUpdate::Scene(scene(leg, source, live.speed)));
    let mut watched = Watched::<N, B>::new(Picture::new(leg, anatomy::<N>(leg)?, out), live.speed);
    loop {
        watched.run += 1;
        let later = u64::from(watched.run - 1);
        let options = SimulationOptions {
            seed: options.seed.wrapping_add(later),
            swarm_seed: options.swarm_seed.wrapping_add(later),
            ..options.clone()
        };
        let run = simulate_observed::<N, B>(leg, &options, &mut watched)?;
        watched.picture.conclude(&run.report);
        if watched.run == live.runs {
            watched.picture.note(Severity::Note, "the source has ended");
            return Ok(run.report);
        }
    }
}

/// Context of a run and the progress of its identification.
struct Known<const N: usize, const B: usize> {
    context: Context<N, B>,
    progress: Option<Progress<N, B>>,
}

/// Observer of the runs.
struct Watched<'a, const N: usize, const B: usize> {
    picture: Picture<'a, N>,
    clock: Clock,
    run: u32,
    /// Ticks of the earlier runs, and of this one.
    before: u64,
    ticks: u64,
    known: Option<Known<N, B>>,
    /// Drive state and activity of the last tick, and the tick of their last change.
    phase: Option<(DriveState, Activity)>,
    since: u64,
    limits: [LimitCodes; N],
    last_logged: Option<u32>,
    iterations: u32,
    validated: usize,
}

/// Whether both are the same state; the remaining ticks of a state do not count.
fn is_same(one: DriveState, other: DriveState) -> bool {
    words::drive(one) == words::drive(other)
}

impl<'a, const N: usize, const B: usize> Watched<'a, N, B> {
    fn new(picture: Picture<'a, N>, speed: f64) -> Self {
        Self {
            picture,
            clock: Clock::new(speed),
            run: 0,
            before: 0,
            ticks: 0,
            known: None,
            phase: None,
            since: 0,
            limits: [LimitCodes::default(); N],
            last_logged: None,
            iterations: 0,
            validated: 0,
        }
    }

    fn time_s(&self) -> f64 {
        (self.before + self.ticks) as f64 * TICK_S
    }

    /// Reports the running search when it has advanced.
    fn search(&mut self, pair: &Pair<N, B>) {
        let solver = pair.leg.identification().solver().filter(|solver| solver.is_selected());
        let (Some(solver), Some(known)) = (solver, &self.known) else { return };
        let iterations = solver.search().iterations();
        if iterations == self.iterations {
            return;
        }
        self.iterations = iterations;
        let estimate = Estimate { values: solver.search().values(), ..solver.least_squares().clone() };
        let dropped = &solver.record().selection.dropped;
        let base = known.context.background.base_parameters(dropped, &estimate, None);
        self.picture.estimate(EstimateOrigin::Search, iterations, &base);
    }

    /// Predicts with the result of the search, and reports it.
    fn use_result(&mut self, pair: &Pair<N, B>) {
        let identification = pair.leg.identification();
        let (Some(solver), Some(known)) = (identification.solver(), &mut self.known) else { return };
        if let Some(progress) = &mut known.progress {
            progress.use_result(identification.model(), &solver.values());
        }
        let dropped = &solver.record().selection.dropped;
        let base = known.context.background.base_parameters(dropped, &solver.estimate(), None);
        self.picture.estimate(EstimateOrigin::Candidate, solver.search().iterations(), &base);
    }

    /// Reports the tests of the verdict after each unused motion.
    fn judge(&mut self, pair: &Pair<N, B>) {
        let identification = pair.leg.identification();
        let validated = identification.validation().iter().flatten().count();
        if validated == self.validated || identification.solver().is_none() {
            return;
        }
        self.validated = validated;
        let mut findings = Vec::new();
        identification
            .judge_with(&mut |evidence| findings.push(FindingReport::new(evidence, &VALIDATION_NAMES)));
        let outcome = LiveOutcome { validated: true, findings, ..LiveOutcome::default() };
        self.picture.send(LiveUpdate::Outcome(outcome));
    }

    fn change(&mut self, pair: &Pair<N, B>, state: DriveState, activity: Activity) {
        let was_enabled = self.phase.is_some_and(|(before, _)| before.is_enabled());
        self.since = self.ticks;
        if let Activity::Identify(IdentifyPhase::Validate { .. }) = activity {
            self.use_result(pair);
        }
        if was_enabled && !state.is_enabled() {
            self.picture.note(Severity::Fault, pair.stop_words(self.picture.leg()));
        } else {
            self.picture.note(Severity::Note, format!("the leg {}", doing(activity, state)));
        }
    }

    /// Rest of the running motion, s.
    fn left_s(&self, activity: Activity) -> Number {
        let motions = self.known.as_ref().map(|known| &known.context.motions);
        let motion = motions.and_then(|motions| match activity {
            Activity::Identify(IdentifyPhase::Excite) => Some(&motions.excitation),
            Activity::Identify(IdentifyPhase::Validate { motion, step: Step::Run }) => {
                motions.validation.get(usize::from(motion))
            }
            _ => None,
        });
        let elapsed = self.ticks - self.since;
        let left = motion.map(|motion| u64::from(motion.duration_ticks()).saturating_sub(elapsed));
        left.map(|ticks| ticks as f64 * TICK_S).into()
    }

    fn status(&mut self, state: DriveState, activity: Activity) {
        let joints = &self.picture.leg().joints;
        let limits = replace(&mut self.limits, [LimitCodes::default(); N]);
        let named = limits.iter().zip(joints).flat_map(|(codes, joint)| {
            let acting = LimitCode::ALL.into_iter().filter(|code| codes.contains(*code));
            acting.map(move |code| format!("{}: {}", joint.name, code.name().replace('_', " ")))
        });
        let fault = state.fault().map(|fault| {
            let joint = joints.get(usize::from(fault.joint)).map_or("?", |joint| joint.name.as_str());
            format!("{joint}: {}", fault.code.words())
        });
        let status = LiveStatus {
            leg: 0,
            time_s: self.time_s(),
            run: self.run,
            drive: words::drive(state).replace('_', " "),
            doing: doing(activity, state),
            waits_for: waits_for(activity, state).into(),
            left_s: self.left_s(activity),
            not_enabled: not_enabled(state),
            fault: Some(fault.unwrap_or_default()),
            limits: Some(named.collect()),
            speed: self.clock.measured,
            processor: String::new(),
            bus: String::new(),
        };
        self.picture.send(LiveUpdate::Status(status));
    }
}

impl<const N: usize, const B: usize> Observer<N, B> for Watched<'_, N, B> {
    fn begin(&mut self, context: &Context<N, B>) {
        let configuration = &context.configuration;
        // The filter fits: the context was built with it.
        let progress =
            Progress::new(&configuration.model, configuration.bandwidth_hz, configuration.estimator).ok();
        self.known = Some(Known { context: context.clone(), progress });
        (self.before, self.ticks) = (self.before + self.ticks, 0);
        (self.phase, self.last_logged) = (None, None);
        (self.iterations, self.validated) = (0, 0);
        self.picture.restart();
        self.picture.time_s = self.time_s();
        self.picture.send(LiveUpdate::Outcome(LiveOutcome::default()));
        self.picture.note(Severity::Note, format!("identification {} begins", self.run));
    }

    fn tick(&mut self, pair: &Pair<N, B>, output: &ControlOutput<N>) {
        self.ticks = pair.ticks;
        self.picture.time_s = self.time_s();
        let control = pair.leg.control();
        for (sum, codes) in self.limits.iter_mut().zip(control.limit_codes(output)) {
            *sum = LimitCode::ALL.into_iter().fold(*sum, |sum, code| sum.with(codes.contains(code), code));
        }
        self.picture.command(&output.motion.position_rad);
        let (state, activity) = (control.state(), control.activity());
        let is_new = self.phase.is_none_or(|(before, was)| !is_same(before, state) || was != activity);
        if is_new {
            self.change(pair, state, activity);
        }
        self.phase = Some((state, activity));
        if is_new {
            self.status(state, activity);
        }
        // A board whose servo did not run repeats its last output.
        if let Some(logged) = output.logged.filter(|logged| Some(logged.sample.tick) != self.last_logged) {
            self.last_logged = Some(logged.sample.tick);
            if let Some(Known { context, progress: Some(progress) }) = &mut self.known {
                let plan = context.configuration.plan;
                self.picture.learn(&logged, progress, &context.background, plan);
            }
        }
        if self.ticks.is_multiple_of(PERIOD_TICKS) {
            if activity == Activity::Identify(IdentifyPhase::Solve) {
                self.search(pair);
            }
            if self.ticks.is_multiple_of(STATUS_TICKS) {
                self.judge(pair);
                self.status(state, activity);
            }
            self.clock.wait(self.before + self.ticks);
        }
    }
}
