//! Faults that the voltages of an axis show: a frozen counter, drifted current-sensor offsets, open phases.
//!
//! These faults are detectable in motion only ([`Onset::Driven`]). A run in which the joint does not turn for
//! the whole deadline proves nothing.

use hal_sim::faults::{Channel, Form, Timing};
use scarab::safety::FaultCode;
use scarab_base::random::Random;

use crate::faults::draw::{AMPERE_PER_CODE, at, one};
use crate::faults::scenario::{Bounds, Event, Expected, Onset, Row, Scenario};
use crate::faulty_board::PERIODS_PER_S;
use scarab::model::planar::JOINTS;

/// Rows of this group.
pub static ROWS: [Row; 3] = [
    Row {
        id: "E1",
        fault: "encoder frozen while moving",
        detector: "back-EMF against counts, or counts that stop within a period, 8 ms",
        state: "Short",
        codes: &[FaultCode::EncoderFrozen],
        deadline_ms: 20.0,
        unit: "",
        lacking: Some("at rest, or so slow that dead time and resistance hide the back-EMF"),
        draw: frozen,
    },
    Row {
        id: "C1",
        fault: "current offset drifts",
        detector: "mean of the residual over an electrical turn",
        state: "Refuse / Off",
        codes: &[FaultCode::CurrentOffset, FaultCode::OpenPhase, FaultCode::Overcurrent],
        deadline_ms: 50.0,
        unit: "A",
        lacking: Some("small offsets while the joint moves; below 2 A of the vector at enabling"),
        draw: drift,
    },
    Row {
        id: "P1",
        fault: "one phase open",
        detector: "voltage without current, 8 ms",
        state: "Off",
        codes: &[
            FaultCode::OpenPhase,
            FaultCode::CurrentOffset,
            FaultCode::EncoderFrozen,
            FaultCode::Overcurrent,
        ],
        // Half an electrical turn at 0.2 rad/s takes 45 ms; a phase has hardly any current in a part of it.
        // The detection takes 8 ms more.
        deadline_ms: 55.0,
        unit: "",
        lacking: Some("without a current target"),
        draw: open_phase,
    },
];

/// Time within which a joint must turn, and for which it must keep turning.
const PATIENCE: u64 = PERIODS_PER_S / 2;

/// E1: counter and index of a failed sensor.
fn frozen(random: &mut Random, bounds: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let counter = at(Channel::Counter, joint, Form::Stuck, Timing::from(0));
    // Ten percent margin: the speed estimate has lag and ripple. Counts come in whole numbers: 4 or 5 a
    // period.
    let [speed, per_ampere] = bounds.frozen_speed.map(|speed| 1.1 * speed);
    let index = at(Channel::Index, joint, Form::Off, Timing::from(0));
    Scenario {
        injections: [Some(counter), Some(index)],
        // Any current.
        onset: Onset::Driven { speed, per_ampere, current: -1.0, sudden: 1.25 * bounds.stopped_speed },
        patience: PERIODS_PER_S,
        ..one(counter, Expected::Brake)
    }
}

/// C1: an offset step of up to 30 A.
fn drift(random: &mut Random, bounds: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let size = random.logarithmic(0.5, 30.0);
    let channel = if random.coin() { Channel::ShuntB } else { Channel::ShuntC };
    let form = Form::Offset(random.sign() * size / AMPERE_PER_CODE);
    let offset = at(channel, joint, form, Timing::from(0));
    Scenario {
        // An electrical turn within half of the deadline: 0.9 rotor turns per second.
        onset: Onset::Driven {
            speed: bounds.judged_speed,
            per_ampere: 0.0,
            current: 0.0,
            sudden: f64::INFINITY,
        },
        magnitude: Some(size),
        by_design: size <= bounds.smallest_offset_a,
        patience: PATIENCE,
        ..one(offset, Expected::Off)
    }
}

/// P1: a broken wire.
fn open_phase(random: &mut Random, _: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let output = random.below(3) as usize;
    // Inactive injection that selects the joint.
    let nothing = at(Channel::Index, joint, Form::Off, Timing::from(u64::MAX));
    Scenario {
        event: Event::OpenPhase(joint, output),
        onset: Onset::Driven { speed: 0.2, per_ampere: 0.0, current: 3.0, sudden: f64::INFINITY },
        patience: PATIENCE,
        ..one(nothing, Expected::Off)
    }
}
