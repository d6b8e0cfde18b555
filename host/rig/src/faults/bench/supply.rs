//! V4, V5: a battery delivers or takes more than its limit, because the wearer pushes a leg that a host
//! moves.
//!
//! Eight random legs on batteries that take current, with other motors, cables and voltages. Each run draws
//! a limit and one push per joint. Half of the runs of V5 have no brake resistor. The truth is the current
//! of the plant's battery.
//!
//! Required: before the true current has exceeded the limit for 20 ms, the torque's share falls or the brake
//! resistor conducts. The true current exceeds 1.25 times the limit for at most 0.2 s, or the leg is damped
//! (V4) or shorted (V5). A fault without such a current is a false alarm. Runs whose true current stays
//! below the limit count as undetectable.
//!
//! Tolerance of the estimate: a tenth and 0.2 A. Not modelled are diodes in the dead time, saliency, and the
//! current of the bus capacitor while the voltage changes.
//!
//! Blind: the firmware has no limit.

use scarab::model::planar::JOINTS;
use scarab::safety::{FaultCode, SupplyLimits};
use scarab::units::{Ampere, Ohm};
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::host::{SECOND, WINDOW};
use crate::faults::bench::Outcomes;
use crate::faults::bench::hosted::{Fork, forked_within, hosted};
use crate::faults::catalogue::{Fault, V5};
use crate::faults::invariants::Scope;
use crate::faults::run::Outcome;

/// Servo ticks per millisecond.
const MILLISECOND: u64 = SECOND / 1000;
/// Random legs of a campaign.
const LEGS: u64 = 8;
/// Error of the estimate: relative, and A.
const RELATIVE: f64 = 0.1;
const ABSOLUTE_A: f64 = 0.2;
/// Low-pass of the true current per servo tick, as in the firmware.
const NEW_SHARE: f64 = 1.0 / 8.0;
/// Time for which a current may exceed its limit unseen, servo ticks.
const UNSEEN: u64 = 20 * MILLISECOND;
const FAULT_FACTOR: f64 = 1.25;
/// Servo ticks after a fault within which shorted motors return nothing.
const SHORTED: u64 = 10 * MILLISECOND;
/// Charge limit of the plant's leg file, A: a battery, without a limit that counts.
const BATTERY_A: f64 = 500.0;

/// The leg on a battery, with random motors, cables and voltage.
fn random_leg(leg: &LegFile, number: u64) -> LegFile {
    let (mut leg, mut random) = (leg.clone(), Random::new("V4 V5", number));
    leg.charge_current_a = Some(BATTERY_A);
    // The rig begins with 48 V; a fifth less would be a lost supply.
    leg.supply.voltage_v = random.uniform(41.0, 49.0);
    leg.supply.resistance_ohm = random.logarithmic(0.02, 0.1);
    leg.supply.capacitance_uf = random.uniform(1000.0, 3000.0);
    for motor in leg.joints.iter_mut().filter_map(|joint| joint.motor.as_mut()) {
        let factor = random.logarithmic(0.5, 1.3);
        motor.resistance_ohm *= factor;
        motor.inductance_d_uh *= factor;
        motor.inductance_q_uh *= factor * random.uniform(1.0, 1.1);
    }
    leg
}

pub(super) fn run(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let mut outcomes = Vec::with_capacity(seeds.len());
    for number in 0..LEGS {
        let own: Vec<u64> = seeds.iter().copied().filter(|seed| seed % LEGS == number).collect();
        if own.is_empty() {
            continue;
        }
        let leg = random_leg(leg, number);
        let mut base = hosted(&leg)?;
        // No push may leave the following window.
        base.write_both(WINDOW, u32::MAX, 4)?;
        // A strong push moves a joint beyond its range.
        let scope = Scope { torque: true, range: false, rotor_position: true };
        let brake = Ohm(leg.supply.brake_ohm as f32);
        outcomes.extend(forked_within(fault, &leg, base, &own, scope, |fork| one(fork, brake, blind))?);
    }
    outcomes.sort_by_key(|outcome| outcome.seed);
    Ok(outcomes)
}

/// Charge that the battery has delivered, C.
fn delivered(fork: &mut Fork<'_>) -> f64 {
    let drives = fork.host.rig().world.complete_drives();
    drives.map_or(f64::NAN, |drives| drives.supply().source_charge())
}

/// Whether the firmware reduces the torque of this direction or uses the brake resistor.
fn reacts(fork: &mut Fork<'_>, charges: bool) -> bool {
    let board = &fork.host.rig().board;
    let [draw, charge] = board.supply_shares();
    if charges { charge < 1.0 || board.signals.given_brake() > 0.0 } else { draw < 1.0 }
}

/// States a drawn limit of the battery's current, A, in one direction. In that of V5 half of the legs have
/// no brake resistor.
fn set_limit(fork: &mut Fork<'_>, charges: bool, brake: Ohm, blind: bool) -> f64 {
    let limit = if charges { fork.random.logarithmic(0.5, 3.0) } else { fork.random.logarithmic(0.5, 8.0) };
    let stated = Some(Ampere(limit as f32)).filter(|_| !blind);
    let limits = match charges {
        true => SupplyLimits { draw: None, charge: stated, brake },
        false => SupplyLimits { draw: stated, charge: None, brake },
    };
    fork.host.rig().board.limit_supply(limits);
    if charges && fork.random.coin() {
        fork.host.rig().board.loops.remove_chopper();
    }
    limit
}

/// Pushes every joint once. Returns the longest duration, s.
fn push_joints(fork: &mut Fork<'_>, charges: bool) -> f64 {
    let mut longest_push: f64 = 0.0;
    for joint in 0..JOINTS {
        let (peak, seconds) = match charges {
            true => (fork.random.uniform(40.0, 180.0), fork.random.uniform(0.2, 1.0)),
            false => (fork.random.uniform(20.0, 110.0), fork.random.uniform(0.3, 2.0)),
        };
        let peak = peak * fork.random.sign();
        fork.host.rig().world.push(joint, peak, seconds);
        longest_push = longest_push.max(seconds);
    }
    longest_push
}

fn one(mut fork: Fork<'_>, brake: Ohm, blind: bool) -> Result<Outcome, ToolError> {
    let charges = fork.fault.id == V5.id;
    let limit = set_limit(&mut fork, charges, brake, blind);
    let longest_push = push_joints(&mut fork, charges);
    let sign = if charges { -1.0 } else { 1.0 };
    let (above, below) = (1.0 + RELATIVE, 1.0 - RELATIVE);
    let (mut current, mut before, mut most) = (0.0, delivered(&mut fork), 0.0_f64);
    // Consecutive ticks above the limit, above and nearly above 1.25 times the limit.
    let (mut over, mut beyond, mut nearly) = (0_u64, 0_u64, 0_u64);
    let (mut longest, mut longest_nearly) = (0, 0);
    let (mut begun, mut unseen, mut seen, mut state) = (false, false, false, None);
    for _ in 0..((longest_push + 0.7) * SECOND as f64) as u64 {
        fork.tick();
        let now = delivered(&mut fork);
        current += NEW_SHARE * (sign * (now - before) * SECOND as f64 - current);
        before = now;
        most = most.max(current);
        seen |= reacts(&mut fork, charges);
        over = if current > limit * above + ABSOLUTE_A { over + 1 } else { 0 };
        beyond = if current > FAULT_FACTOR * limit * above + ABSOLUTE_A { beyond + 1 } else { 0 };
        nearly = if current > FAULT_FACTOR * limit * below - ABSOLUTE_A { nearly + 1 } else { 0 };
        (longest, longest_nearly) = (longest.max(beyond), longest_nearly.max(nearly));
        begun |= over > 0;
        unseen |= over > UNSEEN && !seen;
        state = fork.safe_state();
        if state.is_some() {
            break;
        }
    }
    let alarm = fork.host.rig().alarm();
    let own = alarm == fork.fault.codes.first().copied();
    if own && charges {
        fork.run(SHORTED);
        let start = delivered(&mut fork);
        fork.run(SHORTED);
        let rest = (start - delivered(&mut fork)) * SECOND as f64 / SHORTED as f64;
        if rest > ABSOLUTE_A {
            fork.broken("shorted motors charge the battery");
        }
    }
    let false_alarm = own && (longest_nearly as f64) < 0.2 * SECOND as f64;
    let state = match (own, charges) {
        (true, true) if state == Some("Off") => Some("Short"),
        (true, _) => state,
        (false, _) => seen.then_some("Limit"),
    };
    let after_ms = longest as f64 / MILLISECOND as f64;
    let in_time = seen && !unseen && after_ms <= fork.fault.deadline_ms;
    let code = alarm.filter(|_| own).map(FaultCode::name);
    let found = fork.ended(state, code);
    Ok(Outcome {
        detected: in_time,
        undetectable: !begun && !in_time,
        false_alarm,
        after_ms: in_time.then_some(after_ms),
        magnitude: Some(most),
        ..found
    })
}
