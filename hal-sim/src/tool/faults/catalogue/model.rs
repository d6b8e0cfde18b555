//! What the voltages of an axis give away: a frozen counter, drifted zeros, open phases.
//!
//! These faults are only to be seen in motion ([`Onset::Driven`]): a run in which the joint does not go on turning for the whole deadline shows
//! nothing that could be seen.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{AMPERE_PER_CODE, at, one};
use super::super::rig::PERIODS_PER_S;
use super::{Bounds, Event, Expected, JOINTS, Onset, Row, Scenario};
use crate::faults::{Channel, Form, Timing};

/// Rows of this group.
pub static ROWS: [Row; 3] = [
    Row {
        id: "E1",
        fault: "encoder frozen while moving",
        detector: "back-EMF against counts, or counts that stand still while the current changes by half of its limit; 8 and 16 ms",
        state: "Short",
        codes: &[FaultCode::EncoderFrozen],
        deadline_ms: 20.0,
        unit: "",
        lacking: Some(
            "slower than back-EMF outweighs dead time and resistance, while the current changes by less than half of its limit",
        ),
        draw: frozen,
    },
    Row {
        id: "C1",
        fault: "current offset drifts",
        detector: "mean of the residual over an electrical turn",
        state: "Refuse / Off",
        codes: &[FaultCode::CurrentZero, FaultCode::OpenPhase, FaultCode::Overcurrent],
        deadline_ms: 50.0,
        unit: "A",
        lacking: Some("small offsets while the joint moves; below 2 A of the vector when arming"),
        draw: drift,
    },
    Row {
        id: "P1",
        fault: "one phase open",
        detector: "voltage without current, 8 ms",
        state: "Off",
        codes: &[
            FaultCode::OpenPhase,
            FaultCode::CurrentZero,
            FaultCode::EncoderFrozen,
            FaultCode::Overcurrent,
        ],
        deadline_ms: 50.0,
        unit: "",
        lacking: Some("while nothing is asked of the motor"),
        draw: open_phase,
    },
];

/// Time in which a joint has to come to turn, and to go on turning.
const PATIENCE: u64 = PERIODS_PER_S / 2;

/// E1: counter and index of a sensor that died.
fn frozen(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let counter = at(Channel::Counter, joint, Form::Stuck, Timing::from(0));
    // A tenth more: the speed has to be followed, and ripples.
    let [speed, per_ampere] = bounds.frozen_speed.map(|speed| 1.1 * speed);
    let index = at(Channel::Index, joint, Form::Off, Timing::from(0));
    Scenario {
        injections: [Some(counter), Some(index)],
        // What is measured follows what is asked for to 5 %.
        onset: Onset::Uncounted { speed, per_ampere, swing: 1.05 * bounds.frozen_swing_a + 0.5 },
        patience: PERIODS_PER_S,
        ..one(counter, Expected::Brake)
    }
}

/// C1: up to 30 A at once.
fn drift(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let size = dice.logarithmic(0.5, 30.0);
    let channel = if dice.coin() { Channel::ShuntB } else { Channel::ShuntC };
    let form = Form::Offset(dice.sign() * size / AMPERE_PER_CODE);
    let offset = at(channel, joint, form, Timing::from(0));
    Scenario {
        // An electrical turn in less than half of the deadline: 0.9 of a turn of the rotor in a second.
        onset: Onset::Driven { speed: bounds.judged_speed, per_ampere: 0.0, current: 0.0 },
        magnitude: Some(size),
        by_design: size <= bounds.smallest_offset_a,
        patience: PATIENCE,
        ..one(offset, Expected::Off)
    }
}

/// P1: a wire that breaks.
fn open_phase(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let output = dice.below(3) as usize;
    // Spoils nothing; says which joint.
    let nothing = at(Channel::Index, joint, Form::Off, Timing::from(u64::MAX));
    Scenario {
        event: Event::OpenPhase(joint, output),
        onset: Onset::Driven { speed: 0.2, per_ampere: 0.0, current: 3.0 },
        patience: PATIENCE,
        ..one(nothing, Expected::Off)
    }
}
