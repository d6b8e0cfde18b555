//! Values changed by bit flips in memory.

use scarab::motor::Axis;
use scarab::servo::Servo;
use scarab_base::random::Random;

use crate::faults::draw::beside;
use crate::faults::scenario::{Bounds, Event, Expected, Scenario};
use crate::faulty_board::PERIODS_PER_S;
use scarab::model::planar::JOINTS;

/// M2: any bit of any of the accessible values.
pub(super) fn upset(random: &mut Random, _: &Bounds) -> Scenario {
    let of_axis = random.coin();
    let joint = random.below(JOINTS as u64) as usize;
    let numbers = if of_axis { Axis::NUMBERS } else { Servo::<JOINTS>::NUMBERS };
    let number = random.below(u64::from(numbers)) as u8;
    let event = Event::Upset { of_axis, joint, number, bit: random.below(32) as u8 };
    Scenario { patience: PERIODS_PER_S / 5, ..beside(event, Expected::Damp) }
}
