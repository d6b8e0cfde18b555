//! I1: a search is cancelled at any step, stopped by a fault or the emergency stop, or returns invalid
//! values. All previous parameters must remain.
//!
//! One leg identifies itself twice. Each run forks it at the start of the second search. Ideal drives.

use rayon::prelude::*;
use scarab::leg::{Activity, ControlRequest, IdentifiedModel, IdentifyPhase, Step};
use scarab::safety::PowerRequest;
use scarab::units::Ampere;
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::Fault;
use crate::faults::run::Outcome;
use crate::options::SimulationOptions;
use crate::pair::{Context, Pair};
use scarab::hal::SERVO_RATE_HZ;
use scarab::model::planar::{BASE, JOINTS};

/// Longest identification, servo ticks.
const LONGEST: u64 = 300 * SERVO_RATE_HZ as u64;
/// Servo ticks for which a leg is observed after its search: half a second.
const AFTERWARDS: u64 = 2000;

/// A leg with an accepted model at the first tick of another search, and the duration of that search in
/// ticks.
struct Searching {
    pair: Pair<JOINTS, BASE>,
    old: IdentifiedModel<JOINTS>,
    ticks: u64,
    gravity: [f32; 3],
}

fn phase(pair: &Pair<JOINTS, BASE>) -> Option<IdentifyPhase> {
    match pair.leg.control().activity() {
        Activity::Identify(phase) => Some(phase),
        _ => None,
    }
}

/// Returns whether the search runs; it starts while the leg settles.
fn is_searching(pair: &Pair<JOINTS, BASE>) -> bool {
    matches!(phase(pair), Some(IdentifyPhase::Settle | IdentifyPhase::Solve))
        && pair.leg.identification().solver().is_some()
}

impl Searching {
    fn new(leg: &LegFile) -> Result<Self, ToolError> {
        let refused = |words: &str| ToolError::from(leg.error(words.to_owned()));
        let context = Context::<JOINTS, BASE>::new(leg, &SimulationOptions::with_seed(1))?;
        let mut pair = Pair::new(leg, &context, 1)?;
        let gravity = context.gravity;
        if !pair.enable(gravity) {
            return Err(refused("the drive cannot be enabled"));
        }
        go(&mut pair, gravity, |pair| phase(pair).is_none());
        let old = *pair.leg.control().model().ok_or_else(|| refused("its identification is refused"))?;
        go(&mut pair, gravity, is_searching);
        let mut ahead = pair.clone();
        let mut ticks = 0;
        while is_searching(&ahead) && ticks < LONGEST {
            ahead.tick(None, gravity);
            ticks += 1;
        }
        if phase(&ahead).is_none() {
            return Err(refused("its second identification does not reach the search"));
        }
        Ok(Self { pair, old, ticks, gravity })
    }
}

/// Requests an identification and ticks until the condition holds.
fn go(pair: &mut Pair<JOINTS, BASE>, gravity: [f32; 3], there: fn(&Pair<JOINTS, BASE>) -> bool) {
    let mut request = Some(ControlRequest::Identify);
    for _ in 0..LONGEST {
        pair.tick(request.take(), gravity);
        if there(pair) {
            break;
        }
    }
}

pub(super) fn interrupt(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let searching = Searching::new(leg)?;
    Ok(seeds.par_iter().map(|seed| one(fault, &searching, *seed, blind)).collect())
}

/// Blind: the search is not interrupted and runs to its end.
fn one(fault: &Fault, searching: &Searching, seed: u64, blind: bool) -> Outcome {
    let mut random = Random::new(fault.id, seed);
    let gravity = searching.gravity;
    let mut pair = searching.pair.clone();
    let way = random.below(10);
    let at = random.below(searching.ticks);
    if blind {
        finish(&mut pair, gravity);
    } else if way == 9 {
        nonsense(&mut pair, gravity, &mut random);
    } else {
        for _ in 0..at {
            pair.tick(None, gravity);
        }
        let request = match way {
            0 | 1 => Some(ControlRequest::Power(PowerRequest::QuickStop)),
            2 | 3 => Some(ControlRequest::Power(PowerRequest::DisableVoltage)),
            4 | 5 => Some(ControlRequest::Power(PowerRequest::DisableOperation)),
            6 => Some(ControlRequest::Identify),
            _ => {
                // A fault: NaN in the servo's sample.
                pair.sample.joints[0].current = Ampere(f32::NAN);
                None
            }
        };
        pair.tick(request, gravity);
        for _ in 0..AFTERWARDS {
            pair.tick(None, gravity);
        }
    }
    let kept = pair.leg.control().model() == Some(&searching.old);
    let mut found = outcome(fault, seed, kept.then_some("old parameters stay"));
    found.magnitude = Some(at as f64);
    if !kept {
        found.broken.push("parameters changed without an accepting verdict".into());
    }
    found
}

/// Replaces the search's result with values of a diverged search.
fn nonsense(pair: &mut Pair<JOINTS, BASE>, gravity: [f32; 3], random: &mut Random) {
    let first = IdentifyPhase::Validate { motion: 0, step: Step::Approach };
    for _ in 0..LONGEST {
        pair.tick(None, gravity);
        if phase(pair) == Some(first) {
            break;
        }
    }
    if let Some(values) = pair.leg.identification().solver().map(|solver| solver.estimate().values) {
        let wrong = match random.below(4) {
            0 => values.map(|_| f32::NAN),
            1 => values.map(|value| value * 1e30),
            2 => values.map(|value| -value),
            _ => values.map(|_| 0.0),
        };
        pair.leg.examine(&wrong);
    }
    finish(pair, gravity);
}

/// Ticks until the verdict, and until an accepted model is in use.
fn finish(pair: &mut Pair<JOINTS, BASE>, gravity: [f32; 3]) {
    for _ in 0..LONGEST {
        pair.tick(None, gravity);
        if phase(pair).is_none() {
            break;
        }
    }
}
