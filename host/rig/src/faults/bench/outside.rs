//! J3: a leg rests outside the range of a joint with its drive off, and a host enables it.
//!
//! A host stops the leg at any time of its motion. The leg falls, and a wearer pushes one joint outwards
//! against its end stop. If it rests within half a degree of its range, the run counts as undetectable.
//! Otherwise the host requests each step of enabling once:
//!
//! | runs | condition | requirement |
//! | --- | --- | --- |
//! | half | targets at the joints' angles | the joint returns into its range: `Limit` |
//! | a quarter | the wearer pushes the joint out again | 8500 beyond half a degree: `Damp` |
//! | a quarter | 2012 forbids returning | never enabled, both nodes report it (FF0E): `Refuse` |
//!
//! A returning joint uses at most a quarter of the torque cap, moves at most 0.3 rad/s, and goes no farther
//! out. Blind: the firmware's ranges are 2 rad wider.

use scarab::safety::{DriveState, FaultCode, NoticeCode};
use scarab::units::Radian;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::host::{NODES, SECOND, Speaks};
use crate::faults::bench::Outcomes;
use crate::faults::bench::hosted::{Fork, context, forked_within, moving};
use crate::faults::catalogue::Fault;
use crate::faults::invariants::{MARGIN_RAD, Scope};
use crate::faults::run::Outcome;
use scarab::model::planar::JOINTS;

const WIDENED: Radian = Radian(2.0);
/// Largest share of the torque cap.
const SHARE: f64 = 0.25;
/// Largest speed outside the range, rad/s: the commanded 0.1 rad/s plus the transient while the drive takes
/// the weight.
const FASTEST: f64 = 0.3;
/// Code of a refused step towards enabled.
const REFUSED: u16 = NoticeCode::NotEnabled.number();

pub(super) fn run(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let mut context = context(leg)?;
    if blind {
        for joint in &mut context.configuration.joints {
            (joint.low, joint.high) = (joint.low - WIDENED, joint.high + WIDENED);
        }
    }
    let base = moving(leg, context)?;
    // A returning joint is driven outside its range.
    let scope = Scope { torque: true, range: false, rotor_position: true };
    forked_within(fault, leg, base, seeds, scope, |fork| one(fork, leg))
}

/// Distance of each joint beyond its range, rad, and the outward direction.
fn beyond(fork: &mut Fork<'_>, leg: &LegFile) -> [(f64, f64); JOINTS] {
    let position = fork.host.rig().world.anatomical_position();
    core::array::from_fn(|joint| {
        let [low, high] = leg.joints[joint].range_deg.map(f64::to_radians);
        let (below, above) = (low - position[joint], position[joint] - high);
        if below > above { (below, -1.0) } else { (above, 1.0) }
    })
}

/// Requests each step towards enabled once.
fn enable(fork: &mut Fork<'_>) -> bool {
    for word in [6, 7, 15] {
        NODES.into_iter().for_each(|node| fork.host.command(node, word));
        fork.run(40);
    }
    fork.host.is_enabled()
}

fn one(mut fork: Fork<'_>, leg: &LegFile) -> Result<Outcome, ToolError> {
    fork.host.speaks = Speaks::default();
    let stop = if fork.random.coin() { 0 } else { 2 };
    NODES.into_iter().for_each(|node| fork.host.command(node, stop));
    fork.run(3 * SECOND / 2);
    let joint = fork.random.below(JOINTS as u64) as usize;
    let torque = fork.random.uniform(20.0, 90.0);
    fork.host.rig().world.push(joint, -torque, 0.6);
    fork.run(2 * SECOND);
    let from = beyond(&mut fork, leg);
    let farthest = from.iter().fold(0.0_f64, |most, (out, _)| most.max(*out));
    let magnitude = Some(farthest.to_degrees());
    let pushed = from.iter().position(|(out, _)| *out == farthest).unwrap_or(joint);
    if farthest <= MARGIN_RAD {
        let found = fork.ended(None, None);
        return Ok(Outcome { detected: false, undetectable: true, ..found });
    }
    let (state, undetectable) = match fork.random.below(4) {
        0 => (is_refused(&mut fork)?.then_some("Refuse"), false),
        1 => pushed_out(&mut fork, leg, (pushed, from[pushed].1)),
        _ => (comes_back(&mut fork, leg, from.map(|(out, _)| out)).then_some("Limit"), false),
    };
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    let found = fork.ended(state, alarm);
    Ok(Outcome { detected: state.is_some(), undetectable, magnitude, ..found })
}

/// Returns whether enabling is refused and both nodes report it.
fn is_refused(fork: &mut Fork<'_>) -> Result<bool, ToolError> {
    fork.host.write_both(0x2012, 0, 1)?;
    let is_enabled = enable(fork);
    let has_reported = |node: &u16| fork.host.emergencies().contains(&(*node, REFUSED));
    let all_reported = NODES.iter().all(has_reported);
    Ok(!is_enabled && all_reported && fork.host.read(1, 0x603F, 0)? == u32::from(REFUSED))
}

fn begins(fork: &mut Fork<'_>) -> bool {
    fork.host.follow_positions();
    fork.host.speaks = Speaks { sync: true, targets: true, ..Speaks::default() };
    fork.run(40);
    // A swinging leg is refused, so the request is repeated.
    (0..8).any(|_| {
        let is_enabled = enable(fork);
        if !is_enabled {
            fork.run(SECOND / 4);
        }
        is_enabled
    })
}

/// Sets the host's targets to the joints' angles; returns whether the joints return.
fn comes_back(fork: &mut Fork<'_>, leg: &LegFile, from: [f64; JOINTS]) -> bool {
    if !begins(fork) {
        return false;
    }
    for _ in 0..4 * SECOND {
        fork.tick();
        let now = beyond(fork, leg);
        let velocity = fork.host.rig().world.velocity();
        let torque = fork.host.rig().output.map_or([0.0; JOINTS], |output| {
            output.servo.decision.torque.map(|torque| f64::from(torque.0.abs()))
        });
        for joint in (0..JOINTS).filter(|joint| now[*joint].0 > MARGIN_RAD) {
            let file = &leg.joints[joint];
            let cap = file.torque_limit_nm.min(file.current_limit() * file.torque_per_ampere.abs());
            let is_bounded = now[joint].0 < from[joint].max(0.0) + MARGIN_RAD
                && velocity[joint].abs() < FASTEST
                && torque[joint] <= SHARE * cap * 1.001;
            if !is_bounded {
                return false;
            }
        }
        if !fork.host.is_enabled() {
            return false;
        }
    }
    beyond(fork, leg).iter().all(|(out, _)| *out < MARGIN_RAD)
}

/// Pushes the joint out again: the leg must stop, unless the joint hardly moved.
fn pushed_out(
    fork: &mut Fork<'_>,
    leg: &LegFile,
    (joint, way): (usize, f64),
) -> (Option<&'static str>, bool) {
    if !begins(fork) {
        return (None, false);
    }
    fork.run(SECOND / 10);
    let begun = beyond(fork, leg)[joint].0;
    if begun <= MARGIN_RAD || !fork.host.is_enabled() {
        return (None, true);
    }
    let torque = fork.random.uniform(30.0, 90.0);
    fork.host.rig().world.push(joint, way * torque, 0.5);
    let mut nearest = begun;
    for _ in 0..SECOND {
        fork.tick();
        let out = beyond(fork, leg)[joint].0;
        if matches!(fork.host.rig().state(), DriveState::FaultReactionActive { .. }) {
            let is_limit = fork.host.rig().alarm() == Some(FaultCode::PositionLimit);
            return (is_limit.then_some("Damp"), false);
        }
        nearest = nearest.min(out);
        // A tenth of a degree for the encoder's lag.
        if out > nearest.max(0.0) + 1.2 * MARGIN_RAD {
            return (None, false);
        }
    }
    (None, true)
}
