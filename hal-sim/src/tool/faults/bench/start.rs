//! C1 before anything switches: an offset that is there while the bridges are released keeps the drive from being enabled.
//!
//! One machine at rest, nobody at the contacts, is forked for each run; the offset comes, a tenth of a second later the operator
//! closes the enabling switch.

use rayon::prelude::*;
use scarab::safety::{DriveState, FaultCode};

use super::super::campaign::BASE;
use super::super::catalogue::JOINTS;
use super::super::dice::Dice;
use super::super::draw::{AMPERE_PER_CODE, at};
use super::super::entry::Head;
use super::super::invariants::{Invariants, Scope};
use super::super::rig::{PERIOD_MS, PERIODS_PER_S, Rig};
use super::super::run::Outcome;
use super::{Bench, outcome};
use crate::faults::{Channel, Form, Injector, Timing};
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::pair::Context;
use crate::tool::simulate::{DriveModel, SimulationOptions};

/// Until the switch is closed: the low-pass of 2.7 ms has settled long before.
const RELEASED: u64 = PERIODS_PER_S / 10;
/// Until the drive has to be enabled, and then some time in which nothing is to be seen any more.
const ENABLED: u64 = PERIODS_PER_S / 2;
/// Of one shunt, A: 2 A of the vector, and a tenth for what calibration and low-pass leave.
const SEEN_A: f64 = 1.1 * 2.0 * 0.866;

pub(super) const ZEROS: Bench = Bench {
    head: Head {
        id: "C1",
        fault: "current offset while the bridges are released",
        detector: "zero window when arming",
        state: "Refuse / Off",
        deadline_ms: 10.0,
        unit: "A",
        codes: &[FaultCode::CurrentZero],
        lacking: None,
    },
    run: arm,
};

/// A machine at rest, ready, drive off.
pub(super) fn ready(leg: &LegFile) -> Result<Rig<JOINTS, BASE>, ToolError> {
    let options = SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::of_seed(1) };
    let context = Context::<JOINTS, BASE>::new(leg, &options)?;
    Rig::new(leg, &context, 1)
}

fn arm(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let ready = ready(leg)?;
    Ok(seeds.par_iter().map(|seed| one(head, leg, &ready, *seed, blind)).collect())
}

fn one(head: &Head, leg: &LegFile, ready: &Rig<JOINTS, BASE>, seed: u64, blind: bool) -> Outcome {
    let mut dice = Dice::new("C1 at rest", seed);
    let mut rig = ready.clone();
    rig.injector = Injector::new(seed);
    if blind {
        rig.blind = head.codes;
    }
    let joint = dice.below(JOINTS as u64) as usize;
    let size = dice.logarithmic(0.5, 6.0);
    let channel = if dice.coin() { Channel::ShuntB } else { Channel::ShuntC };
    let offset = Form::Offset(dice.sign() * size / AMPERE_PER_CODE);
    let injection = at(channel, joint, offset, Timing::from(0));
    rig.injector.add(injection);
    let scope = Scope::of([injection].iter(), &[]);
    let mut invariants = Invariants::new(leg, scope, &rig);
    let (mut enabled, mut alarmed, mut switched) = (None, None, false);
    for period in 0..RELEASED + ENABLED {
        if period == RELEASED {
            rig.hand.enabling = true;
        }
        rig.advance();
        invariants.see(&rig, false);
        switched |= rig.is_switching();
        if rig.state() == DriveState::OperationEnabled {
            enabled = enabled.or(Some(rig.period));
        }
        if rig.alarm().is_some() {
            alarmed = alarmed.or(Some(rig.period));
        }
    }
    let refused = alarmed.is_some() && !switched;
    let after =
        alarmed.zip(enabled).map(|(alarmed, enabled)| (alarmed - enabled.min(alarmed)) as f64 * PERIOD_MS);
    let mut found = outcome(head, seed, refused.then_some("Refuse"));
    found.period = ready.period;
    found.after_ms = after.filter(|_| refused);
    found.detected = refused && after.is_none_or(|after| after <= head.deadline_ms);
    found.undetectable = !refused && size <= SEEN_A;
    found.alarm = rig.alarm().map(FaultCode::name);
    found.magnitude = Some(size);
    found.broken = invariants.into_broken();
    found.hash = format!("{:016x}", rig.hash);
    found
}
