//! J3: a leg whose drive is off rests outside the range of a joint, and a host enables it.
//!
//! A host stops the leg anywhere in its motion; it falls, and a wearer pushes one joint outwards against its end stop. Where it then rests within half
//! a degree of its range the run counts as not to be seen. Otherwise the host enables it, each step once:
//!
//! | half of the runs | the host's targets are where the joints are | the joint comes back into its range, with at most a quarter of the torque cap, no faster than 0.3 rad/s and no farther out than it was; `Limit` |
//! | a quarter | the wearer pushes the joint out again meanwhile | 8500 where that moves it by more than half a degree: `Damp` |
//! | a quarter | 2012 forbids the way back | never enabled, and both nodes tell why (FF0E): `Refuse` |
//!
//! Blind the firmware believes in ranges that are 2 rad wider.

use scarab::safety::{DriveState, FaultCode, NoticeCode};
use scarab::units::Radian;

use super::super::catalogue::JOINTS;
use super::super::entry::Head;
use super::super::invariants::{MARGIN_RAD, Scope};
use super::super::run::Outcome;
use super::Bench;
use super::hosted::{Fork, context, forked_within};
use crate::tool::bus::board::Board;
use crate::tool::bus::host::{Host, Speaks};
use crate::tool::bus::memory::Memory;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;

const NODES: [u16; 2] = [1, 2];
const WIDENED: Radian = Radian(2.0);
/// Servo ticks of a second.
const SECOND: u64 = 4000;
/// Of the cap.
const SHARE: f64 = 0.25;
/// Greatest speed outside, rad/s: what 0.1 rad/s become while a weight is taken over, and more is none.
const FASTEST: f64 = 0.3;
/// Code of a refused step towards enabled.
const REFUSED: u16 = NoticeCode::NotEnabled.number();
const NOTHING: Speaks = Speaks { targets: false, words: false, heartbeat: 0 };

pub(super) const BENCH: Bench = Bench {
    head: Head {
        id: "J3",
        fault: "leg rests outside its range and is enabled",
        detector: "bounds of the way back",
        state: "Limit, Damp, Refuse",
        deadline_ms: f64::INFINITY,
        unit: "degrees",
        codes: &[],
        lacking: None,
    },
    run,
};

fn run(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let mut context = context(leg)?;
    if blind {
        for joint in &mut context.configuration.joints {
            (joint.low, joint.high) = (joint.low - WIDENED, joint.high + WIDENED);
        }
    }
    let mut base = Host::new(Board::new(leg, context, 1, 1, Memory::new(None))?);
    base.begin()?;
    base.move_leg(leg)?;
    // A joint that returns is driven outside.
    let scope = Scope { torque: true, range: false, place: true };
    forked_within(head, leg, base, seeds, scope, |fork| one(fork, leg))
}

/// How far each joint is beyond its range, rad, and the way out.
fn beyond(fork: &mut Fork<'_>, leg: &LegFile) -> [(f64, f64); JOINTS] {
    let position = fork.host.rig().world.anatomical_position();
    core::array::from_fn(|joint| {
        let [low, high] = leg.joints[joint].range_deg.map(f64::to_radians);
        let (below, above) = (low - position[joint], position[joint] - high);
        if below > above { (below, -1.0) } else { (above, 1.0) }
    })
}

/// Each step towards enabled, once.
fn enable(fork: &mut Fork<'_>) -> bool {
    for word in [6, 7, 15] {
        NODES.into_iter().for_each(|node| fork.host.command(node, word));
        fork.run(40);
    }
    fork.host.is_enabled()
}

fn one(mut fork: Fork<'_>, leg: &LegFile) -> Result<Outcome, ToolError> {
    fork.host.speaks = NOTHING;
    let stop = if fork.dice.coin() { 0 } else { 2 };
    NODES.into_iter().for_each(|node| fork.host.command(node, stop));
    fork.run(3 * SECOND / 2);
    let joint = fork.dice.below(JOINTS as u64) as usize;
    let torque = fork.dice.uniform(20.0, 90.0);
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
    let (state, undetectable) = match fork.dice.below(4) {
        0 => (is_refused(&mut fork)?.then_some("Refuse"), false),
        1 => pushed_out(&mut fork, leg, (pushed, from[pushed].1)),
        _ => (comes_back(&mut fork, leg, from.map(|(out, _)| out)).then_some("Limit"), false),
    };
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    let found = fork.ended(state, alarm);
    Ok(Outcome { detected: state.is_some(), undetectable, magnitude, ..found })
}

/// It is not enabled, and both nodes tell why.
fn is_refused(fork: &mut Fork<'_>) -> Result<bool, ToolError> {
    for node in NODES {
        fork.host.write(node, 0x2012, 0, 0, 1)?;
    }
    let is_enabled = enable(fork);
    let told = |node: &u16| fork.host.told().contains(&(*node, REFUSED));
    let all_told = NODES.iter().all(told);
    Ok(!is_enabled && all_told && fork.host.read(1, 0x603F, 0)? == u32::from(REFUSED))
}

fn begins(fork: &mut Fork<'_>) -> bool {
    fork.host.follow_places();
    fork.host.speaks = Speaks { targets: true, ..NOTHING };
    fork.run(40);
    // One that still swings is refused, and asked again.
    (0..8).any(|_| {
        let is_enabled = enable(fork);
        if !is_enabled {
            fork.run(SECOND / 4);
        }
        is_enabled
    })
}

/// The host's targets are where the joints were: the joints come back.
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

/// Somebody pushes the joint out again: the leg stops, unless the joint hardly moved.
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
    let torque = fork.dice.uniform(30.0, 90.0);
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
