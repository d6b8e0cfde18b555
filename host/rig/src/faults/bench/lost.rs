//! B1, B2: a host that falls silent, and a controller that leaves the bus.
//!
//! | row | fault | detector | reaction |
//! | --- | --- | --- | --- |
//! | B1 | heartbeat, targets or SYNC end in motion | consumer (1016), event timer (1401:5) | Damp, Off |
//! | B2 | bus off, error passive | status of the controller | Damp, Off |
//!
//! Object 6007 selects the kind of damping (1 or 3). Times count from the host's timeout: its consumer time
//! or its event timer, drawn for each run. Then the host returns with heartbeat and targets. It starts the
//! network and sends "enable operation" repeatedly, which must not enable.
//!
//! Where 6007 makes the loss a fault (1), the host requests each step from the first on; without a reset this
//! must not enable either. A quick stop (3) may be left that way. An emergency message must report the event
//! within 10 ms of the safe state, or after bus off as soon as the bus is back.

use scarab::bus::{Controller, Frame};
use scarab::safety::FaultCode;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::bus::board::TICK_NS;
use crate::bus::host::{Host, NODES, Speaks};
use crate::faults::bench::Outcomes;
use crate::faults::bench::hosted::{Fork, forked, hosted};
use crate::faults::catalogue::{BUS_MS, Fault};
use crate::faults::run::Outcome;
use crate::faulty_board::PERIOD_MS;

const MS: u64 = 1_000_000;
/// Servo ticks of damping with a margin, and of the returned host.
const DAMPED: u64 = 1400;
const BACK: u64 = 400;
/// Servo ticks between two attempts of a returned host.
const TRIES: u64 = 40;
/// Servo ticks within which an emergency message has to be on the wire.
pub(super) const REPORT_TICKS: u64 = 40;
const HOST: u32 = 0x70;
/// Value of 6007: fault.
const FAULT: u32 = 1;
/// Longest wait after a host's timeout, ns.
const LATE_NS: u64 = 20 * MS;

/// Timeouts of a host.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// Consumer time and event timer, ms.
    times_ms: [u32; 2],
    /// Ends that fall silent.
    pub(super) silent: [bool; 2],
    /// A loss is a fault, not a quick stop.
    faults: bool,
}

impl Patience {
    /// Time of the host's timeout, ns.
    pub(super) fn due_ns(&self, host: &Host) -> u64 {
        let due = (0..2).filter(|way| self.silent[*way]);
        due.map(|way| host.sent_ns()[way] + u64::from(self.times_ms[way]) * MS).min().unwrap_or(u64::MAX)
    }

    /// Shortest timeout, ms.
    pub(super) fn shortest_ms(&self) -> f64 {
        let times = (0..2).filter(|way| self.silent[*way]).map(|way| self.times_ms[way]);
        times.min().map_or(f64::NAN, f64::from)
    }
}

/// Sets both nodes' timeouts and runs the host for a while; blind, they are not set.
pub(super) fn watched(fork: &mut Fork<'_>, silent: [bool; 2], blind: bool) -> Result<Patience, ToolError> {
    let drawn = |fork: &mut Fork<'_>, low: f64, high: f64| fork.random.logarithmic(low, high) as u32;
    let times_ms = [drawn(fork, 5.0, 200.0), drawn(fork, 4.0, 100.0)];
    let option = if fork.random.coin() { FAULT } else { 3 };
    // 40 % of the timeout, so that one lost heartbeat has no effect.
    fork.host.speaks.heartbeat = (u64::from(times_ms[0]) * MS * 4 / 10 / TICK_NS).max(1);
    if !blind {
        for node in NODES {
            fork.host.write(node, 0x6007, 0, option, 2)?;
            fork.host.write(node, 0x1016, 1, HOST << 16 | times_ms[0], 4)?;
            fork.host.write(node, 0x1401, 5, times_ms[1], 2)?;
        }
    }
    // The detector for hosts without heartbeat (B5) is not tested here.
    fork.host.write_both(0x2013, 0, 1)?;
    fork.run(3 * fork.host.speaks.heartbeat);
    Ok(Patience { times_ms, silent, faults: option == FAULT })
}

/// Runs until the leg is safe; returns the state, and the time since the timeout at `due_ns`, ms.
pub(super) fn until_safe(
    fork: &mut Fork<'_>,
    due_ns: impl Fn(&Host) -> u64,
) -> (Option<&'static str>, Option<f64>) {
    loop {
        let command_ns = fork.tick() + (PERIOD_MS * 1e6) as u64;
        let due_ns = due_ns(&fork.host);
        if let Some(state) = fork.safe_state() {
            return (Some(state), Some((command_ns as f64 - due_ns as f64) * 1e-6));
        }
        if command_ns > due_ns + LATE_NS {
            return (None, None);
        }
    }
}

/// Checks that both nodes report the event soon.
fn check_report(fork: &mut Fork<'_>, state: Option<&str>, codes: [FaultCode; 2]) {
    fork.run(REPORT_TICKS);
    let codes = codes.map(FaultCode::number);
    let has_reported =
        |node: &u16| fork.host.emergencies().iter().any(|(from, code)| from == node && codes.contains(code));
    if state.is_some() && !NODES.iter().all(has_reported) {
        fork.broken("no emergency message reports it");
    }
}

/// Damps to the end without a host; then the host returns and continues as before.
pub(super) fn comes_back(fork: &mut Fork<'_>, speaks: Speaks, faults: bool) {
    fork.host.speaks = Speaks::default();
    fork.run(DAMPED);
    if fork.host.rig().is_switching() {
        fork.broken("damped, but not off afterwards");
    }
    fork.host.speaks = speaks;
    for tick in 0..BACK {
        if tick.is_multiple_of(TRIES) {
            fork.host.network.send(Frame::new(0, &[1, 0]));
            let words: &[u16] = if faults { &[6, 7, 15] } else { &[15] };
            for word in words {
                NODES.into_iter().for_each(|node| fork.host.command(node, *word));
            }
        }
        fork.tick();
        if fork.host.is_enabled() || fork.host.rig().is_switching() {
            return fork.broken("enabled by a returned host");
        }
    }
}

pub(super) fn silence(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    forked(fault, leg, hosted(leg)?, seeds, |fork| silent(fork, blind))
}

fn silent(mut fork: Fork<'_>, blind: bool) -> Result<Outcome, ToolError> {
    let silent = [[true, true], [true, false], [false, true]][fork.random.below(3) as usize];
    let patience = watched(&mut fork, silent, blind)?;
    let false_alarm = !fork.host.is_enabled();
    let speaks = fork.host.speaks;
    if silent[0] {
        fork.host.speaks.heartbeat = 0;
    }
    if silent[1] {
        let kept = fork.random.below(3);
        (fork.host.speaks.sync, fork.host.speaks.targets) = (kept == 1, kept == 2);
        fork.host.speaks.words = !silent[0];
    }
    let (state, after_ms) = until_safe(&mut fork, |host| patience.due_ns(host));
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    check_report(&mut fork, state, [FaultCode::Heartbeat, FaultCode::LatePdo]);
    comes_back(&mut fork, speaks, patience.faults);
    let early = after_ms.is_some_and(|after| after <= 0.0);
    let in_time = after_ms.is_some_and(|after| after <= BUS_MS + 1e-9);
    let found = fork.ended(state, alarm);
    Ok(Outcome {
        detected: in_time && state == Some("Damp"),
        false_alarm: false_alarm || early,
        after_ms,
        magnitude: Some(patience.shortest_ms()),
        ..found
    })
}

pub(super) fn leave(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    forked(fault, leg, hosted(leg)?, seeds, |fork| left(fork, blind))
}

fn left(mut fork: Fork<'_>, blind: bool) -> Result<Outcome, ToolError> {
    let how = if fork.random.coin() { Controller::Off } else { Controller::Passive };
    let option = if fork.random.coin() { FAULT } else { 3 };
    fork.host.write_both(0x6007, option, 2)?;
    let lasts = 1 + fork.random.below(400);
    let speaks = fork.host.speaks;
    let left_ns = fork.host.network.now_ns();
    fork.host.board().set_controller(how, !blind);
    let (mut state, mut after_ms) = (None, None);
    for _ in 0..80 {
        let command_ns = fork.tick() + (PERIOD_MS * 1e6) as u64;
        state = fork.safe_state();
        if state.is_some() {
            after_ms = Some((command_ns - left_ns) as f64 * 1e-6);
            break;
        }
    }
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    fork.run(lasts);
    fork.host.board().set_controller(Controller::Active, !blind);
    check_report(&mut fork, state, [FaultCode::BusPassive, FaultCode::BusOff]);
    comes_back(&mut fork, speaks, option == FAULT);
    let in_time = after_ms.is_some_and(|after| after <= fork.fault.deadline_ms);
    let found = fork.ended(state, alarm);
    Ok(Outcome { detected: in_time && state == Some("Damp"), after_ms, ..found })
}
