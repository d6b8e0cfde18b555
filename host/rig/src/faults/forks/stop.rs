//! Emergency stop.

use hal_sim::faults::{Channel, Form, Timing};
use scarab_base::random::Random;

use crate::faults::draw::{at, one};
use crate::faults::scenario::{Bounds, Event, Expected, Onset, Scenario};
use crate::faulty_board::PERIODS_PER_S;
use scarab::model::planar::JOINTS;

/// X1: pressed for at most 10 ms; in half of the runs during damping or braking for another fault.
pub fn emergency_stop(random: &mut Random, _: &Bounds) -> Scenario {
    let lasting = 1 + random.below(PERIODS_PER_S / 100);
    let stop = |from| at(Channel::EmergencyStop, 0, Form::Off, Timing::lasting(from, lasting));
    let reacted = random.below(4);
    let joint = random.below(JOINTS as u64) as usize;
    // Damping lasts 300 ms.
    let later = 12 + random.below(PERIODS_PER_S * 3 / 10);
    let first = match reacted {
        // A broken thermistor is checked every 50 ms, a jumping encoder at once.
        0 => at(Channel::Thermistor, joint, Form::Rail(0.0), Timing::from(0)),
        1 => at(Channel::Counter, joint, Form::Offset(5e3), Timing::from(0)),
        _ => return one(stop(0), Expected::Released),
    };
    Scenario {
        injections: [Some(first), Some(stop(later))],
        onset: Onset::After(later),
        patience: PERIODS_PER_S,
        ..one(first, Expected::Released)
    }
}

/// X2: a contact that bounces for up to a second, with hands at the other contacts.
pub(super) fn bouncing_stop(random: &mut Random, _: &Bounds) -> Scenario {
    let lasting = 1 + random.below(PERIODS_PER_S);
    let (on, off) = (1 + random.below(200), 1 + random.below(200));
    let timing = Timing { begin: 0, duration: lasting, on, off };
    let bounce = at(Channel::EmergencyStop, 0, Form::Off, timing);
    Scenario { event: Event::Hands, ..one(bounce, Expected::Off) }
}
