//! E5: a motor that is wired otherwise than its axis was told. Its calibration has to refuse, before any torque is asked for.

use core::f64::consts::TAU;

use rayon::prelude::*;

use super::super::dice::Dice;
use super::super::entry::Head;
use super::super::run::Outcome;
use super::{Bench, outcome};
use crate::drive::description::EncoderWiring;
use crate::tool::board::{axis_configuration, calibration_settings, commission};
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::setup::SetupError;

pub(super) const BENCH: Bench = Bench {
    head: Head {
        id: "E5",
        fault: "phases, encoder or shunts connected wrongly, or not at all",
        detector: "checks of the calibration",
        state: "Refuse",
        deadline_ms: f64::INFINITY,
        unit: "",
        codes: &[],
        lacking: None,
    },
    run: calibrate,
};

/// Ways to connect an axis wrongly.
const WAYS: u64 = 11;

fn calibrate(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    seeds.par_iter().map(|seed| one(head, leg, *seed, blind)).collect()
}

fn one(head: &Head, leg: &LegFile, seed: u64, blind: bool) -> Result<Outcome, ToolError> {
    let mut dice = Dice::new(head.id, seed);
    let drives = leg.complete_description::<2>()?;
    let index = dice.below(drives.axes.len() as u64) as usize;
    let joint = &leg.joints[index];
    let motor =
        joint.motor.as_ref().ok_or_else(|| SetupError::new(leg, "a motor for every joint is needed"))?;
    let sound = drives.axes[index];
    let mut axis = sound;
    let wiring = &mut axis.wiring;
    match dice.below(WAYS) {
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
        // Checks that pass whatever they are shown.
        axis = sound;
    }
    let configuration = axis_configuration(joint, motor);
    let settings = calibration_settings(&configuration, motor);
    let angle = dice.uniform(0.0, TAU);
    let name = &joint.name;
    let passed = commission(name, &configuration, settings, &axis, &drives.supply, angle, seed).is_ok();
    Ok(outcome(head, seed, (!passed).then_some("Refuse")))
}
