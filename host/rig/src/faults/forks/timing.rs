//! Late and missing ticks.

use hal_sim::faults::{Channel, Form, Timing};
use scarab_base::random::Random;

use crate::faults::draw::{at, one};
use crate::faults::scenario::{Bounds, Event, Expected, Scenario};
use scarab::model::planar::JOINTS;

/// K3: hang of any level that checks in, or of both current loops, at any tick; the others continue.
pub(super) fn hang(random: &mut Random, _: &Bounds) -> Scenario {
    let hung = |channel, joint| at(channel, joint, Form::Off, Timing::from(0));
    let (first, second) = match random.below(5) {
        joint @ 0..=1 => (hung(Channel::Tick, joint as usize), None),
        2 => (hung(Channel::Servo, 0), None),
        3 => (hung(Channel::Housekeeping, 0), None),
        // The converter that triggers both current loops.
        _ => (hung(Channel::Tick, 0), Some(hung(Channel::Tick, 1))),
    };
    let event = Event::Oscillator(random.uniform(17e3, 47e3));
    Scenario { event, injections: [Some(first), second], ..one(first, Expected::Restarted) }
}

/// K1: current ticks missed intermittently or in a row, or a servo without ticks.
pub(super) fn late_ticks(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    match random.below(3) {
        // Every other tick; the third missed one is a fault.
        0 => {
            let timing = Timing { begin: 0, duration: u64::MAX, on: 1, off: 1 };
            one(at(Channel::Tick, joint, Form::Off, timing), Expected::Damp)
        }
        // A gap in the ticks of one axis, which the other one detects.
        1 => {
            let gap = Timing::lasting(0, 3 + random.below(10));
            one(at(Channel::Tick, joint, Form::Off, gap), Expected::Off)
        }
        _ => one(at(Channel::Servo, 0, Form::Off, Timing::from(0)), Expected::Off),
    }
}
