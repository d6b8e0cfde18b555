//! The bus and what feeds it.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{VOLT_PER_CODE, at, now_and_then, one};
use super::super::rig::{PERIOD_MS, PERIODS_PER_S};
use super::{Bounds, Event, Expected, Onset, Row, Scenario};
use crate::faults::{Channel, Form, Timing};

/// Rows of this group.
pub static ROWS: [Row; 2] = [
    Row {
        id: "V1",
        fault: "overvoltage: reading, or a pushing supply without brake resistor",
        detector: "bus voltage in each tick, twice",
        state: "Limit, Off",
        codes: &[FaultCode::BusVoltage],
        deadline_ms: 2.0 * PERIOD_MS,
        unit: "V beyond",
        lacking: None,
        draw: overvoltage,
    },
    Row {
        id: "V2",
        fault: "undervoltage: reading, or the supply cut",
        detector: "a fifth lost against the mean of a second, 1 ms: Damp; the lower border in each tick, twice: Off",
        state: "Damp if there is energy, else Off",
        codes: &[FaultCode::BusVoltage, FaultCode::SupplyLost],
        deadline_ms: 1.0,
        unit: "V beyond",
        lacking: None,
        draw: undervoltage,
    },
];

/// V1: a reading, or a supply that pushes while the brake resistor is absent.
fn overvoltage(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let [_, high] = bounds.bus_v;
    if dice.below(2) == 0 {
        let volts = dice.uniform(high + 0.2, 62.0);
        let code = volts / VOLT_PER_CODE;
        let bus = at(Channel::Bus, 0, Form::Rail(code), Timing::from(0));
        return Scenario { magnitude: Some(volts - high), ..now_and_then(dice, one(bus, Expected::Off)) };
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
fn undervoltage(dice: &mut Dice, bounds: &Bounds) -> Scenario {
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
        ..one(at(Channel::Bus, 0, Form::Off, Timing::from(u64::MAX)), Expected::Damped)
    }
}
