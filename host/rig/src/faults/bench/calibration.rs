//! E5: a motor that is wired differently from its axis' configuration, or comes loose during calibration. Its
//! calibration must refuse before any torque is requested.
//!
//! In two of five runs a phase wire, the encoder or a shunt breaks at a tick of the calibration. A passed
//! calibration counts as missed if its result differs from that of an intact motor. Otherwise the result is
//! usable, and the running axis detects the broken part (P1, E1, C1 to C3).

use core::f64::consts::TAU;

use hal_sim::drive::description::{AxisDescription, EncoderWiring, SupplyDescription};
use hal_sim::drive::stand::Stand;
use hal_sim::faults::{Channel, Form, Injection, Injector, Timing};
use rayon::prelude::*;
use scarab::motor::{AxisConfiguration, Calibration, Calibrator};
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::{JointFile, LegFile, MotorFile};
use scarab_identify::leg::board_words::axis_error;

use crate::board::{
    LONGEST_CALIBRATION, axis_configuration, calibration_settings, commission, rested, run_calibration,
};
use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::Fault;
use crate::faults::draw::AMPERE_PER_CODE;
use crate::faults::run::Outcome;
use scarab::model::planar::JOINTS;

/// Message about a leg that these rows cannot run.
pub(super) const UNFIT: &str = "every joint needs a motor that can be calibrated";

/// Motor of a joint at rest on a test stand, its calibration and its axis.
pub(super) fn on_stand(
    leg: &LegFile,
    index: usize,
    seed: u64,
) -> Result<(Stand, Calibrator, AxisConfiguration), ToolError> {
    let unfit = || leg.error(UNFIT);
    let drives = leg.complete_description::<JOINTS>()?;
    let joint = &leg.joints[index];
    let motor = joint.motor.as_ref().ok_or_else(unfit)?;
    let configuration = axis_configuration(joint, motor);
    let settings = calibration_settings(&configuration, motor);
    let stand = rested(&drives.axes[index], &drives.supply, TAU * 0.3, seed);
    Ok((stand, Calibrator::new(&configuration, settings).map_err(|_| unfit())?, configuration))
}

/// Number of ways to connect an axis wrongly.
const WAYS: u64 = 11;

pub(super) fn calibrate(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    seeds.par_iter().map(|seed| one(fault, leg, *seed, blind)).collect()
}

fn one(fault: &Fault, leg: &LegFile, seed: u64, blind: bool) -> Result<Outcome, ToolError> {
    let mut random = Random::new(fault.id, seed);
    let drives = leg.complete_description::<2>()?;
    let index = random.below(drives.axes.len() as u64) as usize;
    let joint = &leg.joints[index];
    let motor =
        joint.motor.as_ref().ok_or_else(|| leg.error("every joint needs a motor (`[joint.motor]`)"))?;
    if random.below(5) < 2 {
        return loose(fault, joint, motor, &drives.axes[index], &drives.supply, seed, &mut random, blind);
    }
    let sound = drives.axes[index];
    let mut axis = sound;
    let wiring = &mut axis.wiring;
    match random.below(WAYS) {
        0 => wiring.phases.swap(0, 1),
        1 => wiring.phases.swap(1, 2),
        2 => wiring.phases.swap(0, 2),
        3 => {
            wiring.encoder = match wiring.encoder {
                EncoderWiring::Reversed => EncoderWiring::Forward,
                _ => EncoderWiring::Reversed,
            };
        }
        4 => wiring.encoder = EncoderWiring::Missing,
        way @ 5..=7 => wiring.open = Some(way as usize - 5),
        8 => wiring.shunts_exchanged = true,
        way => wiring.shunts_inverted[way as usize - 9] = true,
    }
    if blind {
        // Blind: the checks pass for every motor.
        axis = sound;
    }
    let configuration = axis_configuration(joint, motor);
    let settings = calibration_settings(&configuration, motor);
    let angle = random.uniform(0.0, TAU);
    let name = &joint.name;
    let passed = commission(name, &configuration, settings, &axis, &drives.supply, angle, seed).is_ok();
    Ok(outcome(fault, seed, (!passed).then_some("Refuse")))
}

/// Loose part.
enum Loose {
    Wire(usize),
    Reading(Injection),
}

/// Runs a calibration in which a part becomes loose at a tick.
#[expect(clippy::too_many_arguments, reason = "a motor, its surroundings, and how the run is done")]
fn loose(
    fault: &Fault,
    joint: &JointFile,
    motor: &MotorFile,
    axis: &AxisDescription,
    supply: &SupplyDescription,
    seed: u64,
    random: &mut Random,
    blind: bool,
) -> Result<Outcome, ToolError> {
    let configuration = axis_configuration(joint, motor);
    let settings = calibration_settings(&configuration, motor);
    let angle = random.uniform(0.0, TAU);
    let measure = |loose: Option<(u64, &Loose)>| -> Result<(u64, Option<Calibration>), ToolError> {
        let mut stand = rested(axis, supply, angle, seed);
        let mut injector = Injector::new(seed);
        if let Some((_, Loose::Reading(injection))) = loose {
            injector.add(*injection);
        }
        let mut calibrator =
            Calibrator::new(&configuration, settings).map_err(|error| ToolError::input(axis_error(error)))?;
        let ended = run_calibration(&mut calibrator, |tick, command| {
            if let Some((at, Loose::Wire(output))) = loose
                && at == tick
            {
                stand.break_wire(*output);
            }
            let mut sample = stand.period(command, 0.0);
            injector.sample(0, tick, &mut sample);
            sample
        });
        Ok(ended.map_or((LONGEST_CALIBRATION, None), |(tick, result)| (tick, result.ok())))
    };
    let (length, sound) = measure(None)?;
    let at = random.below(length);
    let shunt = if random.coin() { Channel::ShuntB } else { Channel::ShuntC };
    let reading =
        |channel, form| Loose::Reading(Injection { channel, joint: 0, form, timing: Timing::from(at) });
    let loose = match random.below(6) {
        output @ 0..=2 => Loose::Wire(output as usize),
        3 => reading(Channel::Counter, Form::Stuck),
        4 => reading(shunt, Form::Stuck),
        _ => reading(shunt, Form::Offset(random.sign() * random.uniform(5.0, 60.0) / AMPERE_PER_CODE)),
    };
    // Blind: the checks pass for every motor.
    let (_, found) = if blind { (at, sound) } else { measure(Some((at, &loose)))? };
    let is_right = found.zip(sound).is_some_and(|(found, sound)| is_like(&found, &sound));
    let mut result = outcome(fault, seed, found.is_none().then_some("Refuse"));
    result.period = at;
    result.undetectable = is_right && !blind;
    Ok(result)
}

/// Returns whether two calibrations agree within the tolerance of a running axis: 5 electrical degrees, 1 A
/// of offset, a fifth of the resistance.
fn is_like(found: &Calibration, sound: &Calibration) -> bool {
    let turns = (found.offset().turns() - sound.offset().turns()).rem_euclid(1.0);
    let mut zeros = found.current_offsets().into_iter().zip(sound.current_offsets());
    let resistance = found.resistance().0 / sound.resistance().0;
    turns.min(1.0 - turns) < 5.0 / 360.0
        && zeros.all(|(found, sound)| f64::from(found - sound).abs() * AMPERE_PER_CODE < 1.0)
        && (0.8..1.25).contains(&resistance)
}
