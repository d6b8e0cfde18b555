//! Many runs, forked from identifications that the operator's contacts started, or from sessions of
//! assistance of a leg whose file states one ([`Worn`]).
//!
//! Forks share their base: it runs once, and every run is a clone of it at the run's period. The base of a
//! run follows from the run's seed, so that one run can be repeated alone. A row that is run in two ways uses
//! forks for odd seeds and its bench for even ones.
//!
//! A shard takes neighbouring seeds, so it runs few bases ([`Shard`]).

use hal_sim::faults::{Channel, Form, Timing};
use hal_sim::world::TICK_S;
use hal_sim::world::periods::PERIODS_PER_TICK;
use rayon::prelude::*;
use scarab::leg::{Activity, ControlRequest};
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_base::shard::Shard;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::leg::exercise::Exercise;

use crate::faults::bench::offsets::OFFSETS;
use crate::faults::bounds::bounds;
use crate::faults::catalogue;
use crate::faults::detectors::views;
use crate::faults::draw::{at, one};
use crate::faults::entry::Entry;
use crate::faults::forks::stop::emergency_stop;
use crate::faults::results::{Base, Campaign};
use crate::faults::run::{Manner, Outcome, run};
use crate::faults::scenario::{Bounds, Expected, Row, Scenario};
use crate::faults::trial::Trial;
use crate::faulty_board::{PERIODS_PER_S, Rig};
use crate::operator::begin;
use crate::pair::{Context, Pair};
use crate::worn::{CADENCE_HZ, Worn};
use scarab::model::planar::{BASE, JOINTS};

/// Runs of a row per base.
const RUNS_PER_BASE: u64 = 256;
/// Row of the torque caps, and the factor by which they are widened when disabled.
pub(super) const CAPPED: &str = "H1";
const WIDENED: f32 = 3.0;
/// Periods of a session in which faults are injected: the fade-in, the oscillators' learning, and steady
/// walking.
const WORN_LENGTH: u64 = 20 * PERIODS_PER_S;
/// Forks per batch, about 100 KB each.
const BATCH: usize = 128;
/// Longest identification, s.
const LONGEST_S: f64 = 300.0;

/// Options of a campaign.
#[derive(Clone, Debug)]
pub struct CampaignOptions {
    /// Rows to run.
    pub rows: Vec<Entry>,
    /// Seeds of the runs.
    pub seeds: Vec<u64>,
    /// Runs the emergency stop also at every servo tick, and at every current tick of one second.
    pub every_tick: bool,
    /// Disabled detectors and recorded curves.
    pub manner: Manner,
    /// Seeds of the sweep's runs.
    pub sweep: Vec<u64>,
    /// Seeds of the runs of two faults at once.
    pub pairs: Vec<u64>,
    /// Runs finite rows completely: all 65,536 offsets of E3.
    pub whole: bool,
    /// Limit on the part of each identification that is used, s.
    pub seconds: Option<f64>,
    /// Part of each list of seeds, and of the ticks of the emergency stop, that is run.
    pub shard: Shard,
}

/// Task for a fork.
#[expect(clippy::large_enum_variant, reason = "some hundreds of them beside forks of 100 KB each")]
enum Job {
    Row { row: &'static Row, scenario: Scenario, seed: u64, manner: Manner },
    Trial { trial: Box<Trial>, seed: u64 },
}

impl Job {
    fn order(&self) -> (&'static str, u64) {
        match self {
            Self::Row { row, seed, .. } => (row.fault.id, *seed),
            Self::Trial { seed, .. } => ("-", *seed),
        }
    }
}

struct Setting<'a> {
    leg: &'a LegFile,
    bounds: Bounds,
    manner: Manner,
    /// The torque caps are widened.
    widened: bool,
    /// Periods of a whole identification.
    length: u64,
}

/// Runs a campaign, or its shard.
pub fn campaign(leg: &LegFile, whole: &CampaignOptions) -> Result<Campaign, ToolError> {
    let bounds = bounds(leg)?;
    let shard = whole.shard;
    let part = |seeds: &[u64]| shard.part(seeds).to_vec();
    let [seeds, sweep, pairs] = [&whole.seeds, &whole.sweep, &whole.pairs].map(|seeds| part(seeds));
    let options = &CampaignOptions { seeds, sweep, pairs, ..whole.clone() };
    let ids: Vec<&str> = options.rows.iter().map(|entry| entry.fault().id).collect();
    let twice = |id: &str| ids.iter().filter(|other| **other == id).count() > 1;
    let seeds = options.seeds.iter().chain(&options.sweep).chain(&options.pairs);
    let mut bases: Vec<u64> = seeds.map(|seed| base_of(*seed)).collect();
    if options.every_tick {
        bases.push(base_of(1));
    }
    bases.sort_unstable();
    bases.dedup();
    // Limits are disabled by widening them at creation, so their row has a base of its own.
    let ways: &[bool] = if options.manner.is_blind() { &[false, true] } else { &[false] };
    let bases: Vec<(u64, bool)> =
        bases.iter().flat_map(|base| ways.iter().map(|widened| (*base, *widened))).collect();
    let found: Vec<Campaign> = bases
        .par_iter()
        .map(|(base, widened)| based(leg, options, bounds, &twice, *base, *widened))
        .collect::<Result<_, _>>()?;
    let mut campaign = Campaign::default();
    found.into_iter().for_each(|found| campaign.add(found));
    for entry in &options.rows {
        if let Entry::Bench(bench) = entry {
            let halved = twice(bench.fault.id);
            let seeds: Vec<u64> = if options.whole && bench.fault.id == "E3" {
                part(&(1..=OFFSETS).collect::<Vec<_>>())
            } else {
                options.seeds.iter().copied().filter(|seed| !halved || seed.is_multiple_of(2)).collect()
            };
            if !seeds.is_empty() {
                campaign.outcomes.extend((bench.run)(bench.fault, leg, &seeds, options.manner.is_blind())?);
            }
        }
    }
    Ok(campaign)
}

/// Runs all forks of one base.
fn based(
    leg: &LegFile,
    options: &CampaignOptions,
    bounds: Bounds,
    twice: &(dyn Fn(&str) -> bool + Sync),
    base: u64,
    widened: bool,
) -> Result<Campaign, ToolError> {
    let mut campaign = Campaign::default();
    let every = options.every_tick && base == base_of(1);
    // The leg file's `assist` states the shares, and the start button begins the session.
    let wearer = Exercise::Gait(CADENCE_HZ);
    let worn = leg.assist.map(|_| Worn::new::<BASE>(leg, wearer, base)).transpose()?;
    let leg = worn.as_ref().map_or(leg, |worn| &worn.exoskeleton);
    let context = context(leg, base, widened)?;
    let whole = if worn.is_some() { WORN_LENGTH } else { length(leg, &context, base)? };
    let shortened = |seconds: f64| whole.min((seconds * PERIODS_PER_S as f64) as u64).max(1);
    let length = options.seconds.map_or(whole, shortened);
    let setting = Setting { leg, bounds, manner: options.manner, widened, length };
    let mut jobs = setting.jobs(options, twice, base);
    let mut stops = if every { stops(length) } else { Vec::new() };
    let last_of_all = stops.last().copied();
    stops = options.shard.part(&stops).to_vec();
    if jobs.is_empty() && stops.is_empty() {
        return Ok(campaign);
    }
    let mut rig = Rig::new(leg, &context, base)?;
    worn.as_ref().map_or(Ok(()), |worn| worn.dress(&mut rig))?;
    begin(leg, &mut rig)?;
    worn.as_ref().map_or(Ok(()), |worn| worn.walk(&mut rig))?;
    jobs.sort_by_key(|(period, job)| (*period, job.order()));
    // The shard with the last stop runs the identification to its end.
    let last_stop = stops.last().copied().map(|stop| if Some(stop) == last_of_all { length } else { stop });
    let last = jobs.last().map_or(0, |(period, _)| *period).max(last_stop.unwrap_or(0));
    let from = rig.period;
    let (mut jobs, mut stops) = (jobs.into_iter().peekable(), stops.into_iter().peekable());
    let mut batch: Vec<(Rig<JOINTS, BASE>, Job)> = Vec::with_capacity(BATCH);
    let mut alarm = None;
    while rig.period - from <= last {
        while let Some((_, job)) = jobs.next_if(|(period, _)| from + period <= rig.period) {
            batch.push((rig.clone(), job));
        }
        if stops.next_if(|stop| *stop <= rig.period - from).is_some() {
            batch.push((rig.clone(), setting.stop(rig.period)));
            campaign.every_tick += 1;
        }
        if batch.len() >= BATCH {
            setting.flush(&mut batch, &mut campaign);
        }
        rig.advance();
        if let Some(code) = rig.alarm() {
            alarm = Some(format!("period {}: {}", rig.period, code.words()));
            break;
        }
    }
    setting.flush(&mut batch, &mut campaign);
    let (periods, not_run) = (rig.period - from, jobs.count());
    campaign.bases.push(Base { seed: base, widened, periods, alarm, not_run });
    Ok(campaign)
}

/// Context of a base; `widened` torque caps are never reached.
fn context(leg: &LegFile, base: u64, widened: bool) -> Result<Context<JOINTS, BASE>, ToolError> {
    let mut context = Context::with_complete_drives(leg, base)?;
    if widened {
        for joint in &mut context.configuration.joints {
            (joint.torque, joint.current) = (joint.torque * WIDENED, joint.current * WIDENED);
        }
    }
    Ok(context)
}

/// Returns whether the stop comes in this period: every servo tick, and every period from 1 s to 2 s.
fn is_stopped_at(period: u64) -> bool {
    period.is_multiple_of(u64::from(PERIODS_PER_TICK)) || (PERIODS_PER_S..2 * PERIODS_PER_S).contains(&period)
}

/// Periods of an identification of this length in which the stop comes.
fn stops(length: u64) -> Vec<u64> {
    (0..=length).filter(|period| is_stopped_at(*period)).collect()
}

fn base_of(seed: u64) -> u64 {
    1 + seed.saturating_sub(1) / RUNS_PER_BASE
}

impl Setting<'_> {
    fn jobs(
        &self,
        options: &CampaignOptions,
        twice: &(dyn Fn(&str) -> bool + Sync),
        base: u64,
    ) -> Vec<(u64, Job)> {
        let mut jobs = Vec::new();
        for entry in &options.rows {
            let Entry::Forked(row) = entry else { continue };
            if self.manner.is_blind() && (row.fault.id == CAPPED) != self.widened {
                continue;
            }
            for seed in options.seeds.iter().copied().filter(|seed| base_of(*seed) == base) {
                if twice(row.fault.id) && seed.is_multiple_of(2) {
                    continue;
                }
                let mut random = Random::new(row.fault.id, seed);
                let period = random.below(self.length);
                let scenario = (row.draw)(&mut random, &self.bounds);
                let views = if self.manner.is_blind() { views(row, &options.rows) } else { Vec::new() };
                for blind in views.into_iter().chain([self.manner.blind]) {
                    let manner = Manner { blind, ..self.manner };
                    jobs.push((period, Job::Row { row, scenario, seed, manner }));
                }
            }
        }
        let mut trials = |seeds: &[u64], kind: &str, trial: &dyn Fn(u64) -> Trial| {
            for seed in seeds.iter().copied().filter(|seed| base_of(*seed) == base) {
                let period = Random::new(kind, seed).below(self.length);
                jobs.push((period, Job::Trial { trial: Box::new(trial(seed)), seed }));
            }
        };
        trials(&options.sweep, "sweep", &Trial::sweep);
        trials(&options.pairs, "pairs", &|seed| Trial::pair(seed, &self.bounds));
        jobs
    }

    /// Emergency stop at this period.
    fn stop(&self, period: u64) -> Job {
        static STOP: Row = Row { fault: &catalogue::X1, draw: emergency_stop };
        let open = at(Channel::EmergencyStop, 0, Form::Off, Timing::lasting(0, 1));
        let scenario = Scenario { patience: 4, ..one(open, Expected::Released) };
        Job::Row { row: &STOP, scenario, seed: period, manner: Manner { brief: true, ..self.manner } }
    }

    fn flush(&self, batch: &mut Vec<(Rig<JOINTS, BASE>, Job)>, campaign: &mut Campaign) {
        let of = |(rig, job): &(Rig<JOINTS, BASE>, Job)| match job {
            Job::Row { row, scenario, seed, manner } => {
                let outcome = run(self.leg, row, scenario, *seed, *manner, rig);
                // Its period must not be used as a seed, which would draw another run.
                (Some(manner.blind), Outcome { seed: if manner.brief { 0 } else { *seed }, ..outcome })
            }
            Job::Trial { trial, seed } => (None, trial.run(self.leg, *seed, self.manner.recorded, rig)),
        };
        for (blind, outcome) in batch.par_iter().map(of).collect::<Vec<_>>() {
            match blind {
                None => campaign.trials.push(outcome),
                Some(blind) if blind == self.manner.blind => campaign.outcomes.push(outcome),
                Some(blind) => campaign.singly.push((blind, outcome)),
            }
        }
        batch.clear();
    }
}

/// Periods of an identification from request to verdict, measured with ideal drives, which have the same
/// motions.
fn length(leg: &LegFile, context: &Context<JOINTS, BASE>, seed: u64) -> Result<u64, ToolError> {
    let ideal = Context { complete: None, ..context.clone() };
    let mut pair = Pair::new(leg, &ideal, seed)?;
    let refused = || leg.error("its identification does not end");
    if !pair.enable(context.gravity) {
        return Err(refused().into());
    }
    let mut request = Some(ControlRequest::Identify);
    for tick in 0..(LONGEST_S / TICK_S) as u64 {
        pair.tick(request.take(), context.gravity);
        if tick > 0 && !matches!(pair.leg.control().activity(), Activity::Identify(_)) {
            return Ok(tick * u64::from(PERIODS_PER_TICK));
        }
    }
    Err(refused().into())
}
