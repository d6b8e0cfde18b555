//! Encoders.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{at, one};
use super::super::rig::{PERIOD_MS, PERIODS_PER_S};
use super::{Bounds, Expected, JOINTS, Onset, Row, Scenario};
use crate::faults::{Channel, Form, Injection, Timing};

/// Rows of this group.
pub static ROWS: [Row; 2] = [
    Row {
        id: "E2",
        fault: "wrong reading of an encoder, one or three in 10 ms",
        detector: "greatest step per tick: the duties of the tick before are kept; three in 10 ms in the servo",
        state: "Limit, Damp",
        codes: &[FaultCode::EncoderStep],
        // The servo's next tick.
        deadline_ms: 7.0 * PERIOD_MS,
        unit: "counts",
        lacking: None,
        draw: glitch,
    },
    Row {
        id: "E4",
        fault: "lost counts, no index",
        detector: "index against counts, two turns without an index; greatest step",
        state: "Damp",
        codes: &[FaultCode::EncoderPlace],
        deadline_ms: f64::INFINITY,
        unit: "counts",
        lacking: Some("braked (Short) instead of damped, since the rotor's angle is lost with the counts"),
        draw: lost_counts,
    },
];

/// E2: one wrong reading of a counter, or three in 10 ms.
fn glitch(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let size = dice.logarithmic(2.0, 32_767.0).round();
    let sign = dice.sign();
    let offset = at(Channel::Counter, joint, Form::Offset(sign * size), Timing::lasting(0, 1));
    // A joint at its limit makes half of the greatest step by itself, so a glitch may be that much nearer.
    let by_design = size <= 1.5 * f64::from(bounds.greatest_step[1]);
    if dice.coin() {
        return Scenario { magnitude: Some(size), by_design, ..one(offset, Expected::Rejected) };
    }
    // Three within 10 ms, each in another servo tick.
    let apart = 6 + dice.below(112);
    let timing = Timing { begin: 0, duration: 2 * apart + 1, on: 1, off: apart - 1 };
    Scenario {
        injections: [Some(Injection { timing, ..offset }), None],
        onset: Onset::After(2 * apart),
        magnitude: Some(size),
        by_design,
        ..one(offset, Expected::Damp)
    }
}

/// E4: a counter that lost counts, or won some.
fn lost_counts(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    if dice.below(4) == 0 {
        // The index does not come any more: told after two turns and an eighth from where it came last.
        let gone = at(Channel::Index, joint, Form::Off, Timing::from(0));
        return Scenario { patience: 4 * PERIODS_PER_S, turns: 3.3, ..one(gone, Expected::Brake) };
    }
    let size = dice.logarithmic(1.0, 0.25 * f64::from(bounds.counts_per_turn)).round();
    let offset = at(Channel::Counter, joint, Form::Offset(dice.sign() * size), Timing::from(0));
    // 4 counts of index, and the way within a quarter of a period.
    let by_design = size <= 4.0 + f64::from(bounds.greatest_step[1]) / 4.0;
    Scenario {
        magnitude: Some(size),
        by_design,
        // A turn of the rotor: seen when the index comes, if the leg moves that far.
        onset: Onset::Injection,
        patience: 2 * PERIODS_PER_S,
        ..one(offset, Expected::Brake)
    }
}
