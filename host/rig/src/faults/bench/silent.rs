//! B5: a host without heartbeat and event timer sends in every cycle and falls silent.
//!
//! Each run draws the cycle (1 to 1.5 ms; four times that for controlwords, so ten periods of either are
//! below 100 ms) and 6007 (1 or 3). First the host pauses three times for less than 95 ms: no fault may be
//! reported.
//!
//! In a quarter of the runs the host then stops either SYNC and targets or its controlwords, and continues
//! the other. Again no fault may be reported, and the run counts as undetectable. In the other runs it stops
//! completely. Its timeout is 100 ms after the last frame that a node received. The requirements are those of
//! B1: damped, reported within 10 ms, and not enabled by a host that returns.

use scarab::safety::FaultCode;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::host::{NODES, Speaks};
use crate::faults::bench::Bench;
use crate::faults::bench::hosted::{Fork, forked, hosted};
use crate::faults::bench::lost::{LATE_NS, comes_back};
use crate::faults::catalogue::{self, BUS_MS, Fault};
use crate::faults::run::Outcome;
use crate::faulty_board::PERIOD_MS;

/// Timeout for cycles of less than 10 ms, ns.
const TIME_NS: u64 = 100_000_000;
/// Longest pause, servo ticks: 95 ms.
const PAUSE: u64 = 380;
/// Servo ticks within which an emergency message has to be on the wire.
const REPORT_TICKS: u64 = 40;
const NOTHING: Speaks = Speaks { targets: false, words: false, heartbeat: 0 };

pub(super) const BENCH: Bench = Bench { fault: &catalogue::B5, run };

fn run(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    forked(fault, leg, hosted(leg)?, seeds, |fork| one(fork, blind))
}

fn one(mut fork: Fork<'_>, blind: bool) -> Result<Outcome, ToolError> {
    let option = if fork.random.coin() { 1 } else { 3 };
    for node in NODES {
        fork.host.write(node, 0x6007, 0, option, 2)?;
        fork.host.write(node, 0x2013, 0, u32::from(!blind), 1)?;
    }
    fork.host.cycle = 4 + fork.random.below(3);
    let cycle_ms = fork.host.cycle as f64 * 0.25;
    let speaks = fork.host.speaks;
    for _ in 0..3 {
        let (spoken, pause) = (400 + fork.random.below(400), fork.random.below(PAUSE - fork.host.cycle * 4));
        fork.run(spoken);
        fork.host.speaks = NOTHING;
        fork.run(pause);
        fork.host.rewind(pause);
        fork.host.speaks = speaks;
    }
    fork.run(800);
    let mut false_alarm = !fork.host.is_enabled();
    if fork.random.below(4) == 0 {
        let targets = fork.random.coin();
        fork.host.speaks = Speaks { targets, words: !targets, heartbeat: 0 };
        fork.run(2000);
        false_alarm |= !fork.host.is_enabled();
        let found = fork.ended(None, None);
        return Ok(Outcome { detected: false, undetectable: true, false_alarm, ..found });
    }
    fork.host.speaks = NOTHING;
    let (mut state, mut after_ms) = (None, None);
    loop {
        let command_ns = fork.tick() + (PERIOD_MS * 1e6) as u64;
        let due_ns = fork.host.cyclic_ns().into_iter().min().unwrap_or(0) + TIME_NS;
        if let Some(safe) = fork.safe_state() {
            (state, after_ms) = (Some(safe), Some((command_ns as f64 - due_ns as f64) * 1e-6));
            break;
        }
        if command_ns > due_ns + LATE_NS {
            break;
        }
    }
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    fork.run(REPORT_TICKS);
    let silent = FaultCode::HostSilent.number();
    if state.is_some() && !fork.host.emergencies().iter().any(|(_, code)| *code == silent) {
        fork.broken("no emergency message reports it");
    }
    comes_back(&mut fork, speaks, option == 1);
    let early = after_ms.is_some_and(|after| after <= 0.0);
    let in_time = after_ms.is_some_and(|after| after <= BUS_MS + 1e-9);
    let found = fork.ended(state, alarm);
    Ok(Outcome {
        detected: in_time && state == Some("Damp"),
        false_alarm: false_alarm || early,
        after_ms,
        magnitude: Some(cycle_ms),
        ..found
    })
}
