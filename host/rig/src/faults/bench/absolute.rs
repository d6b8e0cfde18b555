//! E6, E7: absolute encoders at rotor and joint that are silent, or contradict the counter.
//!
//! | row | fault | reaction |
//! | --- | --- | --- |
//! | E6 | no valid frame, random frames | Damp after five checks; random frames may also contradict |
//! | E7 | a reading off by some steps, a frozen encoder, a line at ground, a frozen counter | Short |
//!
//! Each axis has both encoders, with errors of 0.8 degrees over a turn. A host moves the leg. A check comes
//! every 8 ms. In E7 the fault exists while the reading differs from the true one by more than surely shows:
//! 14 counts at the rotor, 4.4 degrees at the joint. Frames that are wrong for less than two checks (E7), or
//! invalid for less than five (E6), must have no effect; the same holds for readings that are off by less
//! than the encoders' own errors. What lies between, and runs whose difference never lasts, count as
//! undetectable.
//!
//! Blind: the firmware's leg file has no absolute encoders.

use hal_sim::faults::{Channel, Form, Timing};
use scarab::model::planar::JOINTS;
use scarab::safety::FaultCode;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::host::Host;
use crate::faults::bench::Outcomes;
use crate::faults::bench::hosted::{Fork, context, forked_within, moving};
use crate::faults::catalogue::{ENCODER_CHECK, ENCODER_CHECK_MS, Fault, TICK_MS};
use crate::faults::invariants::Scope;
use crate::faults::run::Outcome;

/// Ticks of a run: three strokes of the motion.
const PATIENCE: u64 = 12_000;
/// Steps of an encoder per turn, and per count of 4,096.
const STEPS: f64 = 16_384.0;
const COUNT: f64 = 4.0;
/// Differences that surely show, and that surely do not, steps: at the rotor and at the joint. The joint's
/// lie around the tolerance of 114, apart by twice the encoder's error of 37 and backlash.
const SURE: [f64; 2] = [14.0 * COUNT, 200.0];
const HIDDEN: [f64; 2] = [10.0 * COUNT, 38.0];
/// Random frames: at worst ten checks, and twice that where a random angle is right by chance.
const GARBAGE_MS: f64 = 20.0 * ENCODER_CHECK_MS;

fn base(leg: &LegFile, blind: bool) -> Result<Host, ToolError> {
    let motors = leg.with_absolute_encoders();
    let mut believed = motors.clone();
    for motor in believed.joints.iter_mut().filter_map(|joint| joint.motor.as_mut()).filter(|_| blind) {
        (motor.absolute_encoder, motor.joint_encoder) = (false, None);
    }
    moving(&motors, context(&believed)?)
}

pub(super) fn silent(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let scope = Scope { torque: true, range: true, rotor_position: true };
    forked_within(fault, leg, base(leg, blind)?, seeds, scope, falls_silent)
}

pub(super) fn contradict(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let scope = Scope { torque: false, range: true, rotor_position: false };
    forked_within(fault, leg, base(leg, blind)?, seeds, scope, contradicts)
}

/// Adds a fault from now on.
fn inject(fork: &mut Fork<'_>, channel: Channel, joint: usize, form: Form, duration: u64) {
    let timing = Timing::lasting(fork.host.rig().period, duration);
    fork.inject(channel, joint, form, timing);
}

/// Safe state of both bridges.
fn reached(fork: &mut Fork<'_>) -> Option<&'static str> {
    let rig = fork.host.rig();
    match (rig.is_braking(), rig.is_switching()) {
        (true, _) => Some("Short"),
        (_, false) => Some("Off"),
        _ => fork.safe_state(),
    }
}

fn falls_silent(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    let joint = fork.random.below(JOINTS as u64) as usize;
    let channel = if fork.random.coin() { Channel::RotorEncoder } else { Channel::JointEncoder };
    let checks = 1 + fork.random.below(9);
    let (form, lasts) = match fork.random.below(3) {
        0 => (Form::Garbage, u64::MAX),
        1 => (Form::Rail(65_535.0), u64::MAX),
        _ => (Form::Rail(65_535.0), checks * ENCODER_CHECK),
    };
    inject(&mut fork, channel, joint, form, lasts);
    let (state, after_ms) = fork.until(4 * PATIENCE / 12, reached).unzip();
    // Random frames are wrong now and then.
    let intermittent_ms = (form == Form::Garbage).then_some(GARBAGE_MS);
    let deadline_ms = intermittent_ms.unwrap_or(fork.fault.deadline_ms);
    let in_time = after_ms.is_some_and(|after| after <= deadline_ms + 1e-9);
    let is_right = state == Some("Damp") || form == Form::Garbage && matches!(state, Some("Short" | "Off"));
    // An interruption of so many checks spans as many of them, whatever its phase.
    let (is_noise, may_be) = (lasts < 5 * ENCODER_CHECK, lasts <= 5 * ENCODER_CHECK);
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    let magnitude = (lasts < u64::MAX).then_some(checks as f64);
    let found = fork.ended(state, alarm);
    Ok(Outcome {
        detected: in_time && is_right && !is_noise,
        undetectable: state.is_none() && may_be,
        false_alarm: is_noise && state.is_some(),
        after_ms,
        intermittent_ms,
        magnitude,
        ..found
    })
}

/// Kinds of E7.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// The reading is off by some steps.
    Offset(f64),
    /// The reading stays.
    Frozen,
    /// The line is at ground: a valid angle of zero.
    Ground,
    /// The counter stays.
    FrozenCounter,
    /// The reading of one check is off.
    Once(f64),
}

/// True readings of a joint's encoders, steps.
fn readings(fork: &mut Fork<'_>, joint: usize) -> [f64; 2] {
    let world = &fork.host.rig().world;
    let rotor = world.complete_drives().and_then(|drives| drives.axes()[joint].rotor_steps());
    [rotor, world.joint_steps(joint)].map(|steps| steps.map_or(f64::NAN, f64::from))
}

/// Distance of two readings on the circle.
fn apart(one: f64, other: f64) -> f64 {
    let distance = (one - other).rem_euclid(STEPS);
    distance.min(STEPS - distance)
}

fn contradicts(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    let joint = fork.random.below(JOINTS as u64) as usize;
    let side = fork.random.below(2) as usize;
    let channel = [Channel::RotorEncoder, Channel::JointEncoder][side];
    let offset = fork.random.sign() * fork.random.logarithmic(1.0, 0.5 * STEPS).round();
    let kind = match fork.random.below(6) {
        0 => Kind::Frozen,
        1 => Kind::Ground,
        2 => Kind::FrozenCounter,
        3 => Kind::Once(offset),
        _ => Kind::Offset(offset),
    };
    let first = readings(&mut fork, joint);
    match kind {
        Kind::Offset(offset) => inject(&mut fork, channel, joint, Form::Offset(offset), u64::MAX),
        Kind::Once(offset) => inject(&mut fork, channel, joint, Form::Offset(offset), ENCODER_CHECK - 1),
        Kind::Frozen => inject(&mut fork, channel, joint, Form::Stuck, u64::MAX),
        Kind::Ground => inject(&mut fork, channel, joint, Form::Off, u64::MAX),
        Kind::FrozenCounter => inject(&mut fork, Channel::Counter, joint, Form::Stuck, u64::MAX),
    }
    // A frozen counter is compared at the rotor; a frozen reading is up to a check older than the fork.
    let at = if kind == Kind::FrozenCounter { 0 } else { side };
    let slack = if kind == Kind::Frozen { [16.0 * COUNT, 20.0][at] } else { 0.0 };
    let (mut since, mut longest, mut most) = (None, 0, 0.0_f64);
    let (mut state, mut after_ms) = (None, None);
    for tick in 0..PATIENCE {
        let now = readings(&mut fork, joint);
        let off = match kind {
            Kind::Offset(offset) => offset.abs(),
            Kind::Once(_) => 0.0,
            Kind::Ground => apart(now[at], 0.0),
            Kind::Frozen | Kind::FrozenCounter => apart(now[at], first[at]),
        };
        most = most.max(off);
        since = if off > SURE[at] + slack { since.or(Some(tick)) } else { None };
        longest = longest.max(since.map_or(0, |since| tick - since));
        fork.tick();
        state = reached(&mut fork);
        if state.is_some() {
            after_ms = Some(since.map_or(0.0, |since| (tick + 1 - since) as f64 * TICK_MS));
            break;
        }
        if since.is_some_and(|since| (tick - since) as f64 * TICK_MS > 2.0 * fork.fault.deadline_ms) {
            break;
        }
    }
    let in_time = after_ms.is_some_and(|after| after <= fork.fault.deadline_ms + 1e-9);
    let lasts = longest as f64 * TICK_MS > fork.fault.deadline_ms;
    let is_hidden = most < HIDDEN[at] && kind != Kind::FrozenCounter;
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    let found = fork.ended(state, alarm);
    Ok(Outcome {
        detected: in_time && matches!(state, Some("Short" | "Off")) && !is_hidden,
        undetectable: state.is_none() && !lasts,
        false_alarm: is_hidden && state.is_some(),
        after_ms,
        magnitude: Some(most),
        ..found
    })
}
