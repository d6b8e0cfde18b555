//! Runs in which nothing has to be seen, but nothing may be broken either: every way to spoil every channel, and two faults at once.
//!
//! | kind | what |
//! | --- | --- |
//! | sweep | each channel of a sensor, each form, lasting or coming and going, at random size, joint (where there is one each) and instant |
//! | pairs | two faults, of the catalogue or of the sweep, the second up to 50 ms after the first |
//!
//! What is held is what [`Invariants`] hold of every run.

use std::panic::{AssertUnwindSafe, catch_unwind};

use scarab::safety::FaultCode;

use super::aftermath::{RESET, RESET_EVERY, hand};
use super::catalogue::{Bounds, Event, JOINTS, rows};
use super::dice::Dice;
use super::event::apply;
use super::invariants::{Invariants, Scope};
use super::recording::Recording;
use super::rig::{PERIODS_PER_S, Rig};
use super::run::Outcome;
use crate::faults::{Channel, Form, Injection, Injector, Timing};
use crate::tool::leg_file::LegFile;

/// Rows that are not one of a pair: a hang ends in a reset that forgets the other fault, and limits that are not what they were cannot be
/// held.
const ALONE: [&str; 2] = ["K3", "M2"];
/// Names of both kinds.
pub const KINDS: [&str; 2] = ["sweep", "pairs"];
/// Between two faults at most, periods.
const APART: u64 = PERIODS_PER_S / 20;
/// A fault that nobody sees is watched for so long.
const PATIENCE: u64 = PERIODS_PER_S / 5;
/// A released machine is watched for so long.
const AFTERWARDS: u64 = PERIODS_PER_S / 50;

/// What a sensor, a contact or a link can say wrongly.
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
/// Off, stuck, garbage, rail, wrong by a constant, wrong by a factor, late, slow.
const FORMS: u64 = 8;
/// Ways of the sweep: channels, forms, lasting or not.
pub const WAYS: u64 = CHANNELS.len() as u64 * FORMS * 2;

/// What is done in one run.
#[derive(Clone, Debug, Default)]
pub struct Trial {
    kind: &'static str,
    injections: Vec<Injection>,
    /// Periods after the beginning, and what happens then.
    events: Vec<(u64, Event)>,
    /// The last fault begins so much later.
    last: u64,
}

/// Middle and half width of what a channel says.
fn width(channel: Channel) -> f64 {
    match channel {
        Channel::Counter | Channel::Index => 32_768.0,
        Channel::JointCounts => 1e6,
        Channel::JointCurrent => 100.0,
        _ => 2048.0,
    }
}

fn spoilt(dice: &mut Dice, way: u64) -> Injection {
    let channel = CHANNELS[(way / (2 * FORMS)) as usize % CHANNELS.len()];
    let half = width(channel);
    let form = match way / 2 % FORMS {
        0 => Form::Off,
        1 => Form::Stuck,
        2 => Form::Garbage,
        3 => Form::Rail([0.0, 2.0 * half - 1.0, f64::NAN][dice.below(3) as usize]),
        4 => Form::Offset(dice.sign() * dice.logarithmic(1e-4, 1.0) * half),
        5 => Form::Scale(dice.sign() * dice.logarithmic(0.1, 10.0)),
        6 => Form::Delayed(1 + dice.below(31) as u8),
        _ => Form::Slow(dice.logarithmic(0.01, 0.9)),
    };
    let timing = if way.is_multiple_of(2) {
        Timing::from(0)
    } else {
        Timing { begin: 0, duration: PATIENCE, on: 1 + dice.below(50), off: 1 + dice.below(200) }
    };
    let joint = dice.below(JOINTS as u64) as usize;
    Injection { channel, joint: if is_one_for_all(channel) { 0 } else { joint }, form, timing }
}

/// What the board has once is spoilt under joint 0, and under no other.
fn is_one_for_all(channel: Channel) -> bool {
    matches!(channel, Channel::Bus | Channel::EmergencyStop | Channel::GateFault)
}

impl Trial {
    /// One run of the sweep.
    #[must_use]
    pub fn sweep(seed: u64) -> Self {
        let mut dice = Dice::new("S", seed);
        let way = (seed - 1) % WAYS;
        Self { kind: KINDS[0], injections: vec![spoilt(&mut dice, way)], events: Vec::new(), last: 0 }
    }

    /// One run of two faults.
    #[must_use]
    pub fn pair(seed: u64, bounds: &Bounds) -> Self {
        let mut dice = Dice::new("PP", seed);
        let mut trial = Self { kind: KINDS[1], ..Self::default() };
        trial.add(&mut dice, bounds, 0);
        trial.last = dice.below(APART + 1);
        trial.add(&mut dice, bounds, trial.last);
        trial
    }

    fn add(&mut self, dice: &mut Dice, bounds: &Bounds, later: u64) {
        let pool = || rows().filter(|row| !ALONE.contains(&row.id));
        let all = pool().count() as u64;
        let mut injections = Vec::new();
        if dice.below(12) == 0 {
            self.events.push((later, Event::Touch(dice.uniform(0.05, 1.0))));
        } else if dice.below(3) == 0 {
            let way = dice.below(WAYS);
            injections.push(spoilt(dice, way));
        } else if let Some(row) = pool().nth(dice.below(all) as usize) {
            let scenario = (row.draw)(dice, bounds);
            injections.extend(scenario.injections.into_iter().flatten());
            self.events.push((later, scenario.event));
        }
        for mut injection in injections {
            injection.timing.begin = injection.timing.begin.saturating_add(later);
            self.injections.push(injection);
        }
    }

    /// On a fork of `base`; `recorded` keeps its curves.
    #[must_use]
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
        let mut recording = recorded.then(Recording::default);
        let mut rig = base.clone();
        let begun = rig.period;
        rig.injector = Injector::new(seed);
        for injection in &self.injections {
            let mut injection = *injection;
            injection.timing.begin = injection.timing.begin.saturating_add(begun);
            rig.injector.add(injection);
        }
        let events: Vec<Event> = self.events.iter().map(|(_, event)| *event).collect();
        let scope = Scope::of(self.injections.iter(), &events);
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
            // Unseen for so long, or damped to its end.
            if over || alarm.is_none() && since >= self.last + PATIENCE {
                break;
            }
        }
        if alarm.is_some() && seed.is_multiple_of(RESET_EVERY) {
            invariants.knows_places();
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
            false_alarm: false,
            after_ms: None,
            intermittent_ms: None,
            state: None,
            alarm: alarm.map(FaultCode::name),
            magnitude: None,
            broken: broken.into_iter().map(with).collect(),
            hash,
            recording: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::campaign::{BASE, begin};
    use super::*;
    use crate::tool::leg_file::DEFAULT_LEG;
    use crate::tool::pair::Context;
    use crate::tool::simulate::{DriveModel, SimulationOptions};

    /// Seeds of the sweep in which this channel is spoilt and stays so, one for each form.
    fn lasting(channel: Channel) -> impl Iterator<Item = u64> {
        (1..=WAYS).filter(move |seed| {
            let injection = Trial::sweep(*seed).injections[0];
            injection.channel == channel && injection.timing == Timing::from(0)
        })
    }

    #[test]
    fn what_the_board_has_once_is_spoilt_whatever_the_dice_say() {
        let once = [Channel::Bus, Channel::EmergencyStop, Channel::GateFault];
        for seed in 1..=4 * WAYS {
            let injection = Trial::sweep(seed).injections[0];
            assert!(injection.joint == 0 || !once.contains(&injection.channel), "seed {seed}");
        }
    }

    #[test]
    fn an_emergency_stop_and_a_gate_driver_s_fault_that_last_raise_something_in_every_run_of_the_sweep() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let options = SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::of_seed(1) };
        let context = Context::<JOINTS, BASE>::new(&leg, &options).expect("the default leg");
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
