//! What is drawn for one run of each row: shape, joint, magnitude.
//!
//! Magnitudes go from nothing to all that the channel can show. What lies below a detector's threshold is told apart beforehand,
//! from the numbers the firmware is set to ([`Bounds`]), never from the outcome.

use super::catalogue::{Bounds, Event, Expected, JOINTS, Onset, Scenario};
use super::dice::Dice;
use super::rig::PERIODS_PER_S;
use crate::faults::{Channel, Form, Injection, Timing};

/// Of the board's shunts and converter.
const AMPERE_PER_CODE: f64 = 0.040_283;
/// Of the bus voltage's divider.
const VOLT_PER_CODE: f64 = 3.3 * 19.0 / 4096.0;

const fn at(channel: Channel, joint: usize, form: Form, timing: Timing) -> Injection {
    Injection { channel, joint, form, timing }
}

const fn one(injection: Injection, expected: Expected) -> Scenario {
    Scenario {
        injections: [Some(injection), None],
        event: Event::None,
        onset: Onset::Injection,
        expected,
        magnitude: None,
        by_design: false,
        patience: PERIODS_PER_S / 10,
    }
}

/// E2: one wrong reading of a counter, or three in 10 ms.
#[must_use]
pub fn glitch(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let size = dice.logarithmic(2.0, 32_767.0).round();
    let sign = dice.sign();
    let offset = at(Channel::Counter, joint, Form::Offset(sign * size), Timing::lasting(0, 1));
    // A joint at its limit makes half of the greatest step by itself, so a glitch may be that much nearer.
    let by_design = size <= 1.5 * f64::from(bounds.greatest_step[1]);
    if dice.coin() {
        return Scenario { magnitude: Some(size), by_design, ..one(offset, Expected::Rejected) };
    }
    // Three within 10 ms, each in another servo tick.
    let apart = 6 + dice.below(112);
    let timing = Timing { begin: 0, duration: 2 * apart + 1, on: 1, off: apart - 1 };
    Scenario {
        injections: [Some(Injection { timing, ..offset }), None],
        onset: Onset::After(2 * apart),
        magnitude: Some(size),
        by_design,
        ..one(offset, Expected::Damp)
    }
}

/// E4: a counter that lost counts, or won some.
#[must_use]
pub fn lost_counts(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let size = dice.logarithmic(1.0, 0.25 * f64::from(bounds.counts_per_turn)).round();
    let offset = at(Channel::Counter, joint, Form::Offset(dice.sign() * size), Timing::from(0));
    // 4 counts of index, and the way within a quarter of a period.
    let by_design = size <= 4.0 + f64::from(bounds.greatest_step[1]) / 4.0;
    Scenario {
        magnitude: Some(size),
        by_design,
        // A turn of the rotor: seen when the index comes, if the leg moves that far.
        onset: Onset::Injection,
        patience: 2 * PERIODS_PER_S,
        ..one(offset, Expected::Off)
    }
}

/// C2: a code at a rail of amplifier or converter.
#[must_use]
pub fn rail(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let channel = if dice.coin() { Channel::ShuntB } else { Channel::ShuntC };
    // Of the amplifier or of the converter, low or high.
    let value = [0.0, 186.0, 3910.0, 4095.0][dice.below(4) as usize];
    one(at(channel, joint, Form::Rail(value), Timing::from(0)), Expected::Off)
}

/// C3: conversions that do not end.
#[must_use]
pub fn conversion(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let lasting = 1 + dice.below(4);
    one(at(Channel::Conversion, joint, Form::Off, Timing::lasting(0, lasting)), Expected::Off)
}

/// C4: more current than the bound, or the gate driver's pin.
#[must_use]
pub fn overcurrent(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    if dice.below(2) == 0 {
        return one(at(Channel::GateFault, 0, Form::Off, Timing::from(0)), Expected::Off);
    }
    let joint = dice.below(JOINTS as u64) as usize;
    // All of it in one phase, which leaves half of it to each of the others: a vector of that length.
    let current = bounds.overcurrent_a * dice.uniform(0.9, 1.08);
    let codes = dice.sign() * current / AMPERE_PER_CODE;
    let shares = if dice.coin() { [1.0, -0.5] } else { [-0.5, 1.0] };
    let shunt = |channel, share| at(channel, joint, Form::Rail(2048.0 + codes * share), Timing::from(0));
    let [b, c] = shares;
    Scenario {
        injections: [Some(shunt(Channel::ShuntB, b)), Some(shunt(Channel::ShuntC, c))],
        magnitude: Some(current),
        // The shunts' zeros lie up to 12 codes off, half an ampere.
        by_design: current < bounds.overcurrent_a + 0.6,
        ..one(shunt(Channel::ShuntB, b), Expected::Off)
    }
}

/// V1: a reading, or a supply that pushes while the brake resistor is absent.
#[must_use]
pub fn overvoltage(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let [_, high] = bounds.bus_v;
    if dice.below(2) == 0 {
        let volts = dice.uniform(high + 0.2, 62.0);
        let code = volts / VOLT_PER_CODE;
        let bus = at(Channel::Bus, 0, Form::Rail(code), Timing::from(0));
        return Scenario { magnitude: Some(volts - high), ..one(bus, Expected::Off) };
    }
    // What the leg gives back finds a resistor that is not there, and a supply that pushes.
    let volts = dice.uniform(high + 2.0, 75.0);
    let absent = at(Channel::Brake, 0, Form::Off, Timing::from(0));
    Scenario {
        event: Event::Supply(volts),
        onset: Onset::BusAbove(high + 0.1),
        magnitude: Some(volts - high),
        ..one(absent, Expected::Off)
    }
}

/// V2: a reading, or a supply that is cut or gives too little.
#[must_use]
pub fn undervoltage(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let [low, _] = bounds.bus_v;
    let volts = dice.uniform(0.0, low - 0.5);
    if dice.below(2) == 0 {
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
        ..one(at(Channel::Bus, 0, Form::Off, Timing::from(u64::MAX)), Expected::Off)
    }
}

/// N1: what is no number, between axis and servo in either direction.
#[must_use]
pub fn not_finite(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let value = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][dice.below(3) as usize];
    let channel = if dice.coin() { Channel::JointCurrent } else { Channel::Target };
    let spoilt = at(channel, joint, Form::Rail(value), Timing::from(0));
    Scenario { onset: Onset::ServoTick, ..one(spoilt, Expected::Off) }
}

/// X1: pressed, for 10 ms at most.
#[must_use]
pub fn emergency_stop(dice: &mut Dice, _: &Bounds) -> Scenario {
    let lasting = 1 + dice.below(PERIODS_PER_S / 100);
    one(at(Channel::EmergencyStop, 0, Form::Off, Timing::lasting(0, lasting)), Expected::Off)
}

/// X2: a contact that bounces for up to a second, with hands at the other contacts.
#[must_use]
pub fn bouncing_stop(dice: &mut Dice, _: &Bounds) -> Scenario {
    let lasting = 1 + dice.below(PERIODS_PER_S);
    let (on, off) = (1 + dice.below(200), 1 + dice.below(200));
    let timing = Timing { begin: 0, duration: lasting, on, off };
    let bounce = at(Channel::EmergencyStop, 0, Form::Off, timing);
    Scenario { event: Event::Hands, ..one(bounce, Expected::Off) }
}

/// K1: current ticks missed now and then or at once, or the servo kept from its tick.
#[must_use]
pub fn late_ticks(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    match dice.below(3) {
        // Every other tick; the third that is missed is one too many.
        0 => {
            let timing = Timing { begin: 0, duration: u64::MAX, on: 1, off: 1 };
            one(at(Channel::Tick, joint, Form::Off, timing), Expected::Damp)
        }
        // Time stolen at once.
        1 => {
            let gap = Timing::lasting(0, 3 + dice.below(10));
            one(at(Channel::Tick, joint, Form::Off, gap), Expected::Damp)
        }
        _ => one(at(Channel::Servo, 0, Form::Off, Timing::from(0)), Expected::Off),
    }
}

/// J2: a kick.
#[must_use]
pub fn overspeed(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let peak = dice.logarithmic(200.0, 900.0);
    let kick = Event::Kick(joint, dice.sign() * peak, dice.uniform(0.06, 0.2));
    Scenario {
        injections: [None; 2],
        event: kick,
        onset: Onset::Speed(1.1),
        magnitude: Some(peak),
        patience: PERIODS_PER_S / 4,
        ..one(at(Channel::Bus, 0, Form::Off, Timing::from(u64::MAX)), Expected::Damp)
    }
}
