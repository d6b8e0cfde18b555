//! Joints at their limits.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{at, one};
use super::super::rig::PERIODS_PER_S;
use super::{Bounds, Event, Expected, JOINTS, Onset, Row, Scenario};
use crate::faults::{Channel, Form, Timing};

/// Rows of this group.
pub static ROWS: [Row; 1] = [Row {
    id: "J2",
    fault: "overspeed by a kick",
    detector: "estimated speed above 1.1 times the limit",
    state: "Damp",
    codes: &[FaultCode::Overspeed],
    deadline_ms: 6.0,
    unit: "N m",
    lacking: None,
    draw: overspeed,
}];

/// J2: a kick.
fn overspeed(dice: &mut Dice, _: &Bounds) -> Scenario {
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
