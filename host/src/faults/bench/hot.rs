//! T2: a winding becomes too hot, because the wearer pushes a joint that a host moves.
//!
//! The motors of these legs warm ten times faster than usual: a time constant of 30 s, and 11 A for ever
//! reach the limit of 100 degrees. The firmware's ambient temperature is the plant's (20 degrees), so nothing
//! hides an error of the model. The leg has moved for three time constants when a fork begins.
//!
//! Required: the winding's share of the torque cap falls before the winding reaches its limit, and the
//! plant's winding exceeds the limit by at most 15 degrees (1.5 at the usual time constant). A joint that is
//! pushed against the end of its range keeps the whole cap there, until the leg is damped at the limit. Runs
//! whose windings stay below the ramp count as undetectable.
//!
//! Blind: the firmware's thermal resistance is a thousandth of the motor's.

use scarab::hal::SERVO_RATE_HZ;
use scarab::model::planar::JOINTS;
use scarab::safety::FaultCode;
use scarab::safety::winding::RAMP_K;

use crate::base::error::ToolError;
use crate::faults::bench::Bench;
use crate::faults::bench::hosted::{Fork, context, forked_within};
use crate::faults::invariants::Scope;
use crate::faults::run::Outcome;
use crate::faults::scenario::Head;
use crate::formats::kept_file::memory::Memory;
use crate::formats::leg_file::LegFile;
use crate::rig::bus::board::Board;
use crate::rig::bus::host::{Host, NODES};

/// Servo ticks per second.
const SECOND: u64 = SERVO_RATE_HZ as u64;
/// Thermal resistance to ambient, K/W, and time constant, s.
const KELVIN_PER_WATT: f64 = 8.0;
const TIME_S: f64 = 30.0;
/// Temperatures of the surroundings and of a winding at its limit, degrees Celsius.
const AMBIENT_C: f64 = 20.0;
const LIMIT_C: f64 = 100.0;
/// Largest excess over the limit. Before the leg is off, 50 ms and damping for 300 ms with the whole cap
/// would heat by 23 degrees here; damping never takes all of it.
const TOLERANCE_K: f64 = 15.0;
/// Object of the following window, which no push may leave.
const WINDOW: u16 = 0x6065;

pub(super) const BENCH: Bench = Bench {
    head: Head {
        id: "T2",
        fault: "winding hot after long or large torque",
        detector: "thermal model of each winding, every 2 ms",
        state: "Limit, Damp",
        deadline_ms: f64::INFINITY,
        unit: "degrees",
        codes: &[FaultCode::WindingTemperature],
        lacking: Some("heat that the current does not show: surroundings, iron, gear"),
    },
    run,
};

fn run(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let warmed = |kelvin_per_watt: f64| {
        let mut leg = leg.clone();
        for motor in leg.joints.iter_mut().filter_map(|joint| joint.motor.as_mut()) {
            (motor.thermal_resistance_k_w, motor.thermal_time_s) = (kelvin_per_watt, TIME_S);
            (motor.ambient_c, motor.winding_limit_c) = (AMBIENT_C, LIMIT_C);
        }
        leg
    };
    let believed = warmed(if blind { 1e-3 * KELVIN_PER_WATT } else { KELVIN_PER_WATT });
    let motors = warmed(KELVIN_PER_WATT);
    let mut base = Host::new(Board::new(&motors, context(&believed)?, 1, 1, Memory::new(None))?);
    base.begin()?;
    base.move_leg(leg)?;
    for node in NODES {
        base.write(node, WINDOW, 0, u32::MAX, 4)?;
    }
    base.run(3 * TIME_S as u64 * SECOND);
    // A strong push moves a joint beyond its range.
    let scope = Scope { torque: true, range: false, rotor_position: true };
    forked_within(head, leg, base, seeds, scope, one)
}

/// Hottest winding of the plant, degrees Celsius.
fn hottest(fork: &mut Fork<'_>) -> f64 {
    let drives = fork.host.rig().world.complete_drives();
    drives.map_or(f64::NAN, |drives| {
        drives.axes().iter().map(|axis| axis.motor().temperature()).fold(f64::MIN, f64::max)
    })
}

fn one(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    let joint = fork.random.below(JOINTS as u64) as usize;
    let peak = fork.random.sign() * fork.random.uniform(20.0, 85.0);
    let seconds = fork.random.uniform(2.0, 10.0);
    fork.host.rig().world.push(joint, peak, seconds);
    let (mut most, mut least_share, mut limited_at) = (f64::MIN, 1.0_f32, None);
    for _ in 0..(seconds * SECOND as f64) as u64 + SECOND {
        fork.tick();
        let celsius = hottest(&mut fork);
        most = most.max(celsius);
        let signals = &fork.host.rig().board.signals;
        let share = (0..JOINTS).map(|joint| signals.winding_share(joint)).fold(1.0, f32::min);
        least_share = least_share.min(share);
        if share < 1.0 && limited_at.is_none() {
            limited_at = Some(celsius);
        }
    }
    let undetectable = most < LIMIT_C - f64::from(RAMP_K);
    let in_time = limited_at.is_some_and(|celsius| celsius < LIMIT_C) && most <= LIMIT_C + TOLERANCE_K;
    // A push beyond the range has an alarm of its own.
    let is_damped = fork.host.rig().alarm() == Some(FaultCode::WindingTemperature);
    let state = if is_damped { "Damp" } else { "Limit" };
    let alarm = is_damped.then(|| FaultCode::WindingTemperature.name());
    let found = fork.ended(in_time.then_some(state), alarm);
    Ok(Outcome { undetectable: undetectable && !in_time, magnitude: Some(most), ..found })
}
