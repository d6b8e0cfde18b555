//! Rows of the fault catalogue injected into the chip's pins, converters and peripherals, image unmodified.
//!
//! Each run starts from a saved machine that holds its pose or follows the exciting motion, at an instant
//! drawn from the seed. Deadlines are measured at the pins: release of both bridges, or the active short
//! circuit (no high side for a PWM period). Faults that damp first are measured at the record of the reaction
//! and must end with both bridges off.

use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::bus::Frame;
use serde::Serialize;

use scarab_host::base::error::ToolError;

use crate::chip::{Chip, GATE_FAULT, STOP};
use crate::machine::Snapshot;
use crate::nvic::HARD_FAULT;
use crate::plant::{JOINTS, STEP, ShuntFault};
use crate::session::Session;
use crate::time::{Ticks, seconds, ticks};

/// Longest time that is watched, s.
const WATCHED_S: f64 = 0.5;
/// Longest damping before the release, s.
const DAMPING_S: f64 = 0.35;
/// PWM period, s.
const PERIOD_S: f64 = 1.0 / 24e3;

/// Exception of the servo.
const SERVO: u8 = 16 + 77;

/// Situation in which a fault comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Situation {
    Rest,
    Motion,
}

/// Expected reaction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Expected {
    /// Both bridges off, and not on again.
    Released,
    /// Active short circuit or off.
    Shorted,
    /// Reaction begins in time, then both bridges off.
    Damped,
    /// No reaction: bridges stay on.
    Nothing,
}

/// Injection that changes the chip at an instant after the first: returns whether it goes on.
type Later = fn(&mut Session, Ticks, u32) -> bool;

/// Row of the catalogue.
struct Row {
    id: &'static str,
    fault: &'static str,
    situation: Situation,
    expected: Expected,
    deadline_s: f64,
    inject: fn(&mut Chip, &mut Xoshiro256PlusPlus),
    later: Option<Later>,
}

fn axis(random: &mut Xoshiro256PlusPlus) -> usize {
    random.next_u32() as usize % JOINTS
}

fn shunt(random: &mut Xoshiro256PlusPlus) -> (usize, usize) {
    (axis(random), random.next_u32() as usize % 2)
}

const ROWS: [Row; 20] = [
    Row {
        id: "E1",
        fault: "encoder frozen in motion",
        situation: Situation::Motion,
        expected: Expected::Shorted,
        deadline_s: 20e-3,
        inject: |chip, random| {
            let (axis, now) = (axis(random), chip.now);
            let position = chip.plant.encoder(axis, now);
            chip.plant.axes[axis].encoder_fault.frozen = Some(position);
        },
        later: None,
    },
    Row {
        id: "E2",
        fault: "single jump of the counter",
        situation: Situation::Motion,
        expected: Expected::Nothing,
        deadline_s: 0.0,
        inject: |chip, random| chip.plant.axes[axis(random)].encoder_fault.added = 3000,
        later: Some(|session, since, _| {
            if since >= STEP {
                let axes = &mut session.machine.chip_mut().plant.axes;
                axes.iter_mut().for_each(|axis| axis.encoder_fault.added = 0);
            }
            since < STEP
        }),
    },
    Row {
        id: "E4",
        fault: "counts lost in motion",
        situation: Situation::Motion,
        expected: Expected::Shorted,
        deadline_s: 0.5,
        inject: |chip, random| chip.plant.axes[axis(random)].encoder_fault.added = 150,
        later: None,
    },
    Row {
        id: "C1",
        fault: "current offset jumps by 20 A",
        situation: Situation::Motion,
        expected: Expected::Released,
        deadline_s: 50e-3,
        inject: |chip, random| {
            let (axis, channel) = shunt(random);
            chip.plant.axes[axis].shunt_faults[channel] = Some(ShuntFault::Offset(500.0));
        },
        later: None,
    },
    Row {
        id: "C2",
        fault: "current sensor at its rail",
        situation: Situation::Rest,
        expected: Expected::Released,
        deadline_s: 3.0 * PERIOD_S,
        inject: |chip, random| {
            let (axis, channel) = shunt(random);
            let code = if random.next_u32() & 1 == 0 { 4095 } else { 0 };
            chip.plant.axes[axis].shunt_faults[channel] = Some(ShuntFault::Stuck(code));
        },
        later: None,
    },
    Row {
        id: "C3",
        fault: "converter silent",
        situation: Situation::Rest,
        expected: Expected::Released,
        deadline_s: 4.0 * PERIOD_S,
        inject: |chip, random| chip.silent_adc[1 + random.next_u32() as usize % 2] = true,
        later: None,
    },
    Row {
        id: "C4",
        fault: "gate drivers' fault line",
        situation: Situation::Rest,
        expected: Expected::Released,
        deadline_s: 1.5 * PERIOD_S,
        inject: |chip, _| chip.set_pin(GATE_FAULT, false),
        later: None,
    },
    Row {
        id: "P1",
        fault: "wire of a phase broken in motion",
        situation: Situation::Motion,
        expected: Expected::Released,
        deadline_s: 0.4,
        inject: |chip, random| chip.plant.axes[axis(random)].open = Some(random.next_u32() as usize % 3),
        later: None,
    },
    Row {
        id: "P2",
        fault: "gate driver lost its configuration",
        situation: Situation::Rest,
        expected: Expected::Released,
        deadline_s: 10e-3,
        inject: |chip, random| chip.drivers.lose_configuration(axis(random)),
        later: None,
    },
    Row {
        id: "V1",
        fault: "bus voltage of 63 V",
        situation: Situation::Rest,
        expected: Expected::Released,
        deadline_s: 1e-3,
        inject: |chip, _| chip.plant.set_bus(63.0),
        later: None,
    },
    Row {
        id: "V2",
        fault: "bus voltage of 15 V",
        situation: Situation::Rest,
        expected: Expected::Released,
        deadline_s: 1e-3,
        inject: |chip, _| chip.plant.set_bus(15.0),
        later: None,
    },
    Row {
        id: "T1",
        fault: "thermistor open or shorted",
        situation: Situation::Rest,
        expected: Expected::Damped,
        deadline_s: 100e-3,
        inject: |chip, random| {
            chip.plant.thermistors[axis(random)] = if random.next_u32() & 1 == 0 { 4095 } else { 0 };
        },
        later: None,
    },
    Row {
        id: "X1",
        fault: "emergency stop",
        situation: Situation::Motion,
        expected: Expected::Released,
        deadline_s: PERIOD_S,
        inject: |chip, _| chip.set_pin(STOP, false),
        later: None,
    },
    Row {
        id: "X2",
        fault: "emergency stop that bounces for 20 ms and closes",
        situation: Situation::Rest,
        expected: Expected::Released,
        deadline_s: PERIOD_S,
        inject: |chip, _| chip.set_pin(STOP, false),
        later: Some(|session, since, count| {
            let bounces = since < ticks(20e-3);
            session.machine.chip_mut().set_pin(STOP, !bounces || count % 7 < 3);
            bounces
        }),
    },
    Row {
        id: "X3",
        fault: "supply cut in motion, then back: starts off",
        situation: Situation::Motion,
        expected: Expected::Released,
        // The cut itself comes a period after the beginning.
        deadline_s: 2.0 * PERIOD_S,
        inject: |_, _| {},
        later: Some(|session, _, _| {
            session.machine.power_cycle();
            false
        }),
    },
    Row {
        id: "K3",
        fault: "servo hangs",
        situation: Situation::Motion,
        expected: Expected::Released,
        deadline_s: 4e-3 + 512.0 / 32e3,
        inject: |_, _| {},
        later: Some(|session, _, _| {
            session.machine.hang(Some(SERVO));
            false
        }),
    },
    Row {
        id: "B2",
        fault: "controller goes bus-off while the operator has control",
        situation: Situation::Motion,
        expected: Expected::Nothing,
        deadline_s: 0.0,
        inject: |chip, _| {
            let now = chip.now;
            chip.can.go_bus_off(now);
        },
        later: None,
    },
    Row {
        id: "K4",
        fault: "hard fault",
        situation: Situation::Motion,
        expected: Expected::Released,
        deadline_s: 10e-6,
        inject: |chip, _| {
            let now = chip.now;
            chip.nvic.pend(HARD_FAULT, now);
        },
        later: None,
    },
    Row {
        id: "K5",
        fault: "crystal stops",
        situation: Situation::Motion,
        expected: Expected::Released,
        deadline_s: 50e-6,
        inject: |chip, _| chip.stop_crystal(),
        later: None,
    },
    Row {
        id: "B4",
        fault: "bus with full load of foreign and hostile frames",
        situation: Situation::Motion,
        expected: Expected::Nothing,
        deadline_s: 0.0,
        inject: |chip, random| {
            for _ in 0..5000 {
                let bytes = random.next_u64().to_le_bytes();
                // No node control, no synchronisation, no frames of the device itself.
                let id = 0x190 + (random.next_u32() % 0x370) as u16;
                chip.send_frame(Frame::new(id, &bytes[..random.next_u32() as usize % 9]));
            }
        },
        later: None,
    },
];

/// Result of one row.
#[derive(Clone, Debug, Serialize)]
pub struct RowReport {
    /// Number in the catalogue.
    pub id: &'static str,
    /// Fault.
    pub fault: &'static str,
    /// Runs.
    pub runs: u32,
    /// Runs without the expected reaction in time.
    pub missed: u32,
    /// Deadline, ms.
    pub deadline_ms: f64,
    /// Slowest reaction, ms.
    pub worst_ms: f64,
    /// What went wrong.
    pub complaints: Vec<String>,
}

/// Runs all rows, or the named ones.
///
/// # Errors
/// The model does not know what the processor does.
pub fn run(
    session: &mut Session,
    resting: &Snapshot,
    moving: &Snapshot,
    seeds: u32,
    only: &[String],
) -> Result<Vec<RowReport>, ToolError> {
    let mut reports = Vec::new();
    for row in ROWS.iter().filter(|row| only.is_empty() || only.iter().any(|id| id == row.id)) {
        let mut report = RowReport {
            id: row.id,
            fault: row.fault,
            runs: seeds,
            missed: 0,
            deadline_ms: 1e3 * row.deadline_s,
            worst_ms: 0.0,
            complaints: Vec::new(),
        };
        let saved = if row.situation == Situation::Rest { resting } else { moving };
        for seed in 0..seeds {
            match run_row(session, row, saved, u64::from(seed))? {
                Ok(reaction) => report.worst_ms = report.worst_ms.max(1e3 * reaction),
                Err(complaint) => {
                    report.missed += 1;
                    report.complaints.push(format!("seed {seed}: {complaint}"));
                }
            }
        }
        reports.push(report);
    }
    Ok(reports)
}

/// Reaction seen at the pins and in the records.
#[derive(Debug, Default)]
struct Seen {
    released: Option<f64>,
    shorted: Option<f64>,
    reacted: Option<f64>,
    on_again: bool,
}

fn run_row(
    session: &mut Session,
    row: &Row,
    saved: &Snapshot,
    seed: u64,
) -> Result<Result<f64, String>, ToolError> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    session.machine.restore(saved)?;
    let spread = if row.situation == Situation::Motion { ticks(0.5) } else { ticks(10e-3) };
    session.run_until(saved.chip().now + random.next_u64() % spread)?;
    let begun = session.now();
    let records = session.probe.lines.len();
    session.machine.chip_mut().plant.switchings = Some(Vec::new());
    (row.inject)(session.machine.chip_mut(), &mut random);
    session.machine.chip_mut().reschedule();
    let seen = watch(session, row, begun, records)?;
    Ok(judge(row, &seen))
}

fn watch(session: &mut Session, row: &Row, begun: Ticks, records: usize) -> Result<Seen, ToolError> {
    let (mut seen, mut later, mut count) = (Seen::default(), row.later, 0);
    let mut armed = [0, 1].map(|axis| session.machine.chip().plant.axes[axis].is_armed());
    let longest = if row.expected == Expected::Damped { WATCHED_S + DAMPING_S } else { WATCHED_S };
    while session.now() < begun + ticks(longest) {
        session.run_until(session.now() + STEP)?;
        let now = session.now();
        if let Some(step) = later {
            later = step(session, now - begun, count).then_some(step);
            count += 1;
        }
        let plant = &mut session.machine.chip_mut().plant;
        for switching in plant.switchings.replace(Vec::new()).unwrap_or_default() {
            seen.on_again |= seen.released.is_some() && switching.on;
            armed[switching.axis] = switching.on;
            if armed == [false; JOINTS] && seen.released.is_none() {
                seen.released = Some(seconds(switching.at - begun));
            }
        }
        let high = plant.axes.iter().map(|axis| axis.last_high).max().unwrap_or(now);
        if armed != [false; JOINTS] && now > high + 2 * STEP && seen.shorted.is_none() {
            seen.shorted = Some(seconds(high.saturating_sub(begun)));
        }
        if seen.reacted.is_none()
            && let Some((at, _)) =
                session.probe.lines[records..].iter().find(|(_, line)| line.starts_with("fault "))
        {
            seen.reacted = Some(seconds(at - begun));
        }
        let settled = later.is_none() && row.expected != Expected::Nothing;
        if settled && seen.released.is_some_and(|at| seconds(now - begun) > at + 5e-3) {
            break;
        }
    }
    Ok(seen)
}

fn judge(row: &Row, seen: &Seen) -> Result<f64, String> {
    let earliest = |one: Option<f64>, other: Option<f64>| match (one, other) {
        (Some(one), Some(other)) => Some(one.min(other)),
        (one, other) => one.or(other),
    };
    let reaction = match row.expected {
        Expected::Nothing if seen.released.or(seen.shorted).or(seen.reacted).is_none() => return Ok(0.0),
        Expected::Nothing => return Err(format!("reacted without need: {seen:?}")),
        Expected::Released => seen.released,
        Expected::Shorted => earliest(seen.released, seen.shorted),
        Expected::Damped => earliest(seen.reacted, seen.released).filter(|_| seen.released.is_some()),
    };
    match reaction {
        None => Err(format!("no reaction: {seen:?}")),
        Some(_) if seen.on_again => Err(format!("a bridge was on again: {seen:?}")),
        Some(at) if at > row.deadline_s => Err(format!("too late, after {:.3} ms", 1e3 * at)),
        Some(at) => Ok(at),
    }
}
