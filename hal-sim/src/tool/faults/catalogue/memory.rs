//! Numbers that change in memory although nobody changes them.

use scarab::motor::Axis;
use scarab::safety::FaultCode;
use scarab::servo::Servo;

use super::super::dice::Dice;
use super::super::draw::beside;
use super::super::rig::PERIODS_PER_S;
use super::{Bounds, Event, Expected, JOINTS, Row, Scenario};

/// Rows of this group.
pub static ROWS: [Row; 1] = [Row {
    id: "M2",
    fault: "a bit flips in gains or limits of an axis or the servo",
    detector: "sum over them, every 64 ms",
    state: "Damp",
    codes: &[FaultCode::Parameters],
    deadline_ms: 100.0,
    unit: "",
    lacking: Some("motions, models and filters, which are not summed up"),
    draw: upset,
}];

/// M2: any bit of any of the numbers that can be upset.
fn upset(dice: &mut Dice, _: &Bounds) -> Scenario {
    let of_axis = dice.coin();
    let joint = dice.below(JOINTS as u64) as usize;
    let numbers = if of_axis { Axis::NUMBERS } else { Servo::<JOINTS>::NUMBERS };
    let number = dice.below(u64::from(numbers)) as u8;
    let event = Event::Upset { of_axis, joint, number, bit: dice.below(32) as u8 };
    Scenario { patience: PERIODS_PER_S / 5, ..beside(event, Expected::Damp) }
}
