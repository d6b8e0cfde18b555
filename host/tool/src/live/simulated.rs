//! Simulated leg that identifies itself, as a source of a live picture.
//!
//! The run is that of `identify` with the same options; an observer reports it and waits for the clock.

use core::mem::take;

use hal_sim::world::TICK_S;
use scarab::leg::{Activity, DriveState, IdentifyPhase, LimitCode, LimitCodes};
use scarab::trace::words;
use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_client::activity_words::{doing, not_enabled, waits_for};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::RunReport;
use scarab_identify::run::progress::Progress;
use scarab_rig::options::SimulationOptions;
use scarab_rig::run_state::RunState;
use scarab_rig::simulate::{Observer, simulate_observed};

use crate::live::clock::{Clock, PERIOD_TICKS};
use crate::live::picture::{Picture, scene};
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
pub(crate) fn identify(
    leg: &LegFile,
    options: &SimulationOptions,
    live: &LiveOptions,
    out: &dyn Fn(LiveUpdate),
) -> Result<RunReport, ToolError> {
    let source = format!("simulated leg, {} drives, seed {}", options.drive.name(), options.seed);
    out(LiveUpdate::Scene(scene(leg, source, live.speed)));
    let mut watched = Watched::new(Picture::new(leg, out)?, live.speed);
    loop {
        watched.run += 1;
        let later = u64::from(watched.run - 1);
        let options = SimulationOptions {
            seed: options.seed.wrapping_add(later),
            swarm_seed: options.swarm_seed.wrapping_add(later),
            ..options.clone()
        };
        let run = simulate_observed(leg, &options, &mut watched)?;
        watched.picture.conclude(&run.report);
        if watched.run == live.runs {
            watched.picture.note(Severity::Note, "the source has ended");
            return Ok(run.report);
        }
    }
}

/// Observer of the runs.
struct Watched<'a> {
    picture: Picture<'a>,
    clock: Clock,
    run: u32,
    /// Ticks of the earlier runs, and of this one.
    before: u64,
    ticks: u64,
    progress: Option<Box<dyn Progress>>,
    /// Drive state and activity of the last tick, and the tick of their last change.
    phase: Option<(DriveState, Activity)>,
    since: u64,
    limits: Vec<LimitCodes>,
    last_logged: Option<u32>,
    iterations: u32,
    validated: usize,
}

/// Whether both are the same state; the remaining ticks of a state do not count.
fn is_same(one: DriveState, other: DriveState) -> bool {
    words::drive(one) == words::drive(other)
}

impl<'a> Watched<'a> {
    fn new(picture: Picture<'a>, speed: f64) -> Self {
        Self {
            picture,
            clock: Clock::new(speed),
            run: 0,
            before: 0,
            ticks: 0,
            progress: None,
            phase: None,
            since: 0,
            limits: Vec::new(),
            last_logged: None,
            iterations: 0,
            validated: 0,
        }
    }

    fn time_s(&self) -> f64 {
        (self.before + self.ticks) as f64 * TICK_S
    }

    /// Reports the running search when it has advanced.
    fn search(&mut self, run: &dyn RunState) {
        let Some(found) = run.search(self.iterations) else { return };
        self.iterations = found.iterations;
        self.picture.estimate(EstimateOrigin::Search, found.iterations, &found.base);
    }

    /// Predicts with the result of the search, and reports it.
    fn use_result(&mut self, run: &dyn RunState) {
        let Some(found) = run.result() else { return };
        if let Some(progress) = &mut self.progress {
            progress.use_result(&found.values, &found.stribeck);
        }
        self.picture.estimate(EstimateOrigin::Candidate, found.iterations, &found.base);
    }

    /// Reports the tests of the verdict after each unused motion.
    fn judge(&mut self, run: &dyn RunState) {
        let Some((validated, findings)) = run.findings(self.validated) else { return };
        self.validated = validated;
        let outcome = LiveOutcome { validated: true, findings, ..LiveOutcome::default() };
        self.picture.send(LiveUpdate::Outcome(outcome));
    }

    fn change(&mut self, run: &dyn RunState, state: DriveState, activity: Activity) {
        let was_enabled = self.phase.is_some_and(|(before, _)| before.is_enabled());
        self.since = self.ticks;
        if let Activity::Identify(IdentifyPhase::Validate { .. }) = activity {
            self.use_result(run);
        }
        if was_enabled && !state.is_enabled() {
            self.picture.note(Severity::Fault, run.stop_words(self.picture.leg()));
        } else {
            self.picture.note(Severity::Note, format!("the leg {}", doing(activity, state)));
        }
    }

    /// Rest of the running motion, s.
    fn left_s(&self, run: &dyn RunState, activity: Activity) -> Number {
        let elapsed = self.ticks - self.since;
        let left = run.motion_ticks(activity).map(|ticks| ticks.saturating_sub(elapsed));
        left.map(|ticks| ticks as f64 * TICK_S).into()
    }

    fn status(&mut self, run: &dyn RunState, state: DriveState, activity: Activity) {
        let joints = &self.picture.leg().joints;
        let limits = take(&mut self.limits);
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
            left_s: self.left_s(run, activity),
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

impl Observer for Watched<'_> {
    fn begin(
        &mut self,
        progress: &dyn Fn() -> Result<Box<dyn Progress>, ToolError>,
    ) -> Result<(), ToolError> {
        self.progress = Some(progress()?);
        (self.before, self.ticks) = (self.before + self.ticks, 0);
        (self.phase, self.last_logged) = (None, None);
        (self.iterations, self.validated) = (0, 0);
        self.picture.restart();
        self.picture.time_s = self.time_s();
        self.picture.send(LiveUpdate::Outcome(LiveOutcome::default()));
        self.picture.note(Severity::Note, format!("identification {} begins", self.run));
        Ok(())
    }

    fn tick(&mut self, run: &dyn RunState) {
        self.ticks = run.ticks();
        self.picture.time_s = self.time_s();
        let limits = run.limit_codes();
        self.limits.resize(limits.len(), LimitCodes::default());
        for (sum, codes) in self.limits.iter_mut().zip(limits) {
            *sum = LimitCode::ALL.into_iter().fold(*sum, |sum, code| sum.with(codes.contains(code), code));
        }
        self.picture.command(run.commanded_rad());
        let (state, activity) = (run.drive(), run.activity());
        let is_new = self.phase.is_none_or(|(before, was)| !is_same(before, state) || was != activity);
        if is_new {
            self.change(run, state, activity);
        }
        self.phase = Some((state, activity));
        if is_new {
            self.status(run, state, activity);
        }
        // A board whose servo did not run repeats its last output.
        if let Some((tick, logged)) = run.logged().filter(|(tick, _)| Some(*tick) != self.last_logged) {
            self.last_logged = Some(tick);
            if let Some(progress) = &mut self.progress {
                self.picture.learn(&logged, &mut **progress);
            }
        }
        if self.ticks.is_multiple_of(PERIOD_TICKS) {
            if activity == Activity::Identify(IdentifyPhase::Solve) {
                self.search(run);
            }
            if self.ticks.is_multiple_of(STATUS_TICKS) {
                self.judge(run);
                self.status(run, state, activity);
            }
            self.clock.wait(self.before + self.ticks);
        }
    }
}
