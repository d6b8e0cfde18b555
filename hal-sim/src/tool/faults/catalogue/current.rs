//! Shunts, their conversions, gate drivers, phases.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{AMPERE_PER_CODE, at, now_and_then, one};
use super::super::rig::{PERIOD_MS, PERIODS_PER_S};
use super::{Bounds, Expected, JOINTS, Onset, Row, Scenario};
use crate::faults::{Channel, Form, Timing};

/// Rows of this group.
pub static ROWS: [Row; 3] = [
    Row {
        id: "C2",
        fault: "shunt amplifier or converter at its rail",
        detector: "code near the rails twice",
        state: "Off",
        codes: &[FaultCode::CurrentSense],
        deadline_ms: 2.0 * PERIOD_MS,
        unit: "",
        lacking: None,
        draw: rail,
    },
    Row {
        id: "C3",
        fault: "conversion stuck or missing",
        detector: "same code while another current is asked for; ends of conversion, of shunts and of the supply's",
        state: "Off",
        codes: &[FaultCode::Conversion, FaultCode::StuckConversion, FaultCode::CurrentZero],
        // Of one that is stuck; a missing one is seen in its own tick.
        deadline_ms: 4.0 * PERIOD_MS,
        unit: "",
        lacking: None,
        draw: conversion,
    },
    Row {
        id: "C4",
        fault: "overcurrent, gate driver's fault",
        detector: "length of the current vector; pin",
        state: "Off",
        codes: &[FaultCode::Overcurrent, FaultCode::GateFault],
        deadline_ms: PERIOD_MS,
        unit: "A",
        lacking: None,
        draw: overcurrent,
    },
];

/// C2: a code at a rail of amplifier or converter.
fn rail(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let channel = if dice.coin() { Channel::ShuntB } else { Channel::ShuntC };
    // Of the amplifier or of the converter, low or high.
    let value = [0.0, 186.0, 3910.0, 4095.0][dice.below(4) as usize];
    now_and_then(dice, one(at(channel, joint, Form::Rail(value), Timing::from(0)), Expected::Off))
}

/// C3: conversions that do not end, or say the same for ever.
fn conversion(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let way = dice.below(5);
    if way == 0 {
        // Of bus voltage and thermistors: told at the second.
        let lasting = 1 + dice.below(4);
        let missing = at(Channel::SupplyConversion, 0, Form::Off, Timing::lasting(0, lasting));
        return Scenario { by_design: lasting == 1, ..one(missing, Expected::Off) };
    }
    if way < 3 {
        let channel = if dice.coin() { Channel::ShuntB } else { Channel::ShuntC };
        let stuck = at(channel, joint, Form::Stuck, Timing::from(0));
        return Scenario {
            // What has to show, and the tenth that rotor and estimate may be apart.
            onset: Onset::Asked(1.1 * bounds.stuck_a),
            patience: PERIODS_PER_S / 2,
            ..one(stuck, Expected::Off)
        };
    }
    let lasting = 1 + dice.below(4);
    let missing = at(Channel::Conversion, joint, Form::Off, Timing::lasting(0, lasting));
    Scenario { within_ms: Some(PERIOD_MS), ..one(missing, Expected::Off) }
}

/// C4: more current than the bound, or the gate driver's pin.
fn overcurrent(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    if dice.below(2) == 0 {
        return one(at(Channel::GateFault, 0, Form::Off, Timing::from(0)), Expected::Off);
    }
    let joint = dice.below(JOINTS as u64) as usize;
    // All of it in one phase, which leaves half of it to each of the others: a vector of that length.
    let current = bounds.overcurrent_a * dice.uniform(0.9, 1.08);
    let codes = dice.sign() * current / AMPERE_PER_CODE;
    let shares = if dice.coin() { [1.0, -0.5] } else { [-0.5, 1.0] };
    let shunt = |channel, share| at(channel, joint, Form::Rail(2048.0 + codes * share), Timing::from(0));
    let [b, c] = shares;
    Scenario {
        injections: [Some(shunt(Channel::ShuntB, b)), Some(shunt(Channel::ShuntC, c))],
        magnitude: Some(current),
        // The shunts' zeros lie up to 12 codes off, half an ampere.
        by_design: current < bounds.overcurrent_a + 0.6,
        ..one(shunt(Channel::ShuntB, b), Expected::Off)
    }
}
