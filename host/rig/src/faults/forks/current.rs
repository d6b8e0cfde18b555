//! Shunts, their conversions, gate drivers, phases.

use hal_sim::faults::{Channel, Form, Timing};
use scarab_base::random::Random;

use crate::faults::draw::{AMPERE_PER_CODE, at, now_and_then, one};
use crate::faults::scenario::{Bounds, Expected, Onset, Scenario};
use crate::faulty_board::{PERIOD_MS, PERIODS_PER_S};
use scarab::model::planar::JOINTS;

/// C2: a code at a rail of amplifier or converter.
pub(super) fn rail(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let channel = if random.coin() { Channel::ShuntB } else { Channel::ShuntC };
    // Rails of the amplifier or of the converter, low or high.
    let value = [0.0, 186.0, 3910.0, 4095.0][random.below(4) as usize];
    now_and_then(random, one(at(channel, joint, Form::Rail(value), Timing::from(0)), Expected::Off))
}

/// C3: conversions that do not end, or always return the same code.
pub(super) fn conversion(random: &mut Random, bounds: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let way = random.below(5);
    if way == 0 {
        // Conversions of bus voltage and thermistors: reported at the second missing one.
        let lasting = 1 + random.below(4);
        let missing = at(Channel::SupplyConversion, 0, Form::Off, Timing::lasting(0, lasting));
        return Scenario { by_design: lasting == 1, ..one(missing, Expected::Off) };
    }
    if way < 3 {
        let channel = if random.coin() { Channel::ShuntB } else { Channel::ShuntC };
        let stuck = at(channel, joint, Form::Stuck, Timing::from(0));
        return Scenario {
            // Detection threshold, with 10 % for the deviation of rotor and estimate.
            onset: Onset::Requested(1.1 * bounds.stuck_a),
            patience: PERIODS_PER_S / 2,
            ..one(stuck, Expected::Off)
        };
    }
    let lasting = 1 + random.below(4);
    let missing = at(Channel::Conversion, joint, Form::Off, Timing::lasting(0, lasting));
    Scenario { within_ms: Some(PERIOD_MS), ..one(missing, Expected::Off) }
}

/// C4: current above the bound, or the gate driver's pin.
pub(super) fn overcurrent(random: &mut Random, bounds: &Bounds) -> Scenario {
    if random.below(2) == 0 {
        return one(at(Channel::GateFault, 0, Form::Off, Timing::from(0)), Expected::Off);
    }
    let joint = random.below(JOINTS as u64) as usize;
    // A vector of this length: the whole current in one phase, half of it in each of the others.
    let current = bounds.overcurrent_a * random.uniform(0.9, 1.08);
    let codes = random.sign() * current / AMPERE_PER_CODE;
    let shares = if random.coin() { [1.0, -0.5] } else { [-0.5, 1.0] };
    let shunt = |channel, share| at(channel, joint, Form::Rail(2048.0 + codes * share), Timing::from(0));
    let [b, c] = shares;
    Scenario {
        injections: [Some(shunt(Channel::ShuntB, b)), Some(shunt(Channel::ShuntC, c))],
        magnitude: Some(current),
        // The shunts' offsets are up to 12 codes, half an ampere.
        by_design: current < bounds.overcurrent_a + 0.6,
        ..one(shunt(Channel::ShuntB, b), Expected::Off)
    }
}
