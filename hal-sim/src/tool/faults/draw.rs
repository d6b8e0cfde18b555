//! What the draws of all rows begin with.

use super::catalogue::{Event, Expected, Onset, Scenario};
use super::dice::Dice;
use super::rig::{PERIOD_MS, PERIODS_PER_S};
use crate::faults::{Channel, Form, Injection, Timing};

/// Of the board's shunts and converter.
pub const AMPERE_PER_CODE: f64 = 0.040_283;
/// Of the bus voltage's divider.
pub const VOLT_PER_CODE: f64 = 3.3 * 19.0 / 4096.0;

/// One injection.
#[must_use]
pub const fn at(channel: Channel, joint: usize, form: Form, timing: Timing) -> Injection {
    Injection { channel, joint, form, timing }
}

/// A run with one injection that is a fault at once.
#[must_use]
pub const fn one(injection: Injection, expected: Expected) -> Scenario {
    Scenario {
        injections: [Some(injection), None],
        event: Event::None,
        onset: Onset::Injection,
        expected,
        magnitude: None,
        by_design: false,
        patience: PERIODS_PER_S / 10,
        within_ms: None,
        turns: 1.1,
    }
}

/// A run in which something happens beside the ports.
#[must_use]
pub const fn beside(event: Event, expected: Expected) -> Scenario {
    let nothing = at(Channel::Bus, 0, Form::Off, Timing::from(u64::MAX));
    Scenario { injections: [None; 2], event, ..one(nothing, expected) }
}

/// One time in four what lasts comes and goes: one wrong reading in two to five. By how many the axis believes them no longer follows from
/// its count of doubts (`scarab::motor::Axis`); one in five is believed in for ever.
pub fn now_and_then(dice: &mut Dice, lasting: Scenario) -> Scenario {
    if dice.below(4) > 0 {
        return lasting;
    }
    let off = 1 + dice.below(4);
    let readings = [3, 4, 6, u64::MAX][off as usize - 1];
    let [first, other] = lasting.injections;
    let first =
        first.map(|injection| Injection { timing: Timing { on: 1, off, ..injection.timing }, ..injection });
    Scenario {
        injections: [first, other],
        by_design: off > 3,
        within_ms: (off <= 3).then(|| ((readings - 1) * (1 + off) + 1) as f64 * PERIOD_MS),
        ..lasting
    }
}
