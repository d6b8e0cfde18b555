//! What the draws of all rows begin with.

use super::catalogue::{Event, Expected, Onset, Scenario};
use super::rig::PERIODS_PER_S;
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
