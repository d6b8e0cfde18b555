//! Ticks that come late or not at all.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{at, one};
use super::{Bounds, Expected, JOINTS, Row, Scenario};
use crate::faults::{Channel, Form, Timing};

/// Rows of this group.
pub static ROWS: [Row; 1] = [Row {
    id: "K1",
    fault: "current ticks or the servo late or missed",
    detector: "time between ticks; the servo's counter",
    state: "Damp",
    codes: &[FaultCode::CurrentTicks, FaultCode::ServoTicks],
    deadline_ms: 1.0,
    unit: "",
    lacking: Some("a servo that does not answer cannot damp: Off"),
    draw: late_ticks,
}];

/// K1: current ticks missed now and then or at once, or the servo kept from its tick.
fn late_ticks(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    match dice.below(3) {
        // Every other tick; the third that is missed is one too many.
        0 => {
            let timing = Timing { begin: 0, duration: u64::MAX, on: 1, off: 1 };
            one(at(Channel::Tick, joint, Form::Off, timing), Expected::Damp)
        }
        // Time stolen at once.
        1 => {
            let gap = Timing::lasting(0, 3 + dice.below(10));
            one(at(Channel::Tick, joint, Form::Off, gap), Expected::Damp)
        }
        _ => one(at(Channel::Servo, 0, Form::Off, Timing::from(0)), Expected::Off),
    }
}
