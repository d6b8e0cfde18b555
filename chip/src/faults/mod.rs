//! Faults of the campaign's catalogue, injected into the chip's pins, converters, memory and flash. The image
//! is unmodified.
//!
//! Each run starts from a saved machine: booted, holding its pose, following the exciting motion, following a
//! host, or searching. Instant and magnitude are drawn from the seed. Deadlines are measured at the pins:
//! release of both bridges, or the active short circuit (no high side for a PWM period). Damping lasts
//! exactly 300 ms and ends with both bridges off, so it began that much before.

mod bus;
mod memory;
mod random_sessions;
mod rows;
mod search;
mod stored;
mod wiring;

use std::rc::Rc;

use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;

use scarab_base::error::ToolError;
use scarab_rig::faults::catalogue::Fault;

use crate::chip::Chip;
use crate::load::CURRENT_INTERRUPT;
use crate::machine::Snapshot;
use crate::plant::{JOINTS, Reaction, STEP};
use crate::session::Session;
use crate::time::{Ticks, microseconds, seconds, ticks};

/// Longest time that is watched, s.
const WATCHED_S: f64 = 0.5;
/// Duration of damping, s.
const DAMP_S: f64 = 0.3;
/// PWM period, s.
const PERIOD_S: f64 = 1.0 / 24e3;
/// Longest delay of a current tick beside other work, s: 5 % of a period.
const JITTER_S: f64 = 0.05 * PERIOD_S;

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

/// The injection.
type Inject = fn(&mut Chip, &mut Xoshiro256PlusPlus);

/// One injection.
struct Injected {
    situation: Situation,
    expected: Expected,
    inject: Inject,
    later: Option<Later>,
}

/// Time of the reaction or the like, s, or what went wrong.
type Verdict = Result<f64, String>;

/// Run of a seed.
type OwnRun = fn(&mut Machines<'_>, u64) -> Result<Verdict, ToolError>;

/// How a row runs.
enum Run {
    Injected(Injected),
    Own(OwnRun),
}

/// Row of the catalogue.
struct Row {
    fault: &'static Fault,
    /// The case that is injected, if not all of the fault.
    case: Option<&'static str>,
    /// Longest time of the verdict at the pins from the injection on, s, where it is not the catalogue's,
    /// which begins when the fault can be seen.
    within_s: Option<f64>,
    run: Run,
}

impl Row {
    /// Longest time of the verdict, s, if it is a time.
    fn deadline_s(&self) -> Option<f64> {
        if matches!(&self.run, Run::Injected(injected) if injected.expected == Expected::Nothing) {
            return None;
        }
        let finite = self.fault.deadline_ms.is_finite().then_some(1e-3 * self.fault.deadline_ms);
        self.within_s.or(finite)
    }
}

/// Result of one row.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RowReport {
    /// Number in the catalogue.
    pub id: &'static str,
    pub fault: &'static str,
    pub runs: u32,
    /// Runs without the expected reaction in time.
    pub missed: u32,
    /// Deadline, ms; 0 if the verdict is not a time.
    pub deadline_ms: f64,
    /// Slowest reaction, ms.
    pub worst_ms: f64,
    pub complaints: Vec<String>,
}

/// Runs all rows, or the named ones, from a session that has just started.
///
/// # Errors
/// The image does not reach a situation, or the model does not know what the processor does.
pub fn run(session: &mut Session, seeds: u32, only: &[String]) -> Result<Vec<RowReport>, ToolError> {
    let mut machines = Machines::new(session)?;
    let mut reports = Vec::new();
    for row in rows::ROWS.iter().filter(|row| only.is_empty() || only.iter().any(|id| id == row.fault.id)) {
        let mut report = RowReport {
            id: row.fault.id,
            fault: row.case.unwrap_or(row.fault.fault),
            runs: seeds,
            deadline_ms: 1e3 * row.deadline_s().unwrap_or(0.0),
            ..RowReport::default()
        };
        for seed in 0..u64::from(seeds) {
            let verdict = match &row.run {
                Run::Injected(injected) => machines.inject(injected, seed)?,
                Run::Own(run) => run(&mut machines, seed)?,
            };
            let verdict = match verdict {
                // A nanosecond is below the resolution of the model's time.
                Ok(at) if row.deadline_s().is_some_and(|deadline| at > deadline + 1e-9) => {
                    Err(format!("too late, after {:.4} ms", 1e3 * at))
                }
                verdict => verdict,
            };
            match verdict {
                Ok(at) => report.worst_ms = report.worst_ms.max(1e3 * at),
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

/// A session with the machines from which runs start; each is made when the first run asks for it.
struct Machines<'a> {
    session: &'a mut Session,
    booted: Snapshot,
    resting: Option<Rc<Snapshot>>,
    /// Records of the calibration before the resting machine.
    calibrations: Vec<String>,
    moving: Option<Rc<Snapshot>>,
    searching: Option<Rc<Snapshot>>,
    hosted: Option<Rc<bus::Hosted>>,
    stored: Option<Rc<stored::Stored>>,
    constants: Option<Rc<Vec<memory::Constant>>>,
    unshifted: Option<Rc<wiring::Unshifted>>,
}

impl<'a> Machines<'a> {
    fn new(session: &'a mut Session) -> Result<Self, ToolError> {
        let booted = session.machine.save()?;
        Ok(Self {
            session,
            booted,
            resting: None,
            calibrations: Vec::new(),
            moving: None,
            searching: None,
            hosted: None,
            stored: None,
            constants: None,
            unshifted: None,
        })
    }

    /// The drive is enabled by its operator and holds its pose.
    fn resting(&mut self) -> Result<Rc<Snapshot>, ToolError> {
        if let Some(resting) = &self.resting {
            return Ok(Rc::clone(resting));
        }
        self.session.machine.restore(&self.booted)?;
        let from = self.session.probe.lines.len();
        self.session.enable_drive()?;
        let records = self.session.probe.lines[from..].iter().map(|(_, line)| line);
        self.calibrations = records.filter(|line| line.starts_with("calibration ")).cloned().collect();
        Ok(Rc::clone(self.resting.insert(Rc::new(self.session.machine.save()?))))
    }

    /// The exciting motion of an identification.
    fn moving(&mut self) -> Result<Rc<Snapshot>, ToolError> {
        if let Some(moving) = &self.moving {
            return Ok(Rc::clone(moving));
        }
        let resting = self.resting()?;
        self.session.machine.restore(&resting)?;
        self.session.press_start()?;
        self.session.run(6.0)?;
        Ok(Rc::clone(self.moving.insert(Rc::new(self.session.machine.save()?))))
    }

    fn inject(&mut self, injected: &Injected, seed: u64) -> Result<Verdict, ToolError> {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
        let saved = match injected.situation {
            Situation::Rest => self.resting()?,
            Situation::Motion => self.moving()?,
        };
        let spread = if injected.situation == Situation::Motion { ticks(0.5) } else { ticks(10e-3) };
        let begun = begin(self.session, &saved, random.next_u64() % spread)?;
        let records = self.session.probe.lines.len();
        (injected.inject)(self.session.chip_mut(), &mut random);
        self.session.chip_mut().reschedule();
        let seen = watch(self.session, injected.expected, injected.later, begun, records)?;
        Ok(judge(injected.expected, &seen))
    }
}

/// Returns to a saved machine, runs on for a time and records the bridges from then on; returns the instant.
fn begin(session: &mut Session, saved: &Snapshot, delay: Ticks) -> Result<Ticks, ToolError> {
    session.machine.restore(saved)?;
    session.run_until(saved.chip.now + delay)?;
    session.chip_mut().plant.switchings.clear();
    session.begin_measurement();
    Ok(session.now())
}

/// Longest delay of a current tick since [`begin`], s; an error if one was lost.
fn jitter(session: &Session) -> Verdict {
    let chip = session.chip();
    let lost = chip.lost_conversions();
    if lost > 0 {
        return Err(format!("{lost} conversions were lost"));
    }
    Ok(1e-6 * microseconds(chip.load.usage(CURRENT_INTERRUPT).latency))
}

/// Reaction seen at the pins and in the records.
#[derive(Debug, Default)]
struct Seen {
    released: Option<f64>,
    shorted: Option<f64>,
    /// First record of a fault, as the probe reads it.
    recorded: Option<f64>,
    on_again: bool,
}

fn watch(
    session: &mut Session,
    expected: Expected,
    mut later: Option<Later>,
    begun: Ticks,
    records: usize,
) -> Result<Seen, ToolError> {
    let (mut seen, mut count) = (Seen::default(), 0);
    let mut reaction = Reaction::new(&session.chip().plant);
    let longest = if expected == Expected::Damped { WATCHED_S + DAMP_S } else { WATCHED_S };
    while session.now() < begun + ticks(longest) {
        session.run_until(session.now() + STEP)?;
        let now = session.now();
        if let Some(step) = later {
            later = step(session, now - begun, count).then_some(step);
            count += 1;
        }
        let plant = &mut session.chip_mut().plant;
        reaction.follow(&core::mem::take(&mut plant.switchings));
        seen.released = reaction.released.map(|at| seconds(at - begun));
        seen.on_again = reaction.on_again;
        let high = plant.axes.iter().map(|axis| axis.last_high).max().unwrap_or(now);
        if reaction.armed != [false; JOINTS] && now > high + 2 * STEP && seen.shorted.is_none() {
            seen.shorted = Some(seconds(high.saturating_sub(begun)));
        }
        if seen.recorded.is_none()
            && let Some((at, _)) =
                session.probe.lines[records..].iter().find(|(_, line)| line.starts_with("fault "))
        {
            seen.recorded = Some(seconds(at - begun));
        }
        let settled = later.is_none() && expected != Expected::Nothing;
        if settled && seen.released.is_some_and(|at| seconds(now - begun) > at + 5e-3) {
            break;
        }
    }
    Ok(seen)
}

fn judge(expected: Expected, seen: &Seen) -> Verdict {
    let reaction = match expected {
        Expected::Nothing if seen.released.or(seen.shorted).or(seen.recorded).is_none() => return Ok(0.0),
        Expected::Nothing => return Err(format!("reacted without need: {seen:?}")),
        Expected::Released => seen.released,
        Expected::Shorted => [seen.released, seen.shorted].into_iter().flatten().reduce(f64::min),
        Expected::Damped => seen.released.map(|at| if is_damped(seen, at) { at - DAMP_S } else { at }),
    };
    match reaction {
        None => Err(format!("no reaction: {seen:?}")),
        Some(_) if seen.on_again => Err(format!("a bridge was on again: {seen:?}")),
        Some(at) => Ok(at),
    }
}

/// Whether a fault was recorded as long before the release as damping lasts.
fn is_damped(seen: &Seen, released: f64) -> bool {
    released > DAMP_S && seen.recorded.is_some_and(|at| at < released - 0.5 * DAMP_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reaction_is_judged_by_its_kind() {
        let seen = |released, recorded| Seen { released, recorded, ..Seen::default() };
        assert_eq!(judge(Expected::Released, &seen(Some(2e-3), None)), Ok(2e-3));
        assert!(judge(Expected::Released, &seen(None, Some(1e-3))).is_err());
        // Damping began before its release; without a record of it the release itself counts.
        let damped = judge(Expected::Damped, &seen(Some(0.3005), Some(2e-3))).expect("damped");
        assert!((damped - 0.5e-3).abs() < 1e-9);
        assert_eq!(judge(Expected::Damped, &seen(Some(0.35), None)), Ok(0.35));
        assert_eq!(judge(Expected::Damped, &seen(Some(2e-3), Some(2e-3))), Ok(2e-3));
        assert_eq!(judge(Expected::Nothing, &Seen::default()), Ok(0.0));
        assert!(judge(Expected::Nothing, &seen(None, Some(1e-3))).is_err());
        let again = Seen { on_again: true, ..seen(Some(1e-3), None) };
        assert!(judge(Expected::Released, &again).is_err());
    }

    #[test]
    fn rows_of_every_part_of_the_board_are_injected() {
        // F1 has its own command (`store-cuts`).
        let expected =
            "E1 E2 E3 E4 E5 C1 C2 C3 C4 P1 P2 V1 V2 T1 X1 X2 X3 K1 K2 K3 K4 K5 B1 B2 B3 B4 F2 F3 M1 M2";
        for id in expected.split(' ') {
            assert!(rows::ROWS.iter().any(|row| row.fault.id == id), "{id}");
        }
        for row in rows::ROWS {
            let Run::Injected(injected) = &row.run else { continue };
            assert_eq!(
                row.deadline_s().is_some(),
                injected.expected != Expected::Nothing,
                "{}",
                row.fault.id
            );
        }
    }
}
