//! C1 before any bridge switches: a current-sensor offset while the bridges are off prevents enabling.
//!
//! One machine at rest with open contacts is forked for each run. A tenth of a second after the offset
//! appears, the operator closes the enabling switch.

use hal_sim::faults::{Channel, Form, Injector, Timing};
use rayon::prelude::*;
use scarab::safety::{DriveState, FaultCode};
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::Fault;
use crate::faults::draw::{AMPERE_PER_CODE, at};
use crate::faults::invariants::{Invariants, Scope};
use crate::faults::run::Outcome;
use crate::faulty_board::{PERIOD_MS, PERIODS_PER_S, Rig};
use crate::pair::Context;
use scarab::model::planar::{BASE, JOINTS};

/// Periods until the switch is closed; the low-pass of 2.7 ms has settled by then.
const RELEASED: u64 = PERIODS_PER_S / 10;
/// Periods until the drive must be enabled, with a margin.
const ENABLED: u64 = PERIODS_PER_S / 2;
/// Detectable offset of one shunt, A: 2 A of the vector, plus 10 % for calibration and low-pass.
const SEEN_A: f64 = 1.1 * 2.0 * 0.866;

/// A ready machine at rest, drive off.
pub(super) fn ready(leg: &LegFile) -> Result<Rig<JOINTS, BASE>, ToolError> {
    Rig::new(leg, &Context::with_complete_drives(leg, 1)?, 1)
}

pub(super) fn arm(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let ready = ready(leg)?;
    Ok(seeds.par_iter().map(|seed| one(fault, leg, &ready, *seed, blind)).collect())
}

fn one(fault: &Fault, leg: &LegFile, ready: &Rig<JOINTS, BASE>, seed: u64, blind: bool) -> Outcome {
    let mut random = Random::new("C1 at rest", seed);
    let mut rig = ready.clone();
    rig.injector = Injector::new(seed);
    if blind {
        rig.blind = fault.codes;
    }
    let joint = random.below(JOINTS as u64) as usize;
    let size = random.logarithmic(0.5, 6.0);
    let channel = if random.coin() { Channel::ShuntB } else { Channel::ShuntC };
    let offset = Form::Offset(random.sign() * size / AMPERE_PER_CODE);
    let injection = at(channel, joint, offset, Timing::from(0));
    rig.injector.add(injection);
    let scope = Scope::new([injection].iter(), &[]);
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
    let mut found = outcome(fault, seed, refused.then_some("Refuse"));
    found.period = ready.period;
    found.after_ms = after.filter(|_| refused);
    found.detected = refused && after.is_none_or(|after| after <= fault.deadline_ms);
    found.undetectable = !refused && size <= SEEN_A;
    found.alarm = rig.alarm().map(FaultCode::name);
    found.magnitude = Some(size);
    found.broken = invariants.into_broken();
    found.hash = format!("{:016x}", rig.hash);
    found
}
