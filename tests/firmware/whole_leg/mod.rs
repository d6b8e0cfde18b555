//! The whole firmware of a leg against the simulated leg, from the first tick to the verdict.
//!
//! Leg and plant are one value that can be cloned at any tick. So tests that begin in the middle of an
//! identification share the preceding part.

mod aftermath;
mod conditions;
mod failures;
mod host;
mod identification;
mod memory;
mod monitor;
mod perturbations;
mod scale;
mod servo;
mod stored;
mod trace;

use std::sync::OnceLock;

use scarab::hal::SERVO_RATE_HZ;
use scarab::ident::{Estimate, Verdict};
use scarab::leg::{Activity, ControlRequest, IdentifyPhase, Step};
use scarab::model::planar::{BASE, JOINTS};
use scarab::safety::DriveState;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};
use scarab_identify::report::RunReport;
use scarab_rig::options::SimulationOptions;
use scarab_rig::pair;
use scarab_rig::simulate::simulate;

type Pair = pair::Pair<JOINTS, BASE>;
type Context = pair::Context<JOINTS, BASE>;

/// Ticks of one second.
const SECOND: u64 = SERVO_RATE_HZ as u64;
/// Limit for an identification, which takes 53 s.
const LONGEST_IDENTIFICATION: u64 = 100 * SECOND;

fn default_leg() -> LegFile {
    LegFile::load(DEFAULT_LEG).expect("shipped")
}

fn context() -> &'static Context {
    static CONTEXT: OnceLock<Context> = OnceLock::new();
    CONTEXT.get_or_init(|| {
        Context::new(&default_leg(), &SimulationOptions::with_seed(1))
            .expect("the default leg can be simulated")
    })
}

/// A pair that is enabled and at rest, in a world with this seed.
fn enabled(leg: &LegFile, seed: u64) -> Pair {
    let mut pair = Pair::new(leg, context(), seed).expect("the firmware accepts the default leg");
    assert!(pair.enable(context().gravity));
    pair
}

/// Report of the firmware's identification of a leg.
fn simulated(leg: &LegFile, options: &SimulationOptions) -> RunReport {
    simulate(leg, options).expect("it runs").report
}

fn tick(pair: &mut Pair, request: Option<ControlRequest>) -> scarab::leg::ControlOutput<JOINTS> {
    pair.tick(request, context().gravity)
}

fn activity(pair: &Pair) -> Activity {
    pair.leg.control().activity()
}

/// Ticks so many times without a request.
fn run(pair: &mut Pair, ticks: u64) {
    (0..ticks).for_each(|_| {
        tick(pair, None);
    });
}

/// Ticks until `reached`, at most for the duration of an identification; returns whether it was reached.
fn run_until(pair: &mut Pair, reached: impl Fn(&Pair) -> bool) -> bool {
    for _ in 0..LONGEST_IDENTIFICATION {
        if reached(pair) {
            return true;
        }
        tick(pair, None);
    }
    false
}

/// Tracks the 3 s gait, from its first step on.
fn track_gait(pair: &mut Pair, context: &Context) {
    let gait = context.configuration.prove(context.motions.validation[1]).expect("proved at the start");
    assert!(pair.leg.set_tracked(gait));
    tick(pair, Some(ControlRequest::Track { with_model: true }));
    assert!(run_until(pair, |pair| activity(pair) == Activity::Track(Step::Run)));
}

/// Identifies; `None` if the leg stopped without a verdict.
fn identify(pair: &mut Pair) -> Option<Verdict> {
    tick(pair, Some(ControlRequest::Identify));
    assert!(run_until(pair, |pair| !matches!(activity(pair), Activity::Identify(_))), "without end");
    pair.leg.control().verdict()
}

/// A pair in the middle of the exciting motion.
fn during_excitation() -> Pair {
    static PAIR: OnceLock<Pair> = OnceLock::new();
    PAIR.get_or_init(|| {
        let mut pair = enabled(&default_leg(), 1);
        tick(&mut pair, Some(ControlRequest::Identify));
        assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Identify(IdentifyPhase::Excite)));
        run(&mut pair, 10 * SECOND);
        pair
    })
    .clone()
}

/// A pair at the first tick after the training motion was closed, before the search.
fn before_the_search() -> Pair {
    static PAIR: OnceLock<Pair> = OnceLock::new();
    PAIR.get_or_init(|| {
        let mut pair = during_excitation();
        pair.evaluations = 0;
        assert!(run_until(&mut pair, |pair| pair.leg.identification().solver().is_some()));
        pair
    })
    .clone()
}

/// A pair in the second motion of the validation.
fn during_validation() -> Pair {
    static PAIR: OnceLock<Pair> = OnceLock::new();
    PAIR.get_or_init(|| {
        let mut pair = before_the_search();
        pair.evaluations = pair::EVALUATIONS_PER_TICK;
        let phase = IdentifyPhase::Validate { motion: 1, step: Step::Run };
        assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Identify(phase)));
        run(&mut pair, 2 * SECOND);
        pair
    })
    .clone()
}

/// A pair with an accepted model.
fn identified() -> Pair {
    static PAIR: OnceLock<Pair> = OnceLock::new();
    PAIR.get_or_init(|| {
        let mut pair = during_validation();
        assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Idle));
        assert!(pair.leg.control().verdict().is_some_and(Verdict::is_accepted));
        assert!(pair.leg.control().model().is_some());
        pair
    })
    .clone()
}

/// True values of the base parameters.
fn true_base() -> [f64; BASE] {
    let background = &context().background;
    background.model.base.project(background.truth.as_ref().expect("simulated"))
}

/// Largest error of the base parameters in units of their sigma.
fn worst_pull(estimate: &Estimate<f32, BASE>) -> f64 {
    let pull = |(base, truth): (usize, &f64)| {
        let sigma = estimate.sigma(base).expect("determined");
        (f64::from(estimate.values[base]) - truth).abs() / f64::from(sigma)
    };
    true_base().iter().enumerate().map(pull).fold(0.0, f64::max)
}

fn is_enabled(pair: &Pair) -> bool {
    pair.leg.control().state() == DriveState::OperationEnabled
}
