//! Values that are not finite.

use hal_sim::faults::{Channel, Form, Timing};
use scarab_base::random::Random;

use crate::faults::draw::{at, one};
use crate::faults::scenario::{Bounds, Event, Expected, Onset, Scenario};
use scarab::model::planar::JOINTS;

/// N1: NaN or infinity between axis and servo in either direction, or in the values of an axis' modulation.
pub(super) fn not_finite(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let value = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][random.below(3) as usize];
    if random.below(4) == 0 {
        // Inactive injection that selects the joint.
        let nothing = at(Channel::Index, joint, Form::Off, Timing::from(u64::MAX));
        return Scenario { event: Event::Modulation(joint), ..one(nothing, Expected::Off) };
    }
    let channel = if random.coin() { Channel::JointCurrent } else { Channel::Target };
    let spoilt = at(channel, joint, Form::Rail(value), Timing::from(0));
    Scenario { onset: Onset::ServoTick, ..one(spoilt, Expected::Off) }
}
