//! The wearer, while the leg is moved.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::beside;
use super::super::rig::PERIODS_PER_S;
use super::{Bounds, Event, Expected, JOINTS, Row, Scenario};

/// Rows of this group.
pub static ROWS: [Row; 1] = [Row {
    id: "H1",
    fault: "wearer holds or pushes the leg",
    detector: "torque cap; speed",
    state: "Limit",
    codes: &[FaultCode::Overspeed],
    // Of torque above the cap, without a break.
    deadline_ms: 50.0,
    unit: "N m",
    lacking: None,
    draw: held,
}];

/// H1: a hand that holds a joint, or pushes it, for up to a second.
fn held(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let strength = dice.logarithmic(5.0, 300.0);
    let seconds = dice.uniform(0.1, 1.0);
    let event = if dice.coin() {
        Event::Hold(joint, strength, seconds)
    } else {
        Event::Push(joint, dice.sign() * strength.min(60.0), seconds)
    };
    let periods = ((seconds + 0.5) * PERIODS_PER_S as f64) as u64;
    Scenario { magnitude: Some(strength), patience: periods, ..beside(event, Expected::Kept) }
}
