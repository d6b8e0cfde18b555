//! Ticks that come late or not at all.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{at, one};
use super::super::rig::PERIOD_MS;
use super::{Bounds, Event, Expected, JOINTS, Row, Scenario};
use crate::faults::{Channel, Form, Timing};

/// Rows of this group.
pub static ROWS: [Row; 2] = [LATE, HUNG];

const LATE: Row = Row {
    id: "K1",
    fault: "current ticks or the servo late or missed",
    detector: "time between ticks; the servo's counter",
    state: "Damp",
    codes: &[FaultCode::CurrentTicks, FaultCode::ServoTicks],
    deadline_ms: 1.0,
    unit: "",
    lacking: Some(
        "a servo that does not answer cannot damp, nor an axis that misses three ticks at once: Off",
    ),
    draw: late_ticks,
};

const HUNG: Row = Row {
    id: "K3",
    fault: "a current loop or both, the servo or the housekeeping hangs",
    detector: "watchdog, fed only if all of them ran since",
    state: "reset, boots Refuse with the reason",
    codes: &[FaultCode::Watchdog],
    // 4 ms until the next look, and 512 cycles of an oscillator of 17 kHz.
    deadline_ms: 4.0 + 512.0 / 17.0 + PERIOD_MS,
    unit: "",
    lacking: Some("a hang of the task that feeds, which is seen as well but not run here"),
    draw: hang,
};

/// K3: any one of those that check in, or both current loops, at any tick; the others go on.
fn hang(dice: &mut Dice, _: &Bounds) -> Scenario {
    let hung = |channel, joint| at(channel, joint, Form::Off, Timing::from(0));
    let (first, second) = match dice.below(5) {
        joint @ 0..=1 => (hung(Channel::Tick, joint as usize), None),
        2 => (hung(Channel::Servo, 0), None),
        3 => (hung(Channel::Housekeeping, 0), None),
        // The converter by whose end both are ticked.
        _ => (hung(Channel::Tick, 0), Some(hung(Channel::Tick, 1))),
    };
    let event = Event::Oscillator(dice.uniform(17e3, 47e3));
    Scenario { event, injections: [Some(first), second], ..one(first, Expected::Restarted) }
}

/// K1: current ticks missed now and then or at once, or the servo kept from its tick.
fn late_ticks(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    match dice.below(3) {
        // Every other tick; the third that is missed is one too many.
        0 => {
            let timing = Timing { begin: 0, duration: u64::MAX, on: 1, off: 1 };
            one(at(Channel::Tick, joint, Form::Off, timing), Expected::Damp)
        }
        // Time stolen from one axis at once, which the other one sees.
        1 => {
            let gap = Timing::lasting(0, 3 + dice.below(10));
            one(at(Channel::Tick, joint, Form::Off, gap), Expected::Off)
        }
        _ => one(at(Channel::Servo, 0, Form::Off, Timing::from(0)), Expected::Off),
    }
}
