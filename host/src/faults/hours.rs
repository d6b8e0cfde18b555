//! Hours of normal motion in which no fault may be reported: a false alarm can drop a wearer, as a missed
//! fault can.
//!
//! Complete drives, all noise, a wearer who pushes. Each stretch is a machine with its own seed. The operator
//! enables it, it identifies, then repeats the gaits with the resulting model.

use hal_sim::description::PushDescription;
use rayon::prelude::*;
use scarab::leg::{Activity, ControlRequest};
use serde::{Deserialize, Serialize};

use crate::base::error::ToolError;
use crate::base::number::Number;
use crate::base::shard::Shard;
use crate::formats::leg_file::LegFile;
use crate::rig::faulty_board::{PERIODS_PER_S, Rig};
use crate::rig::operator::begin;
use crate::rig::options::{DriveModel, SimulationOptions};
use crate::rig::pair::Context;
use scarab::model::planar::BASE;
use scarab::model::planar::JOINTS;

/// Duration of one stretch, s.
const STRETCH_S: u64 = 180;
/// Pushes of a wearer who leans and kicks: up to a fifth of the torque cap.
const PUSHES: PushDescription = PushDescription { rate: 0.5, torque: 20.0, duration: 0.4 };

/// Result of the hours. Field names are part of the JSON interface.
#[derive(Clone, Debug, Serialize)]
pub struct HoursReport {
    /// Simulated hours.
    pub hours: Number,
    /// Number of machines; seeds from 1.
    pub stretches: usize,
    /// Largest push of the wearer, N m.
    pub greatest_push_nm: f64,
    /// Mean number of pushes per minute.
    pub pushes_per_minute: f64,
    /// Reported faults: code and time.
    pub false_alarms: Vec<String>,
}

/// Normal motion of one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// Periods of the motion.
    pub periods: u64,
    /// Reported fault, which ends it: code and time.
    pub alarm: Option<String>,
}

impl HoursReport {
    /// Report of all stretches.
    #[must_use]
    pub fn new(stretches: &[Stretch]) -> Self {
        let periods: u64 = stretches.iter().map(|stretch| stretch.periods).sum();
        Self {
            hours: (periods as f64 / PERIODS_PER_S as f64 / 3600.0).into(),
            stretches: stretches.len(),
            greatest_push_nm: PUSHES.torque,
            pushes_per_minute: 60.0 * PUSHES.rate,
            false_alarms: stretches.iter().filter_map(|stretch| stretch.alarm.clone()).collect(),
        }
    }

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

/// Simulates the shard's stretches of the hours.
pub fn hours(leg: &LegFile, hours: f64, shard: Shard) -> Result<Vec<Stretch>, ToolError> {
    let stretches = ((3600.0 * hours / STRETCH_S as f64).ceil() as u64).max(1);
    let length = (3600.0 * hours * PERIODS_PER_S as f64 / stretches as f64) as u64;
    let seeds: Vec<u64> = (1..=stretches).collect();
    shard.part(&seeds).par_iter().map(|seed| stretch(leg, *seed, length)).collect()
}

/// Runs one stretch.
fn stretch(leg: &LegFile, seed: u64, length: u64) -> Result<Stretch, ToolError> {
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
            let alarm_text = format!("seed {seed}, {at:.3} s: {}: {:?}", code.words(), rig.state());
            return Ok(Stretch { periods: rig.period - from, alarm: Some(alarm_text) });
        }
        if rig.leg.control().activity() == Activity::Idle && !rig.is_requested() {
            if let Some(motion) = gaits.get(next % gaits.len()).copied().flatten()
                && rig.leg.set_tracked(motion)
            {
                rig.ask(ControlRequest::Track { with_model: true });
            }
            next += 1;
        }
    }
    Ok(Stretch { periods: rig.period - from, alarm: None })
}
