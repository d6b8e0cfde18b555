//! Faults that the voltages of an axis show: a frozen counter, drifted current-sensor offsets, open phases.
//!
//! These faults are detectable in motion only ([`Onset::Driven`]). A run in which the joint does not turn for
//! the whole deadline proves nothing.

use hal_sim::faults::{Channel, Form, Timing};
use scarab_base::random::Random;

use crate::faults::draw::{AMPERE_PER_CODE, at, one};
use crate::faults::scenario::{Bounds, Event, Expected, Onset, Scenario};
use crate::faulty_board::PERIODS_PER_S;
use scarab::model::planar::JOINTS;

/// Time within which a joint must turn, and for which it must keep turning.
const PATIENCE: u64 = PERIODS_PER_S / 2;

/// E1: counter and index of a failed sensor.
pub(super) fn frozen(random: &mut Random, bounds: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let counter = at(Channel::Counter, joint, Form::Stuck, Timing::from(0));
    // Ten percent margin: the speed estimate has lag and ripple. Counts come in whole numbers: 4 or 5 a
    // period.
    let [speed, per_ampere] = bounds.frozen_speed.map(|speed| 1.1 * speed);
    let index = at(Channel::Index, joint, Form::Off, Timing::from(0));
    Scenario {
        injections: [Some(counter), Some(index)],
        // Any current.
        onset: Onset::Driven { speed, per_ampere, current: -1.0, sudden: 1.25 * bounds.stopped_speed },
        patience: PERIODS_PER_S,
        ..one(counter, Expected::Brake)
    }
}

/// C1: an offset step of up to 30 A.
pub(super) fn drift(random: &mut Random, bounds: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let size = random.logarithmic(0.5, 30.0);
    let channel = if random.coin() { Channel::ShuntB } else { Channel::ShuntC };
    let form = Form::Offset(random.sign() * size / AMPERE_PER_CODE);
    let offset = at(channel, joint, form, Timing::from(0));
    Scenario {
        // An electrical turn within half of the deadline: 0.9 rotor turns per second.
        onset: Onset::Driven {
            speed: bounds.judged_speed,
            per_ampere: 0.0,
            current: 0.0,
            sudden: f64::INFINITY,
        },
        magnitude: Some(size),
        by_design: size <= bounds.smallest_offset_a,
        patience: PATIENCE,
        ..one(offset, Expected::Off)
    }
}

/// P1: a broken wire.
pub(super) fn open_phase(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let output = random.below(3) as usize;
    // Inactive injection that selects the joint.
    let nothing = at(Channel::Index, joint, Form::Off, Timing::from(u64::MAX));
    Scenario {
        event: Event::OpenPhase(joint, output),
        onset: Onset::Driven { speed: 0.2, per_ampere: 0.0, current: 3.0, sudden: f64::INFINITY },
        patience: PATIENCE,
        ..one(nothing, Expected::Off)
    }
}
