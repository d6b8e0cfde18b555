//! X1 before any motion: the emergency stop at any tick of boot, from the first one on, and at any tick of a
//! calibration.
//!
//! | where | machine | requirement |
//! | --- | --- | --- |
//! | boot, to the start of an identification | whole board, as operated | off in the tick, not enabled |
//! | calibration | motor on a test stand, tick checks | off in the tick, calibration ended without result |

use hal_sim::faults::{Channel, Form, Injector, Timing};
use rayon::prelude::*;
use scarab::hal::AxisCommand;
use scarab::leg::DriveState;
use scarab::motor::CalibrationStep;
use scarab::safety::{Bridges, FaultCode, TickState, TickWatch};
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::board::LONGEST_CALIBRATION;
use crate::faults::bench::calibration::{UNFIT, on_stand};
use crate::faults::bench::start::ready;
use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::Fault;
use crate::faults::draw::at;
use crate::faults::invariants::{Invariants, Scope};
use crate::faults::run::Outcome;
use crate::faulty_board::{PERIOD_MS, PERIODS_PER_S, Rig};
use scarab::model::planar::{BASE, JOINTS};

/// Periods until the operator closes the switch, then presses the button, and until the end.
const CLOSED: u64 = PERIODS_PER_S / 5;
const PRESSED: u64 = 2 * CLOSED;
const BOOTED: u64 = 3 * CLOSED;

pub(super) fn stop(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let ready = ready(leg)?;
    // Duration of an undisturbed calibration.
    let length = calibrated(leg, 0, 1, None, false)?.0;
    let run = |seed: &u64| {
        let mut random = Random::new("X1 at rest", *seed);
        // Only even seeds reach this bench; the odd ones are forks.
        if random.coin() {
            Ok(boot(fault, leg, &ready, *seed, &mut random, blind))
        } else {
            calibration(fault, leg, length, *seed, &mut random, blind)
        }
    };
    seeds.par_iter().map(run).collect()
}

fn boot(
    fault: &Fault,
    leg: &LegFile,
    ready: &Rig<JOINTS, BASE>,
    seed: u64,
    random: &mut Random,
    blind: bool,
) -> Outcome {
    let mut rig = ready.clone();
    rig.injector = Injector::new(seed);
    if blind {
        rig.blind = fault.codes;
    }
    let begin = rig.period;
    // The very first tick is drawn in one of a thousand runs.
    let pressed = begin + random.below(BOOTED) * random.below(1000).min(1);
    let lasting = 1 + random.below(PERIODS_PER_S / 100);
    rig.injector.add(at(Channel::EmergencyStop, 0, Form::Off, Timing::lasting(pressed, lasting)));
    let mut invariants =
        Invariants::new(leg, Scope { torque: true, range: true, rotor_position: true }, &rig);
    let (mut seen, mut came_back) = (None, false);
    for since in 0..BOOTED + CLOSED {
        rig.hand.start = rig.state() == DriveState::OperationEnabled && since >= PRESSED;
        if since == CLOSED {
            rig.hand.enabling = true;
        }
        let stop = rig.injector.happens(Channel::EmergencyStop, 0, rig.period);
        rig.advance();
        invariants.see(&rig, stop);
        if seen.is_none() && rig.alarm() == Some(FaultCode::EmergencyStop) && !rig.is_switching() {
            seen = Some(rig.period);
        }
        came_back |= seen.is_some() && rig.is_switching();
    }
    let after = seen.map(|seen| (seen - pressed) as f64 * PERIOD_MS);
    let mut found = outcome(fault, seed, seen.filter(|_| !came_back).map(|_| "Off"));
    found.detected &= after.is_some_and(|after| after <= fault.deadline_ms + 1e-9);
    found.after_ms = after;
    found.period = pressed;
    found.alarm = rig.alarm().map(FaultCode::name);
    found.broken = invariants.into_broken();
    found.hash = format!("{:016x}", rig.hash);
    found
}

fn calibration(
    fault: &Fault,
    leg: &LegFile,
    length: u64,
    seed: u64,
    random: &mut Random,
    blind: bool,
) -> Result<Outcome, ToolError> {
    let index = random.below(JOINTS as u64) as usize;
    let pressed = random.below(length);
    let (ticks, released) = calibrated(leg, index, seed, Some(pressed), blind)?;
    // Ended in the tick of the stop, before a result.
    let stopped = released && ticks == pressed + 1;
    let mut found = outcome(fault, seed, stopped.then_some("Off"));
    found.after_ms = released.then(|| (ticks - pressed) as f64 * PERIOD_MS);
    found.period = pressed;
    found.alarm = released.then(|| FaultCode::EmergencyStop.name());
    // The calibration ended before the contact opened.
    found.undetectable = !released && ticks <= pressed && !blind;
    Ok(found)
}

/// Runs a calibration like `operation::AxisState`, with the contact opened at a tick. Returns its ticks, and
/// whether the stop ended it.
fn calibrated(
    leg: &LegFile,
    index: usize,
    seed: u64,
    pressed: Option<u64>,
    blind: bool,
) -> Result<(u64, bool), ToolError> {
    let (mut stand, mut calibrator, _) = on_stand(leg, index, seed)?;
    let mut watch = TickWatch::default();
    let mut command = AxisCommand::OFF;
    for tick in 0..LONGEST_CALIBRATION {
        let sample = stand.period(&command, 0.0);
        let emergency_stop = pressed.is_some_and(|pressed| tick >= pressed) && !blind;
        let state = TickState { emergency_stop, gate_fault: false, complete: true, missed: 0 };
        let (forbids, _) = watch.check(&state);
        if Bridges::from_causes(forbids) != Bridges::Follow {
            return Ok((tick + 1, true));
        }
        match calibrator.tick(&sample) {
            CalibrationStep::Running(next) => command = next,
            CalibrationStep::Done(_) | CalibrationStep::Refused(_) => return Ok((tick + 1, false)),
        }
    }
    Err(leg.error(UNFIT).into())
}
