//! X1 before there is motion: the emergency stop at any tick of boot, from the first one on, and at any tick of a calibration.
//!
//! | where | machine | what has to follow |
//! | --- | --- | --- |
//! | boot, to the beginning of an identification | the whole, an operator who goes on as if nothing were | released in the tick, never enabled |
//! | calibration | a motor on its stand, its axis' calibration, what looks before each tick | released in the tick, the calibration is dropped and nothing found |

use core::f64::consts::TAU;

use rayon::prelude::*;
use scarab::hal::AxisCommand;
use scarab::leg::DriveState;
use scarab::motor::{CalibrationStep, Calibrator};
use scarab::safety::{Bridges, FaultCode, TickState, TickWatch};

use super::super::campaign::BASE;
use super::super::catalogue::JOINTS;
use super::super::dice::Dice;
use super::super::draw::at;
use super::super::entry::Head;
use super::super::invariants::{Invariants, Scope};
use super::super::rig::{PERIOD_MS, PERIODS_PER_S, Rig};
use super::super::run::Outcome;
use super::start::ready;
use super::{Bench, outcome};
use crate::faults::{Channel, Form, Injector, Timing};
use crate::tool::board::{axis_configuration, calibration_settings, rested};
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::setup::SetupError;

pub(super) const BENCH: Bench = Bench {
    head: Head {
        id: "X1",
        fault: "emergency stop at boot or in a calibration",
        detector: "sense pin in each tick",
        state: "Off",
        deadline_ms: PERIOD_MS,
        unit: "",
        codes: &[FaultCode::EmergencyStop],
        lacking: None,
    },
    run: stop,
};

/// The operator closes the switch, then presses the button; the machine is watched on.
const CLOSED: u64 = PERIODS_PER_S / 5;
const PRESSED: u64 = 2 * CLOSED;
const BOOTED: u64 = 3 * CLOSED;
/// A calibration takes some seconds; no longer, periods.
const LONGEST: u64 = 60 * PERIODS_PER_S;

fn stop(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let ready = ready(leg)?;
    // How long a calibration takes that nobody stops.
    let length = calibrated(leg, 0, 1, None, false)?.0;
    let run = |seed: &u64| {
        let mut dice = Dice::new("X1 at rest", *seed);
        // Even seeds only come here where the odd ones are forks.
        if dice.coin() {
            Ok(boot(head, leg, &ready, *seed, &mut dice, blind))
        } else {
            calibration(head, leg, length, *seed, &mut dice, blind)
        }
    };
    seeds.par_iter().map(run).collect()
}

fn boot(
    head: &Head,
    leg: &LegFile,
    ready: &Rig<JOINTS, BASE>,
    seed: u64,
    dice: &mut Dice,
    blind: bool,
) -> Outcome {
    let mut rig = ready.clone();
    rig.injector = Injector::new(seed);
    if blind {
        rig.blind = head.codes;
    }
    let begin = rig.period;
    // The first tick of all as often as a thousandth of the others.
    let pressed = begin + dice.below(BOOTED) * dice.below(1000).min(1);
    let lasting = 1 + dice.below(PERIODS_PER_S / 100);
    rig.injector.add(at(Channel::EmergencyStop, 0, Form::Off, Timing::lasting(pressed, lasting)));
    let mut invariants = Invariants::new(leg, Scope { torque: true, range: true, place: true }, &rig);
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
    let mut found = outcome(head, seed, seen.filter(|_| !came_back).map(|_| "Off"));
    found.detected &= after.is_some_and(|after| after <= head.deadline_ms + 1e-9);
    found.after_ms = after;
    found.period = pressed;
    found.alarm = rig.alarm().map(FaultCode::name);
    found.broken = invariants.into_broken();
    found.hash = format!("{:016x}", rig.hash);
    found
}

fn calibration(
    head: &Head,
    leg: &LegFile,
    length: u64,
    seed: u64,
    dice: &mut Dice,
    blind: bool,
) -> Result<Outcome, ToolError> {
    let index = dice.below(JOINTS as u64) as usize;
    let pressed = dice.below(length);
    let (ticks, released) = calibrated(leg, index, seed, Some(pressed), blind)?;
    // Dropped in its own tick, before anything was found.
    let stopped = released && ticks == pressed + 1;
    let mut found = outcome(head, seed, stopped.then_some("Off"));
    found.after_ms = released.then(|| (ticks - pressed) as f64 * PERIOD_MS);
    found.period = pressed;
    found.alarm = released.then(|| FaultCode::EmergencyStop.name());
    // Shorter than usual, and over before the contact opened.
    found.undetectable = !released && ticks <= pressed && !blind;
    Ok(found)
}

/// Ticks to the end of a calibration, as `operation::Stage` runs it, and whether it was dropped; with the contact that opens at a tick.
fn calibrated(
    leg: &LegFile,
    index: usize,
    seed: u64,
    pressed: Option<u64>,
    blind: bool,
) -> Result<(u64, bool), ToolError> {
    let unfit = || SetupError::new(leg, "a motor for every joint that can be calibrated is needed");
    let drives = leg.complete_description::<JOINTS>()?;
    let joint = &leg.joints[index];
    let motor = joint.motor.as_ref().ok_or_else(unfit)?;
    let configuration = axis_configuration(joint, motor);
    let settings = calibration_settings(&configuration, motor);
    let mut stand = rested(&drives.axes[index], &drives.supply, TAU * 0.3, seed);
    let mut calibrator = Calibrator::new(&configuration, settings).map_err(|_| unfit())?;
    let mut watch = TickWatch::default();
    let mut command = AxisCommand::RELEASED;
    for tick in 0..LONGEST {
        let sample = stand.period(&command, 0.0);
        let emergency_stop = pressed.is_some_and(|pressed| tick >= pressed) && !blind;
        let state = TickState { emergency_stop, gate_fault: false, complete: true, missed: 0 };
        let (forbids, _) = watch.look(&state);
        if Bridges::of(forbids) != Bridges::Follow {
            return Ok((tick + 1, true));
        }
        match calibrator.tick(&sample) {
            CalibrationStep::Running(next) => command = next,
            CalibrationStep::Done(_) | CalibrationStep::Refused(_) => return Ok((tick + 1, false)),
        }
    }
    Err(unfit().into())
}
