//! Common parts of the rows' draws.

use hal_sim::faults::{Channel, Form, Injection, Timing};
use scarab_base::random::Random;

use crate::faults::scenario::{Event, Expected, Onset, Scenario};
use crate::faulty_board::{PERIOD_MS, PERIODS_PER_S};
use scarab::motor::SenseScale;

/// Scale of the board's shunts and converter, A.
pub(crate) const AMPERE_PER_CODE: f64 = 0.040_283;
/// Scale of the bus voltage's divider, V.
pub(crate) const VOLT_PER_CODE: f64 = 3.3 * SenseScale::DIVIDER as f64 / 4096.0;

/// Creates an injection.
pub(crate) const fn at(channel: Channel, joint: usize, form: Form, timing: Timing) -> Injection {
    Injection { channel, joint, form, timing }
}

/// A run with one injection that is a fault from the start.
pub(crate) const fn one(injection: Injection, expected: Expected) -> Scenario {
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

/// A run with an event besides the ports.
pub(crate) const fn beside(event: Event, expected: Expected) -> Scenario {
    let nothing = at(Channel::Bus, 0, Form::Off, Timing::from(u64::MAX));
    Scenario { injections: [None; 2], event, ..one(nothing, expected) }
}

/// Makes a lasting fault intermittent in one of four runs: one wrong reading in two to five. The axis rejects
/// the readings after a number that follows from its count of doubtful readings (`scarab::motor::Axis`). One
/// wrong reading in five is accepted without limit.
pub(crate) fn now_and_then(random: &mut Random, lasting: Scenario) -> Scenario {
    if random.below(4) > 0 {
        return lasting;
    }
    let off = 1 + random.below(4);
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
