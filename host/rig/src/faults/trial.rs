//! Runs without a required detection, in which no invariant may break: every form of fault on every channel,
//! and two faults at once.
//!
//! | kind | content |
//! | --- | --- |
//! | sweep | each channel, each form, lasting or intermittent, with random size, joint and time |
//! | pairs | two faults of catalogue or sweep, the second up to 50 ms after the first |
//!
//! The conditions are those of `Invariants`.

use std::panic::{AssertUnwindSafe, catch_unwind};

use hal_sim::faults::{Channel, Form, Injection, Injector, Timing};
use scarab::safety::FaultCode;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::faults::aftermath::{RESET, RESET_EVERY, hand};
use crate::faults::event::apply;
use crate::faults::forks::ROWS;
use crate::faults::invariants::{Invariants, Scope};
use crate::faults::recording::FaultCurves;
use crate::faults::run::Outcome;
use crate::faults::scenario::{Bounds, Event};
use crate::faulty_board::{PERIODS_PER_S, Rig};
use scarab::model::planar::JOINTS;

/// Rows excluded from pairs. A hang ends in a reset that removes the other fault, and changed limits cannot
/// be enforced.
const ALONE: [&str; 2] = ["K3", "M2"];
/// Names of the two kinds.
pub const KINDS: [&str; 2] = ["sweep", "pairs"];
/// Longest time between two faults, periods.
const APART: u64 = PERIODS_PER_S / 20;
/// Periods for which an undetected fault is observed.
const PATIENCE: u64 = PERIODS_PER_S / 5;
/// Periods for which a safe machine is observed.
const AFTERWARDS: u64 = PERIODS_PER_S / 50;

/// Channels of sensors, contacts and links that can be faulted.
const CHANNELS: [Channel; 12] = [
    Channel::Counter,
    Channel::Index,
    Channel::ShuntB,
    Channel::ShuntC,
    Channel::Bus,
    Channel::JointCounts,
    Channel::JointCurrent,
    Channel::EmergencyStop,
    Channel::GateFault,
    Channel::Conversion,
    Channel::GateRegisters,
    Channel::Thermistor,
];
/// Number of forms: off, stuck, garbage, rail, offset, factor, delay, low-pass.
const FORMS: u64 = 8;
/// Combinations of the sweep: channels, forms, lasting or not.
pub(crate) const WAYS: u64 = CHANNELS.len() as u64 * FORMS * 2;

/// Faults of one run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trial {
    kind: &'static str,
    injections: Vec<Injection>,
    /// Events, with their periods after the start.
    events: Vec<(u64, Event)>,
    /// Periods after the start at which the last fault begins.
    last: u64,
}

/// Middle and half of the range of a channel's values.
fn width(channel: Channel) -> f64 {
    match channel {
        Channel::Counter | Channel::Index => 32_768.0,
        Channel::JointCounts => 1e6,
        Channel::JointCurrent => 100.0,
        _ => 2048.0,
    }
}

fn faulted(random: &mut Random, way: u64) -> Injection {
    let channel = CHANNELS[(way / (2 * FORMS)) as usize % CHANNELS.len()];
    let half = width(channel);
    let form = match way / 2 % FORMS {
        0 => Form::Off,
        1 => Form::Stuck,
        2 => Form::Garbage,
        3 => Form::Rail([0.0, 2.0 * half - 1.0, f64::NAN][random.below(3) as usize]),
        4 => Form::Offset(random.sign() * random.logarithmic(1e-4, 1.0) * half),
        5 => Form::Scale(random.sign() * random.logarithmic(0.1, 10.0)),
        6 => Form::Delayed(1 + random.below(31) as u8),
        _ => Form::Slow(random.logarithmic(0.01, 0.9)),
    };
    let timing = if way.is_multiple_of(2) {
        Timing::from(0)
    } else {
        Timing { begin: 0, duration: PATIENCE, on: 1 + random.below(50), off: 1 + random.below(200) }
    };
    let joint = random.below(JOINTS as u64) as usize;
    Injection { channel, joint: if is_one_for_all(channel) { 0 } else { joint }, form, timing }
}

/// Returns whether the board has one such channel only; its fault is injected at joint 0.
fn is_one_for_all(channel: Channel) -> bool {
    matches!(channel, Channel::Bus | Channel::EmergencyStop | Channel::GateFault)
}

impl Trial {
    /// Draws one run of the sweep.
    pub(crate) fn sweep(seed: u64) -> Self {
        let mut random = Random::new("S", seed);
        let way = (seed - 1) % WAYS;
        Self { kind: KINDS[0], injections: vec![faulted(&mut random, way)], events: Vec::new(), last: 0 }
    }

    /// Draws one run of two faults.
    pub(crate) fn pair(seed: u64, bounds: &Bounds) -> Self {
        let mut random = Random::new("PP", seed);
        let mut trial = Self { kind: KINDS[1], ..Self::default() };
        trial.add(&mut random, bounds, 0);
        trial.last = random.below(APART + 1);
        trial.add(&mut random, bounds, trial.last);
        trial
    }

    fn add(&mut self, random: &mut Random, bounds: &Bounds, later: u64) {
        let pool = || ROWS.iter().filter(|row| !ALONE.contains(&row.fault.id));
        let all = pool().count() as u64;
        let mut injections = Vec::new();
        if random.below(12) == 0 {
            self.events.push((later, Event::Touch(random.uniform(0.05, 1.0))));
        } else if random.below(3) == 0 {
            let way = random.below(WAYS);
            injections.push(faulted(random, way));
        } else if let Some(row) = pool().nth(random.below(all) as usize) {
            let scenario = (row.draw)(random, bounds);
            injections.extend(scenario.injections.into_iter().flatten());
            self.events.push((later, scenario.event));
        }
        for mut injection in injections {
            injection.timing.begin = injection.timing.begin.saturating_add(later);
            self.injections.push(injection);
        }
    }

    /// Runs on a fork of `base`; `recorded` records its curves.
    pub fn run<const B: usize>(
        &self,
        leg: &LegFile,
        seed: u64,
        recorded: bool,
        base: &Rig<JOINTS, B>,
    ) -> Outcome {
        catch_unwind(AssertUnwindSafe(|| self.watched(leg, seed, recorded, base))).unwrap_or_else(|_| {
            let broken = vec!["a panic".into()];
            self.outcome(seed, base, None, broken, String::new())
        })
    }

    fn watched<const B: usize>(
        &self,
        leg: &LegFile,
        seed: u64,
        recorded: bool,
        base: &Rig<JOINTS, B>,
    ) -> Outcome {
        let mut recording = recorded.then(FaultCurves::default);
        let mut rig = base.clone();
        let begun = rig.period;
        rig.injector = Injector::new(seed);
        for injection in &self.injections {
            let mut injection = *injection;
            injection.timing.begin = injection.timing.begin.saturating_add(begun);
            rig.injector.add(injection);
        }
        let events: Vec<Event> = self.events.iter().map(|(_, event)| *event).collect();
        let scope = Scope::new(self.injections.iter(), &events);
        let mut invariants = Invariants::new(leg, scope, &rig);
        let mut alarm = None;
        let mut safe_since = None;
        for since in 0..self.last + PATIENCE + PERIODS_PER_S / 2 {
            for (_, event) in self.events.iter().filter(|(later, _)| *later == since) {
                apply(*event, leg, &mut rig);
            }
            let stop = rig.injector.happens(Channel::EmergencyStop, 0, rig.period);
            rig.advance();
            invariants.see(&rig, stop);
            if let Some(recording) = &mut recording {
                recording.see(&rig, begun);
            }
            alarm = alarm.or(rig.alarm());
            safe_since = if rig.is_switching() { None } else { safe_since.or(Some(since)) };
            let over = safe_since.is_some_and(|safe| since >= safe.max(self.last) + AFTERWARDS);
            // Undetected for the whole time, or damped to its end.
            if over || alarm.is_none() && since >= self.last + PATIENCE {
                break;
            }
        }
        if alarm.is_some() && seed.is_multiple_of(RESET_EVERY) {
            invariants.check_positions_from_now();
            for since in 0..RESET {
                rig.hand = hand(since);
                let stop = rig.injector.happens(Channel::EmergencyStop, 0, rig.period);
                rig.advance();
                invariants.see(&rig, stop);
            }
        }
        let hash = format!("{:016x}", rig.hash);
        Outcome { recording, ..self.outcome(seed, base, alarm, invariants.into_broken(), hash) }
    }

    fn outcome<const B: usize>(
        &self,
        seed: u64,
        base: &Rig<JOINTS, B>,
        alarm: Option<FaultCode>,
        broken: Vec<String>,
        hash: String,
    ) -> Outcome {
        let what = self.injections.iter().map(|injection| format!("{injection:?}"));
        let events = self.events.iter().map(|event| format!("{event:?}"));
        let with = |broken: String| {
            format!("{broken}: {}", what.clone().chain(events.clone()).collect::<Vec<_>>().join(", "))
        };
        Outcome {
            fault: self.kind,
            seed,
            period: base.period,
            detected: alarm.is_some(),
            undetectable: alarm.is_none(),
            alarm: alarm.map(FaultCode::name),
            broken: broken.into_iter().map(with).collect(),
            hash,
            ..Outcome::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::begin;
    use crate::pair::Context;
    use scarab::model::planar::BASE;
    use scarab_identify::formats::leg_file::DEFAULT_LEG;

    /// Seeds of the sweep with a lasting fault of this channel, one for each form.
    fn lasting(channel: Channel) -> impl Iterator<Item = u64> {
        (1..=WAYS).filter(move |seed| {
            let injection = Trial::sweep(*seed).injections[0];
            injection.channel == channel && injection.timing == Timing::from(0)
        })
    }

    #[test]
    fn a_channel_of_the_whole_board_is_faulted_for_every_seed() {
        let once = [Channel::Bus, Channel::EmergencyStop, Channel::GateFault];
        for seed in 1..=4 * WAYS {
            let injection = Trial::sweep(seed).injections[0];
            assert!(injection.joint == 0 || !once.contains(&injection.channel), "seed {seed}");
        }
    }

    #[test]
    fn a_lasting_stop_or_gate_fault_is_detected_in_every_run() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let context = Context::<JOINTS, BASE>::with_complete_drives(&leg, 1).expect("the default leg");
        let mut base = Rig::new(&leg, &context, 1).expect("complete drives");
        begin(&leg, &mut base).expect("it is enabled");
        for channel in [Channel::EmergencyStop, Channel::GateFault] {
            let seeds: Vec<u64> = lasting(channel).collect();
            assert_eq!(seeds.len() as u64, FORMS);
            for seed in seeds {
                let outcome = Trial::sweep(seed).run(&leg, seed, false, &base);
                assert!(outcome.detected && outcome.broken.is_empty(), "{channel:?}: {outcome:?}");
            }
        }
    }
}
