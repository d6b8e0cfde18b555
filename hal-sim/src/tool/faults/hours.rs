//! Hours of normal motion in which nothing may be raised: a false alarm drops a wearer as surely as a missed one.
//!
//! Complete drives, all noise, a wearer who pushes. Each stretch is a machine of its own, by its seed: enabled at the contacts,
//! identified, then moved along the gaits with whatever model came of it, over and over.

use rayon::prelude::*;
use scarab::leg::{Activity, ControlRequest};
use serde::Serialize;

use super::campaign::{BASE, begin};
use super::catalogue::JOINTS;
use super::rig::{PERIODS_PER_S, Rig};
use crate::description::PushDescription;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::pair::Context;
use crate::tool::report::Number;
use crate::tool::simulate::{DriveModel, SimulationOptions};

/// Of one stretch, s.
const STRETCH_S: u64 = 180;
/// A wearer who leans, kicks about and is carried along: up to a fifth of the torque cap.
const PUSHES: PushDescription = PushDescription { rate: 0.5, torque: 20.0, duration: 0.4 };

/// What was run, and what was raised.
#[derive(Clone, Debug, Serialize)]
pub struct HoursReport {
    /// Simulated.
    pub hours: Number,
    /// Machines, each by its seed from 1.
    pub stretches: usize,
    /// Of the wearer, N m.
    pub greatest_push_nm: f64,
    /// Mean number per minute.
    pub pushes_per_minute: f64,
    /// Raised although nothing was wrong: what, and where.
    pub false_alarms: Vec<String>,
}

impl HoursReport {
    /// Lines for a terminal.
    #[must_use]
    pub fn lines(&self) -> String {
        let hours = self.hours.known().unwrap_or(0.0);
        let mut text = format!(
            "normal motion: {hours:.2} hours in {} stretches, pushes of up to {} N m, {} per minute; false alarms: {}\n",
            self.stretches,
            self.greatest_push_nm,
            self.pushes_per_minute,
            self.false_alarms.len()
        );
        self.false_alarms.iter().for_each(|alarm| text.push_str(&format!("false alarm: {alarm}\n")));
        text
    }
}

/// So many hours, in stretches.
pub fn hours(leg: &LegFile, hours: f64) -> Result<HoursReport, ToolError> {
    let stretches = ((3600.0 * hours / STRETCH_S as f64).ceil() as u64).max(1);
    let length = (3600.0 * hours * PERIODS_PER_S as f64 / stretches as f64) as u64;
    let run = |seed: u64| stretch(leg, seed, length);
    let found = (1..=stretches).into_par_iter().map(run).collect::<Result<Vec<_>, _>>()?;
    let periods: u64 = found.iter().map(|(periods, _)| periods).sum();
    Ok(HoursReport {
        hours: (periods as f64 / PERIODS_PER_S as f64 / 3600.0).into(),
        stretches: found.len(),
        greatest_push_nm: PUSHES.torque,
        pushes_per_minute: 60.0 * PUSHES.rate,
        false_alarms: found.into_iter().filter_map(|(_, alarm)| alarm).collect(),
    })
}

/// Periods that were run, and what was raised.
fn stretch(leg: &LegFile, seed: u64, length: u64) -> Result<(u64, Option<String>), ToolError> {
    let options = SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::of_seed(seed) };
    let context = Context::<JOINTS, BASE>::new(leg, &options)?;
    let mut rig = Rig::new(leg, &context, seed)?;
    begin(leg, &mut rig)?;
    rig.world.set_pushes(Some(PUSHES));
    let gaits = context.motions.validation.map(|motion| context.configuration.prove(motion).ok());
    let (from, mut next) = (rig.period, 0_usize);
    while rig.period - from < length {
        rig.advance();
        if let Some(code) = rig.alarm() {
            let at = (rig.period - from) as f64 / PERIODS_PER_S as f64;
            let told = format!("seed {seed}, {at:.3} s: {}: {:?}", code.words(), rig.state());
            return Ok((rig.period - from, Some(told)));
        }
        if rig.leg.control().activity() == Activity::Idle && !rig.is_asked() {
            if let Some(motion) = gaits.get(next % gaits.len()).copied().flatten() {
                rig.ask(ControlRequest::Track { motion, with_model: true });
            }
            next += 1;
        }
    }
    Ok((rig.period - from, None))
}
