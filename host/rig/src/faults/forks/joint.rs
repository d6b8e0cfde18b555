//! Joints at their limits.

use hal_sim::faults::{Channel, Form, Timing};
use scarab_base::random::Random;

use crate::faults::draw::{at, beside, one};
use crate::faults::scenario::{Bounds, Event, Expected, Onset, Scenario};
use crate::faulty_board::PERIODS_PER_S;
use scarab::model::planar::JOINTS;

/// J1: a push towards either end of the range, limited to the drive's torque left beside the leg's weight.
pub(super) fn pushed(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let peak = random.logarithmic(10.0, 70.0);
    let seconds = random.uniform(0.2, 1.0);
    let push = Event::Push(joint, random.sign() * peak, seconds);
    let periods = ((seconds + 0.3) * PERIODS_PER_S as f64) as u64;
    Scenario { magnitude: Some(peak), patience: periods, ..beside(push, Expected::Kept) }
}

/// J2: a kick.
pub(super) fn overspeed(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let peak = random.logarithmic(200.0, 900.0);
    let kick = Event::Kick(joint, random.sign() * peak, random.uniform(0.06, 0.2));
    Scenario {
        injections: [None; 2],
        event: kick,
        onset: Onset::Speed(1.1),
        magnitude: Some(peak),
        patience: PERIODS_PER_S / 4,
        ..one(at(Channel::Bus, 0, Form::Off, Timing::from(u64::MAX)), Expected::Damp)
    }
}
