//! Wearer during the motion.

use scarab_base::random::Random;

use crate::faults::draw::beside;
use crate::faults::scenario::{Bounds, Event, Expected, Scenario};
use crate::faulty_board::PERIODS_PER_S;
use scarab::model::planar::JOINTS;

/// H1: a hand holds or pushes a joint for up to a second.
pub(super) fn held(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let strength = random.logarithmic(5.0, 300.0);
    let seconds = random.uniform(0.1, 1.0);
    let event = if random.coin() {
        Event::Hold(joint, strength, seconds)
    } else {
        Event::Push(joint, random.sign() * strength.min(60.0), seconds)
    };
    let periods = ((seconds + 0.5) * PERIODS_PER_S as f64) as u64;
    Scenario { magnitude: Some(strength), patience: periods, ..beside(event, Expected::Kept) }
}
