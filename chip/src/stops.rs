//! Emergency stops at all phases of the PWM period: at rest, in motion, during a calibration.
//!
//! Each stop starts from the same saved machine. The contact opens at a phase. Measured at the pins are the
//! time until both bridges are off, and whether one is on again afterwards.

use serde::Serialize;

use scarab_base::error::ToolError;

use crate::chip::STOP;
use crate::machine::Snapshot;
use crate::plant::{STEP, Switching};
use crate::session::{Session, Step};
use crate::time::{Ticks, microseconds, ticks};

/// Observed time after the contact opened, s.
const WATCHED_S: f64 = 2e-3;
/// Longest time until both bridges are permanently off, us, at up to two cycles per instruction. A tick alone
/// takes up to a PWM period of 42 us.
const LONGEST_US: f64 = 1.0;
/// Stops at the end of a run.
const PHASES: u32 = 20;

/// Stops in one situation.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Situation {
    pub name: &'static str,
    /// Phases at which the contact opened.
    pub phases: u32,
    /// Stops at which a bridge was on.
    pub armed: u32,
    /// Stops after which a bridge stayed on.
    pub stayed_on: u32,
    /// Stops after which a bridge was on again.
    pub on_again: u32,
    /// Longest time for which a bridge was on again, us.
    pub longest_again_us: f64,
    /// Mean time until both bridges were first off, us.
    pub mean_us: f64,
    /// Worst time until both bridges were first off, us.
    pub worst_us: f64,
    /// Worst time until both bridges were permanently off, us.
    pub worst_final_us: f64,
}

/// Stops in all situations.
#[derive(Clone, Debug, Default, Serialize)]
pub struct StopReport {
    pub situations: Vec<Situation>,
    /// Cycles per instruction.
    pub time_factor: f64,
}

impl StopReport {
    /// Whether every stop turned both bridges off by its own interrupt, not by a later tick.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.situations.iter().all(Situation::is_sound)
    }
}

impl Situation {
    /// Whether a bridge was on at the stops, and all of them ended so.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let is_off = self.stayed_on == 0 && self.on_again == 0;
        self.armed > 0 && is_off && self.worst_final_us <= LONGEST_US
    }
}

/// Runs some stops from the end of a run, and returns to it; `None` if no bridge is on.
pub fn at_end(session: &mut Session) -> Result<Option<Situation>, ToolError> {
    if !session.machine.chip().plant.axes.iter().any(|axis| axis.is_armed()) {
        return Ok(None);
    }
    let saved = session.save()?;
    let situation = stops(session, "end of the run", &saved, PHASES)?;
    session.machine.restore(&saved)?;
    Ok(Some(situation))
}

/// Runs `phases` stops in each situation, from a session that has just started.
///
/// # Errors
/// The image does not reach a situation.
pub fn run(session: &mut Session, phases: u32, time_factor: f64) -> Result<StopReport, ToolError> {
    let mut report = StopReport { situations: Vec::new(), time_factor };
    let booted = session.save()?;
    session.hold_switch(true);
    session.run(0.2)?;
    session.press_start()?;
    // The field of the first motor turns.
    session.run(3.5)?;
    let calibrating = session.save()?;
    report.situations.push(stops(session, "calibration", &calibrating, phases)?);
    session.machine.restore(&booted)?;
    for step in [Step::Calibrate, Step::Reference, Step::Enable] {
        session.step(step)?;
    }
    let resting = session.save()?;
    report.situations.push(stops(session, "rest", &resting, phases)?);
    session.machine.restore(&resting)?;
    session.press_start()?;
    session.run(6.0)?;
    let moving = session.save()?;
    report.situations.push(stops(session, "motion", &moving, phases)?);
    session.machine.restore(&resting)?;
    Ok(report)
}

/// Runs stops from a saved machine.
fn stops(
    session: &mut Session,
    name: &'static str,
    saved: &Snapshot,
    phases: u32,
) -> Result<Situation, ToolError> {
    let mut situation = Situation { name, phases, ..Situation::default() };
    let mut sum = 0.0;
    for phase in 0..phases {
        session.machine.restore(saved)?;
        let begun = session.now() + STEP + u64::from(phase) * STEP / u64::from(phases);
        session.machine.run(begun)?;
        let opened = session.now();
        let chip = session.machine.chip_mut();
        let mut armed = [0, 1].map(|axis| chip.plant.axes[axis].is_armed());
        if armed == [false; 2] {
            continue;
        }
        chip.plant.switchings = Some(Vec::new());
        chip.set_pin(STOP, false);
        session.machine.run(opened + ticks(WATCHED_S))?;
        let switchings = session.machine.chip_mut().plant.switchings.take().unwrap_or_default();
        situation.armed += 1;
        let outcome = Outcome::from_switchings(&mut armed, &switchings);
        let Some(first) = outcome.first else {
            situation.stayed_on += 1;
            continue;
        };
        situation.stayed_on += u32::from(armed != [false; 2]);
        situation.on_again += u32::from(outcome.again > 0);
        situation.longest_again_us = situation.longest_again_us.max(microseconds(outcome.again));
        let first = microseconds(first - opened);
        sum += first;
        situation.worst_us = situation.worst_us.max(first);
        situation.worst_final_us = situation.worst_final_us.max(microseconds(outcome.last - opened));
    }
    situation.mean_us = sum / f64::from(situation.armed.max(1));
    Ok(situation)
}

/// Result of a stop.
struct Outcome {
    /// First instant with both bridges off, and the last.
    first: Option<Ticks>,
    last: Ticks,
    /// Time for which a bridge was on again.
    again: Ticks,
}

impl Outcome {
    fn from_switchings(armed: &mut [bool; 2], switchings: &[Switching]) -> Self {
        let mut outcome = Self { first: None, last: 0, again: 0 };
        let mut on_since = None;
        for switching in switchings {
            armed[switching.axis] = switching.on;
            if *armed == [false; 2] {
                outcome.first = outcome.first.or(Some(switching.at));
                outcome.last = switching.at;
                if let Some(since) = on_since.take() {
                    outcome.again = outcome.again.max(switching.at - since);
                }
            } else if outcome.first.is_some() {
                on_since = on_since.or(Some(switching.at));
            }
        }
        outcome
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bridge_that_is_on_again_is_detected_with_its_time() {
        let switching = |at, axis, on| Switching { at, axis, on };
        let mut armed = [true; 2];
        let log = [
            switching(100, 0, false),
            switching(110, 1, false),
            switching(200, 0, true),
            switching(230, 0, false),
        ];
        let outcome = Outcome::from_switchings(&mut armed, &log);
        assert_eq!((outcome.first, outcome.last, outcome.again, armed), (Some(110), 230, 30, [false; 2]));
        let outcome = Outcome::from_switchings(&mut [true; 2], &log[..1]);
        assert_eq!(outcome.first, None);
    }
}
