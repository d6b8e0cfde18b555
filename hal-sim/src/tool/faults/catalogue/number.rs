//! What is no number.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{at, one};
use super::super::rig::PERIOD_MS;
use super::{Bounds, Event, Expected, JOINTS, Onset, Row, Scenario};
use crate::faults::{Channel, Form, Timing};

/// Rows of this group.
pub static ROWS: [Row; 1] = [Row {
    id: "N1",
    fault: "NaN or infinity in a sample, a target or the modulation",
    detector: "borders of the servo and of the axis",
    state: "Off",
    codes: &[FaultCode::NotFinite],
    deadline_ms: PERIOD_MS,
    unit: "",
    lacking: Some("fitness, which no port reaches (I1)"),
    draw: not_finite,
}];

/// N1: what is no number, between axis and servo in either direction, or in what an axis modulates with.
fn not_finite(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let value = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][dice.below(3) as usize];
    if dice.below(4) == 0 {
        // Spoils nothing; says which joint.
        let nothing = at(Channel::Index, joint, Form::Off, Timing::from(u64::MAX));
        return Scenario { event: Event::Modulation(joint), ..one(nothing, Expected::Off) };
    }
    let channel = if dice.coin() { Channel::JointCurrent } else { Channel::Target };
    let spoilt = at(channel, joint, Form::Rail(value), Timing::from(0));
    Scenario { onset: Onset::ServoTick, ..one(spoilt, Expected::Off) }
}
