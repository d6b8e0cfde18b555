//! B5: a host without heartbeat and event timer sends in every cycle and falls silent.
//!
//! Each run draws the cycle (1 to 1.5 ms; four times that for controlwords, so ten periods of either are
//! below 100 ms) and 6007 (1 or 3). First the host pauses three times for less than 95 ms: no fault may be
//! reported.
//!
//! In a quarter of the runs the host then stops its controlwords, its targets, its SYNC, or two of them, and
//! continues the others; targets without SYNC only beside controlwords. Again no fault may be reported, and
//! the run counts as undetectable. In the other runs it stops completely, or sends targets without a SYNC,
//! which have no effect. Its timeout is 100 ms after the last SYNC or controlword that a node received. The
//! requirements are those of B1: damped, reported within 10 ms, and not enabled by a host that returns.

use scarab::safety::FaultCode;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::host::{Host, NODES, Speaks};
use crate::faults::bench::Outcomes;
use crate::faults::bench::hosted::{Fork, forked, hosted};
use crate::faults::bench::lost::{REPORT_TICKS, comes_back, until_safe};
use crate::faults::catalogue::{BUS_MS, Fault};
use crate::faults::run::Outcome;

/// Timeout for cycles of less than 10 ms, ns.
const TIME_NS: u64 = 100_000_000;
/// SYNC, targets and controlwords of a host that gives up some of them.
const KEPT: [(bool, bool, bool); 5] = [
    (true, true, false),
    (true, false, false),
    (true, false, true),
    (false, true, true),
    (false, false, true),
];
/// Longest pause, servo ticks: 95 ms.
const PAUSE: u64 = 380;

pub(super) fn run(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
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
        fork.host.speaks = Speaks::default();
        fork.run(pause);
        fork.host.rewind(pause);
        fork.host.speaks = speaks;
    }
    fork.run(800);
    let mut false_alarm = !fork.host.is_enabled();
    if fork.random.below(4) == 0 {
        let (sync, targets, words) = KEPT[fork.random.below(KEPT.len() as u64) as usize];
        fork.host.speaks = Speaks { sync, targets, words, heartbeat: 0 };
        fork.run(2000);
        false_alarm |= !fork.host.is_enabled();
        let found = fork.ended(None, None);
        return Ok(Outcome { detected: false, undetectable: true, false_alarm, ..found });
    }
    fork.host.speaks = Speaks { targets: fork.random.coin(), ..Speaks::default() };
    let due_ns = |host: &Host| host.cyclic_ns().into_iter().min().unwrap_or(0) + TIME_NS;
    let (state, after_ms) = until_safe(&mut fork, due_ns);
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
