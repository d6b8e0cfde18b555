//! Hours of normal motion in which no fault may be reported: a false alarm can drop a wearer, as a missed
//! fault can.
//!
//! Complete drives, all noise. Each stretch is a machine with its own seed. With an odd one the operator
//! enables it, it identifies, then repeats the gaits with the resulting model, and a wearer pushes. With an
//! even one a host shakes it in cyclic torque: a wave of 1 to 500 Hz for each joint, another one each second.

use core::f64::consts::TAU;

use hal_sim::description::PushDescription;
use rayon::prelude::*;
use scarab::bus::Frame;
use scarab::leg::{Activity, ControlRequest};
use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_base::random::Random;
use scarab_base::shard::Shard;
use scarab_identify::formats::leg_file::LegFile;
use serde::{Deserialize, Serialize};

use crate::bus::board::{Board, Label, TICK_NS};
use crate::bus::host::{Host, NODES};
use crate::faulty_board::{PERIODS_PER_S, Rig};
use crate::operator::begin;
use crate::pair::Context;
use crate::parameter_file::memory::Memory;
use scarab::model::planar::{BASE, JOINTS};

/// Duration of one stretch, s.
const STRETCH_S: u64 = 180;
/// Received PDO of the target torque, without the node-ID; servo ticks per cycle of the host, and cycles per
/// wave.
const TORQUES: u16 = 0x500;
const CYCLE: u64 = 4;
const WAVE: u64 = 1000;
/// Frequencies of the waves, Hz, and amplitudes, thousandths of the torque cap.
const FREQUENCIES: [f64; 2] = [1.0, 500.0];
const AMPLITUDES: [f64; 2] = [20.0, 1000.0];
/// Torque that a shaken leg reaches at least, N m.
const LEAST_NM: f32 = 1.0;
/// Pushes of a wearer who leans and kicks: up to a fifth of the torque cap.
const PUSHES: PushDescription = PushDescription { rate: 0.5, torque: 20.0, duration: 0.4 };

/// Result of the hours. Field names are part of the JSON interface.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct HoursReport {
    /// Simulated hours.
    pub(crate) hours: Number,
    /// Number of machines; seeds from 1.
    pub(crate) stretches: usize,
    /// Those of them that a host shakes by torque.
    pub(crate) shaken: usize,
    /// Largest push of the wearer, N m.
    pub(crate) greatest_push_nm: f64,
    /// Mean number of pushes per minute.
    pub(crate) pushes_per_minute: f64,
    /// Reported faults: code and time.
    pub(crate) false_alarms: Vec<String>,
}

/// Normal motion of one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// Periods of the motion.
    pub(crate) periods: u64,
    /// Whether a host shakes the machine by torque.
    pub(crate) is_shaken: bool,
    /// Reported fault, which ends it: code and time.
    pub(crate) alarm: Option<String>,
}

impl HoursReport {
    /// Report of all stretches.
    pub fn new(stretches: &[Stretch]) -> Self {
        let periods: u64 = stretches.iter().map(|stretch| stretch.periods).sum();
        Self {
            hours: (periods as f64 / PERIODS_PER_S as f64 / 3600.0).into(),
            stretches: stretches.len(),
            shaken: stretches.iter().filter(|stretch| stretch.is_shaken).count(),
            greatest_push_nm: PUSHES.torque,
            pushes_per_minute: 60.0 * PUSHES.rate,
            false_alarms: stretches.iter().filter_map(|stretch| stretch.alarm.clone()).collect(),
        }
    }

    /// Lines for a terminal.
    pub fn lines(&self) -> String {
        let hours = self.hours.known().unwrap_or(0.0);
        let mut text = format!(
            "normal motion: {hours:.2} hours in {} stretches, {} of them shaken by a host, the others with pushes of up to {} N m, {} per minute; \
             false alarms: {}\n",
            self.stretches,
            self.shaken,
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
    let stretches = ((3600.0 * hours / STRETCH_S as f64).ceil() as u64).max(2);
    let length = (3600.0 * hours * PERIODS_PER_S as f64 / stretches as f64) as u64;
    let seeds: Vec<u64> = (1..=stretches).collect();
    shard
        .part(&seeds)
        .par_iter()
        .map(|seed| if seed % 2 == 0 { shaken(leg, *seed, length) } else { pushed(leg, *seed, length) })
        .collect()
}

/// Text of the fault that ends a stretch, if there is one.
fn alarm(rig: &Rig<JOINTS, BASE>, seed: u64, from: u64) -> Option<String> {
    let at = (rig.period - from) as f64 / PERIODS_PER_S as f64;
    rig.alarm().map(|code| format!("seed {seed}, {at:.3} s: {}: {:?}", code.words(), rig.state()))
}

/// Torque of a host for one joint, thousandths of the cap.
struct Wave {
    frequency_hz: f64,
    amplitude: f64,
    is_square: bool,
}

impl Wave {
    fn new(random: &mut Random) -> Self {
        let [lowest, highest] = FREQUENCIES;
        let [least, most] = AMPLITUDES;
        Self {
            frequency_hz: random.logarithmic(lowest, highest),
            amplitude: random.logarithmic(least, most),
            is_square: random.coin(),
        }
    }

    fn at(&self, seconds: f64) -> i16 {
        let sine = (TAU * self.frequency_hz * seconds + 1e-6).sin();
        (self.amplitude * if self.is_square { sine.signum() } else { sine }) as i16
    }
}

/// Runs a stretch with a host that shakes the leg.
fn shaken(leg: &LegFile, seed: u64, length: u64) -> Result<Stretch, ToolError> {
    let context = Context::with_complete_drives(leg, seed)?;
    let mut host = Host::new(Board::new(leg, context, seed, Label::SINGLE, Memory::new(None))?);
    host.begin()?;
    host.move_leg(leg)?;
    host.speaks.set_cycle(false);
    host.write_both(0x6060, 10, 1)?;
    let mut random = Random::new("shaken", seed);
    let mut waves = [0; JOINTS].map(|_| Wave::new(&mut random));
    let (from, mut cycle) = (host.rig().period, 0);
    let (mut found, mut greatest) = (None, 0.0_f32);
    while host.rig().period - from < length && found.is_none() {
        if cycle % WAVE == 0 {
            waves = waves.map(|_| Wave::new(&mut random));
        }
        let seconds = (cycle * CYCLE * TICK_NS) as f64 * 1e-9;
        for (node, wave) in NODES.into_iter().zip(&waves) {
            host.network.send(Frame::new(TORQUES + node, &wave.at(seconds).to_le_bytes()));
        }
        host.run(CYCLE);
        cycle += 1;
        found = alarm(host.rig(), seed, from);
        if found.is_none() && !host.is_enabled() {
            found = Some(format!("seed {seed}: no longer enabled: {:?}", host.rig().state()));
        }
        let torque = host.rig().output.as_ref().map_or(0.0, |output| output.servo.decision.torque[0].0);
        greatest = torque.abs().max(greatest);
    }
    if found.is_none() && greatest < LEAST_NM {
        found = Some(format!("seed {seed}: hardly shaken, by {greatest} N m"));
    }
    Ok(Stretch { periods: host.rig().period - from, is_shaken: true, alarm: found })
}

/// Runs a stretch with a wearer who pushes.
fn pushed(leg: &LegFile, seed: u64, length: u64) -> Result<Stretch, ToolError> {
    let context = Context::<JOINTS, BASE>::with_complete_drives(leg, seed)?;
    let mut rig = Rig::new(leg, &context, seed)?;
    begin(leg, &mut rig)?;
    rig.world.set_pushes(Some(PUSHES));
    let gaits = context.motions.validation.map(|motion| context.configuration.prove(motion).ok());
    let (from, mut next) = (rig.period, 0_usize);
    while rig.period - from < length {
        rig.advance();
        let found = alarm(&rig, seed, from);
        if found.is_some() {
            return Ok(Stretch { periods: rig.period - from, is_shaken: false, alarm: found });
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
    Ok(Stretch { periods: rig.period - from, is_shaken: false, alarm: None })
}
