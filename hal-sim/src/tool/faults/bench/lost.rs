//! B1, B2: a host that falls silent, and a controller that leaves the bus.
//!
//! | row | what | seen by | then |
//! | --- | --- | --- | --- |
//! | B1 | heartbeat, targets or both no longer come, from an instant of the motion on | consumer (1016), event timer of the PDO (1401:5) | damped as 6007 says (1 or 3), then off |
//! | B2 | bus off, error passive | status of the controller | the same |
//!
//! Times run from when the host's own time is over: its consumer time or its event timer, which each run draws. Then the host is back,
//! with heartbeat and targets, starts the network and says "enable operation", again and again: nothing is enabled by that. Where 6007 makes a fault
//! of it (1) it asks for each step from the first on, which enables nothing either without a reset; a quick stop (3) may be left that way.
//! What happened has to be told by an emergency message within 10 ms of the safe state, of a bus that is off once it is back.

use scarab::bus::{Controller, Frame};
use scarab::safety::FaultCode;

use super::super::entry::Head;
use super::super::rig::PERIOD_MS;
use super::super::run::Outcome;
use super::Bench;
use super::hosted::{Fork, forked, hosted};
use crate::tool::bus::board::TICK_NS;
use crate::tool::bus::host::Speaks;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;

/// Bound after a host's own time, ms. The bus looks after every second servo tick, the servo takes its order in the next tick, and
/// what the servo commands acts one period later.
pub(super) const BUS_MS: f64 = 3.0 * TICK_NS as f64 * 1e-6 + PERIOD_MS;
const MS: u64 = 1_000_000;
/// Servo ticks: damping and some more; in which the host is back.
const DAMPED: u64 = 1400;
const BACK: u64 = 400;
/// Between two tries of a host that is back.
const TRIES: u64 = 40;
/// In which an emergency message has to be on the wire.
const TOLD: u64 = 40;
const NODES: [u16; 2] = [1, 2];
const HOST: u32 = 0x70;
/// Of 6007.
const FAULT: u32 = 1;
/// Longest that is waited after a host's time is over, ns.
pub(super) const LATE_NS: u64 = 20 * MS;

pub(super) const HOST_LOST: Bench = Bench {
    head: Head {
        id: "B1",
        fault: "host's heartbeat or targets no longer come",
        detector: "heartbeat consumer, event timer of the received PDO",
        state: "Damp",
        deadline_ms: BUS_MS,
        unit: "ms of its own time",
        codes: &[FaultCode::Heartbeat, FaultCode::LatePdo],
        lacking: None,
    },
    run: silence,
};

pub(super) const BUS_LOST: Bench = Bench {
    head: Head {
        id: "B2",
        fault: "bus off, error passive",
        detector: "status of the controller",
        state: "Damp",
        deadline_ms: 10.0,
        unit: "",
        codes: &[FaultCode::BusOff, FaultCode::BusPassive],
        lacking: None,
    },
    run: leave,
};

/// What a host is watched by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// Consumer time and event timer, ms.
    times_ms: [u32; 2],
    /// Which of both its silence is about.
    pub(super) silent: [bool; 2],
    /// A loss is a fault, and no quick stop.
    faults: bool,
}

impl Patience {
    /// When the host's time is over, ns.
    pub(super) fn due_ns(&self, heard_ns: [u64; 2]) -> u64 {
        let due = (0..2).filter(|way| self.silent[*way]);
        due.map(|way| heard_ns[way] + u64::from(self.times_ms[way]) * MS).min().unwrap_or(u64::MAX)
    }

    /// The time that is over first, ms.
    pub(super) fn shortest_ms(&self) -> f64 {
        let times = (0..2).filter(|way| self.silent[*way]).map(|way| self.times_ms[way]);
        times.min().map_or(f64::NAN, f64::from)
    }
}

/// Has both nodes watch their host, who keeps the time for a while; blind they are not told to.
pub(super) fn watched(fork: &mut Fork<'_>, silent: [bool; 2], blind: bool) -> Result<Patience, ToolError> {
    let drawn = |fork: &mut Fork<'_>, low: f64, high: f64| fork.dice.logarithmic(low, high) as u32;
    let times_ms = [drawn(fork, 5.0, 200.0), drawn(fork, 4.0, 100.0)];
    let option = if fork.dice.coin() { FAULT } else { 3 };
    // Four in ten of its time, so that one that is lost on the wire is not missed.
    fork.host.speaks.heartbeat = (u64::from(times_ms[0]) * MS * 4 / 10 / TICK_NS).max(1);
    if !blind {
        for node in NODES {
            fork.host.write(node, 0x6007, 0, option, 2)?;
            fork.host.write(node, 0x1016, 1, HOST << 16 | times_ms[0], 4)?;
            fork.host.write(node, 0x1401, 5, times_ms[1], 2)?;
        }
    }
    // What sees a host without heartbeat (B5) is not what is tried here.
    for node in NODES {
        fork.host.write(node, 0x2013, 0, 0, 1)?;
    }
    fork.run(3 * fork.host.speaks.heartbeat);
    Ok(Patience { times_ms, silent, faults: option == FAULT })
}

/// To the end of its time and on, until the leg is made safe: the state, and ms since then.
pub(super) fn until_safe(fork: &mut Fork<'_>, patience: &Patience) -> (Option<&'static str>, Option<f64>) {
    loop {
        let command_ns = fork.tick() + (PERIOD_MS * 1e6) as u64;
        let due_ns = patience.due_ns(fork.host.heard_ns());
        if let Some(state) = fork.safe_state() {
            return (Some(state), Some((command_ns as f64 - due_ns as f64) * 1e-6));
        }
        if command_ns > due_ns + LATE_NS {
            return (None, None);
        }
    }
}

/// Both nodes tell of it, soon.
fn tells(fork: &mut Fork<'_>, state: Option<&str>, codes: [FaultCode; 2]) {
    fork.run(TOLD);
    let codes = codes.map(FaultCode::number);
    let told = |node: &u16| fork.host.told().iter().any(|(from, code)| from == node && codes.contains(code));
    if state.is_some() && !NODES.iter().all(told) {
        fork.broken("no emergency message tells of it");
    }
}

/// Damped to its end while nobody speaks, then the host is back as if nothing had been.
pub(super) fn comes_back(fork: &mut Fork<'_>, speaks: Speaks, faults: bool) {
    fork.host.speaks = Speaks { targets: false, words: false, heartbeat: 0 };
    fork.run(DAMPED);
    if fork.host.rig().is_switching() {
        fork.broken("damped and not off afterwards");
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
            return fork.broken("enabled by a host that came back");
        }
    }
}

fn silence(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    forked(head, leg, hosted(leg)?, seeds, |fork| silent(fork, blind))
}

fn silent(mut fork: Fork<'_>, blind: bool) -> Result<Outcome, ToolError> {
    let silent = [[true, true], [true, false], [false, true]][fork.dice.below(3) as usize];
    let patience = watched(&mut fork, silent, blind)?;
    let false_alarm = !fork.host.is_enabled();
    let speaks = fork.host.speaks;
    if silent[0] {
        fork.host.speaks.heartbeat = 0;
    }
    if silent[1] {
        (fork.host.speaks.targets, fork.host.speaks.words) = (false, !silent[0]);
    }
    let (state, after_ms) = until_safe(&mut fork, &patience);
    let alarm = fork.host.rig().alarm().map(FaultCode::name);
    tells(&mut fork, state, [FaultCode::Heartbeat, FaultCode::LatePdo]);
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

fn leave(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    forked(head, leg, hosted(leg)?, seeds, |fork| left(fork, blind))
}

fn left(mut fork: Fork<'_>, blind: bool) -> Result<Outcome, ToolError> {
    let how = if fork.dice.coin() { Controller::Off } else { Controller::Passive };
    let option = if fork.dice.coin() { FAULT } else { 3 };
    for node in NODES {
        fork.host.write(node, 0x6007, 0, option, 2)?;
    }
    let lasts = 1 + fork.dice.below(400);
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
    tells(&mut fork, state, [FaultCode::BusPassive, FaultCode::BusOff]);
    comes_back(&mut fork, speaks, option == FAULT);
    let in_time = after_ms.is_some_and(|after| after <= fork.head.deadline_ms);
    let found = fork.ended(state, alarm);
    Ok(Outcome { detected: in_time && state == Some("Damp"), after_ms, ..found })
}
