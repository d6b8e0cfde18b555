//! Emergency stops at all phases of the PWM period: at rest, in motion, during a calibration.
//!
//! Each stop starts from the same saved machine. The contact opens at a phase. Measured at the pins are the
//! time until both bridges are off, and whether one is on again afterwards.

use serde::Serialize;

use scarab_base::error::ToolError;

use crate::chip::STOP;
use crate::plant::{Reaction, STEP};
use crate::session::Session;
use crate::time::{microseconds, ticks};

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
    pub fn is_sound(&self) -> bool {
        self.situations.iter().all(Situation::is_sound)
    }
}

impl Situation {
    /// Whether a bridge was on at the stops, and all of them ended so.
    pub fn is_sound(&self) -> bool {
        let is_off = self.stayed_on == 0 && self.on_again == 0;
        self.armed > 0 && is_off && self.worst_final_us <= LONGEST_US
    }
}

/// Runs some stops from the end of a run, and returns to it; `None` if no bridge is on.
pub fn at_end(session: &mut Session) -> Result<Option<Situation>, ToolError> {
    if !session.chip().plant.axes.iter().any(|axis| axis.is_armed) {
        return Ok(None);
    }
    stops(session, "end of the run", PHASES).map(Some)
}

/// Runs `phases` stops in each situation, from a session that has just started.
///
/// # Errors
/// The image does not reach a situation.
pub fn run(session: &mut Session, phases: u32, time_factor: f64) -> Result<StopReport, ToolError> {
    let booted = session.machine.save()?;
    session.hold_switch(true);
    session.run(0.2)?;
    session.press_start()?;
    // The field of the first motor turns.
    session.run(3.5)?;
    let calibration = stops(session, "calibration", phases)?;
    session.machine.restore(&booted)?;
    session.enable_drive()?;
    let rest = stops(session, "rest", phases)?;
    session.press_start()?;
    session.run(6.0)?;
    let motion = stops(session, "motion", phases)?;
    Ok(StopReport { situations: vec![calibration, rest, motion], time_factor })
}

/// Runs stops from the present state, and returns to it.
fn stops(session: &mut Session, name: &'static str, phases: u32) -> Result<Situation, ToolError> {
    let saved = session.machine.save()?;
    let mut situation = Situation { name, phases, ..Situation::default() };
    let mut sum = 0.0;
    for phase in 0..phases {
        session.machine.restore(&saved)?;
        let begun = session.now() + STEP + u64::from(phase) * STEP / u64::from(phases);
        session.machine.run(begun)?;
        let opened = session.now();
        let chip = session.chip_mut();
        let mut reaction = Reaction::new(&chip.plant);
        if reaction.armed == [false; 2] {
            continue;
        }
        chip.plant.switchings.clear();
        chip.set_pin(STOP, false);
        session.machine.run(opened + ticks(WATCHED_S))?;
        situation.armed += 1;
        reaction.follow(&session.chip().plant.switchings);
        let Some(first) = reaction.released else {
            situation.stayed_on += 1;
            continue;
        };
        situation.stayed_on += u32::from(reaction.armed != [false; 2]);
        situation.on_again += u32::from(reaction.again > 0);
        situation.longest_again_us = situation.longest_again_us.max(microseconds(reaction.again));
        let first = microseconds(first - opened);
        sum += first;
        situation.worst_us = situation.worst_us.max(first);
        situation.worst_final_us = situation.worst_final_us.max(microseconds(reaction.last - opened));
    }
    situation.mean_us = sum / f64::from(situation.armed.max(1));
    session.machine.restore(&saved)?;
    Ok(situation)
}
