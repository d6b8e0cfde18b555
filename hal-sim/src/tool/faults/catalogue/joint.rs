//! Joints at their limits.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{at, beside, one};
use super::super::rig::PERIODS_PER_S;
use super::{Bounds, Event, Expected, JOINTS, Onset, Row, Scenario};
use crate::faults::{Channel, Form, Timing};

/// Rows of this group.
pub static ROWS: [Row; 2] = [
    Row {
        id: "J1",
        fault: "joint limit approached too fast: by a push, by command",
        detector: "stopping-distance clamp",
        state: "Limit, Damp",
        codes: &[FaultCode::PositionLimit, FaultCode::Overspeed],
        deadline_ms: f64::INFINITY,
        unit: "N m",
        lacking: Some(
            "pushes above half of the torque cap, against which no drive that is capped can stop a joint",
        ),
        draw: pushed,
    },
    Row {
        id: "J2",
        fault: "overspeed by a kick",
        detector: "estimated speed above 1.1 times the limit",
        state: "Damp",
        codes: &[FaultCode::Overspeed],
        deadline_ms: 6.0,
        unit: "N m",
        lacking: None,
        draw: overspeed,
    },
];

/// J1: a push towards either end of the range, no harder than what the drive has left beside the leg's weight.
fn pushed(dice: &mut Dice, _: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let peak = dice.logarithmic(10.0, 70.0);
    let seconds = dice.uniform(0.2, 1.0);
    let push = Event::Push(joint, dice.sign() * peak, seconds);
    let periods = ((seconds + 0.3) * PERIODS_PER_S as f64) as u64;
    Scenario { magnitude: Some(peak), patience: periods, ..beside(push, Expected::Kept) }
}

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
