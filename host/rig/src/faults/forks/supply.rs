//! Bus voltage and its supply.

use hal_sim::faults::{Channel, Form, Timing};
use scarab_base::random::Random;

use crate::faults::draw::{VOLT_PER_CODE, at, now_and_then, one};
use crate::faults::scenario::{Bounds, Event, Expected, Onset, Scenario};
use crate::faulty_board::PERIODS_PER_S;

/// V1: a wrong reading, or a pushing supply without a brake resistor.
pub(super) fn overvoltage(random: &mut Random, bounds: &Bounds) -> Scenario {
    let [_, high] = bounds.bus_v;
    if random.below(2) == 0 {
        let volts = random.uniform(high + 0.2, 62.0);
        let code = volts / VOLT_PER_CODE;
        let bus = at(Channel::Bus, 0, Form::Rail(code), Timing::from(0));
        return Scenario { magnitude: Some(volts - high), ..now_and_then(random, one(bus, Expected::Off)) };
    }
    // The leg returns energy while the resistor is absent and the supply pushes.
    let volts = random.uniform(high + 2.0, 75.0);
    let absent = at(Channel::Brake, 0, Form::Off, Timing::from(0));
    Scenario {
        event: Event::Supply(volts),
        onset: Onset::BusAbove(high + 0.1),
        magnitude: Some(volts - high),
        ..one(absent, Expected::Off)
    }
}

/// V2: a wrong reading, or a supply that is cut or too weak.
pub(super) fn undervoltage(random: &mut Random, bounds: &Bounds) -> Scenario {
    let [low, _] = bounds.bus_v;
    let volts = random.uniform(0.0, low - 0.5);
    if random.below(2) == 0 {
        let code = volts / VOLT_PER_CODE;
        let bus = at(Channel::Bus, 0, Form::Rail(code), Timing::from(0));
        return Scenario { magnitude: Some(low - volts), ..one(bus, Expected::Off) };
    }
    Scenario {
        injections: [None; 2],
        event: Event::Supply(volts),
        onset: Onset::BusBelow(low - 0.1),
        magnitude: Some(low - volts),
        patience: 20 * PERIODS_PER_S,
        ..one(at(Channel::Bus, 0, Form::Off, Timing::from(u64::MAX)), Expected::Damped)
    }
}
