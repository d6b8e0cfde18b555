//! T2 to T4: a winding becomes too hot, because the wearer pushes a joint that a host moves, or its
//! thermistor fails.
//!
//! | row | fault | reaction |
//! | --- | --- | --- |
//! | T2 | heat of the current | derating; Damp at the limit |
//! | T3 | the same in motors that lose half of the believed heat, with thermistors | the same |
//! | T4 | a thermistor is shorted, in part too, open, or not converted; always, or every other time | Damp |
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
//! In T3 thermal resistance and time constant of the motors are twice the believed ones, so their heat
//! capacity is as believed; 20 degrees are permitted, because a thermistor lags. In T4 interruptions that
//! span at most two readings must have no effect; those that may span two or three count as undetectable. The
//! alarm has to name the joint.
//!
//! Blind: in T2 the firmware's thermal resistance is a thousandth of the motor's; in T3 and T4 its leg file
//! has no thermistors.

use hal_sim::faults::{Channel, Form, Timing};
use scarab::model::planar::JOINTS;
use scarab::safety::FaultCode;
use scarab::safety::thermistor::{OPEN, SHORTED};
use scarab::safety::winding::RAMP_K;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::host::{Host, SECOND, WINDOW};
use crate::faults::bench::Outcomes;
use crate::faults::bench::hosted::{Fork, context, forked_within, moving};
use crate::faults::catalogue::{Fault, THERMISTOR_MS};
use crate::faults::invariants::Scope;
use crate::faults::run::Outcome;
use crate::faulty_board::PERIOD_MS;

/// Codes of a partial short, hotter than 120 degrees.
const PARTIAL: [u16; 2] = [SHORTED + 1, 640];
/// Thermal resistance to ambient, K/W, and time constant, s.
const KELVIN_PER_WATT: f64 = 8.0;
const TIME_S: f64 = 30.0;
/// Temperatures of the surroundings and of a winding at its limit, degrees Celsius.
const AMBIENT_C: f64 = 20.0;
const LIMIT_C: f64 = 100.0;
/// Largest excess over the limit. Before the leg is off, 50 ms and damping for 300 ms with the whole cap
/// would heat by 23 degrees here; damping never takes all of it.
const TOLERANCE_K: f64 = 15.0;
/// Largest excess in T3, whose thermistors lag behind their windings.
const LAGGING_K: f64 = 20.0;

/// The leg with other thermal constants of its motors.
fn warmed(leg: &LegFile, kelvin_per_watt: f64, time_s: f64) -> LegFile {
    let mut leg = leg.clone();
    for motor in leg.joints.iter_mut().filter_map(|joint| joint.motor.as_mut()) {
        (motor.thermal_resistance_k_w, motor.thermal_time_s) = (kelvin_per_watt, time_s);
        (motor.ambient_c, motor.winding_limit_c) = (AMBIENT_C, LIMIT_C);
    }
    leg
}

/// A host that moves a leg for some seconds; `believed` is the firmware's leg file, `motors` the plant's.
fn warm_up(motors: &LegFile, believed: &LegFile, seconds: f64) -> Result<Host, ToolError> {
    let mut base = moving(motors, context(believed)?)?;
    // No push may leave the following window.
    base.write_both(WINDOW, u32::MAX, 4)?;
    base.run(seconds as u64 * SECOND);
    Ok(base)
}

/// A strong push moves a joint beyond its range.
const PUSHED: Scope = Scope { torque: true, range: false, rotor_position: true };

pub(super) fn current(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let believed = warmed(leg, if blind { 1e-3 * KELVIN_PER_WATT } else { KELVIN_PER_WATT }, TIME_S);
    let base = warm_up(&warmed(leg, KELVIN_PER_WATT, TIME_S), &believed, 3.0 * TIME_S)?;
    forked_within(fault, leg, base, seeds, PUSHED, |fork| heats(fork, TOLERANCE_K))
}

pub(super) fn cooling(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let motors = warmed(leg, 2.0 * KELVIN_PER_WATT, 2.0 * TIME_S).with_thermistors();
    let believed = warmed(leg, KELVIN_PER_WATT, TIME_S);
    let believed = if blind { believed } else { believed.with_thermistors() };
    let base = warm_up(&motors, &believed, 4.0 * TIME_S)?;
    forked_within(fault, leg, base, seeds, PUSHED, |fork| heats(fork, LAGGING_K))
}

pub(super) fn thermistor(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let motors = leg.with_thermistors();
    let base = warm_up(&motors, if blind { leg } else { &motors }, 1.0)?;
    let scope = Scope { torque: true, range: true, rotor_position: true };
    forked_within(fault, leg, base, seeds, scope, fails)
}

/// T4.
fn fails(mut fork: Fork<'_>) -> Result<Outcome, ToolError> {
    let joint = fork.random.below(JOINTS as u64) as usize;
    let mut rail = |low: u16, high: u16| {
        Form::Rail(f64::from(low) + fork.random.below(u64::from(high - low) + 1) as f64)
    };
    let forms = [Form::Off, rail(0, SHORTED), rail(PARTIAL[0], PARTIAL[1]), rail(OPEN, 4095)];
    let form = forms[fork.random.below(4) as usize];
    let kind = fork.random.below(4);
    let (for_ever, alternates) = (kind < 2, kind == 2);
    let ms =
        if for_ever || alternates { f64::INFINITY } else { fork.random.uniform(10.0, 5.0 * THERMISTOR_MS) };
    let begun = fork.host.rig().period;
    let mut timing = Timing::lasting(begun, if ms.is_finite() { (ms / PERIOD_MS) as u64 } else { u64::MAX });
    if alternates {
        let reading = (THERMISTOR_MS / PERIOD_MS) as u64;
        (timing.on, timing.off) = (reading, reading);
    }
    fork.inject(Channel::MotorThermistor, joint, form, timing);
    let (state, after_ms) = fork.until(SECOND, Fork::safe_state).unzip();
    // Every other reading is bad: the fourth of them is the seventh reading.
    let intermittent_ms = alternates.then_some(fork.fault.deadline_ms + 4.0 * THERMISTOR_MS);
    let deadline_ms = intermittent_ms.unwrap_or(fork.fault.deadline_ms);
    let in_time = after_ms.is_some_and(|after| after <= deadline_ms + 1e-9);
    let (is_noise, may_be) = (ms < 2.0 * THERMISTOR_MS, ms < 3.0 * THERMISTOR_MS + PERIOD_MS);
    let alarm = fork.host.rig().alarm();
    let fault = fork.host.rig().state().fault();
    let is_right = state == Some("Damp")
        && fault.is_some_and(|fault| {
            (fault.code, usize::from(fault.joint)) == (FaultCode::MotorThermistor, joint)
        });
    let found = fork.ended(state, alarm.map(FaultCode::name));
    Ok(Outcome {
        detected: in_time && is_right && !is_noise,
        undetectable: state.is_none() && may_be,
        false_alarm: is_noise && state.is_some(),
        after_ms,
        intermittent_ms,
        magnitude: ms.is_finite().then_some(ms),
        ..found
    })
}

/// Joint of the plant's hottest winding, and its temperature, degrees Celsius.
fn hottest(fork: &mut Fork<'_>) -> (usize, f64) {
    let drives = fork.host.rig().world.complete_drives();
    let windings = drives.iter().flat_map(|drives| drives.axes()).map(|axis| axis.motor().temperature());
    windings.enumerate().fold((0, f64::MIN), |most, now| if now.1 > most.1 { now } else { most })
}

/// T2, T3.
fn heats(mut fork: Fork<'_>, tolerance_k: f64) -> Result<Outcome, ToolError> {
    let joint = fork.random.below(JOINTS as u64) as usize;
    let peak = fork.random.sign() * fork.random.uniform(20.0, 85.0);
    let seconds = fork.random.uniform(2.0, 10.0);
    fork.host.rig().world.push(joint, peak, seconds);
    let (mut most, mut limited_at) = (f64::MIN, None);
    for _ in 0..(seconds * SECOND as f64) as u64 + SECOND {
        fork.tick();
        let (hot, celsius) = hottest(&mut fork);
        most = most.max(celsius);
        if fork.host.rig().board.signals.winding_share(hot) < 1.0 && limited_at.is_none() {
            limited_at = Some(celsius);
        }
    }
    let undetectable = most < LIMIT_C - f64::from(RAMP_K);
    let in_time = limited_at.is_some_and(|celsius| celsius < LIMIT_C) && most <= LIMIT_C + tolerance_k;
    // A push beyond the range has an alarm of its own.
    let is_damped = fork.host.rig().alarm() == Some(FaultCode::WindingTemperature);
    let state = if is_damped { "Damp" } else { "Limit" };
    let alarm = is_damped.then(|| FaultCode::WindingTemperature.name());
    let found = fork.ended(in_time.then_some(state), alarm);
    Ok(Outcome { undetectable: undetectable && !in_time, magnitude: Some(most), ..found })
}
