//! One run: forks a machine at a period of its motion, injects faults, and watches until it is safe.

use std::panic::{AssertUnwindSafe, catch_unwind};

use scarab::hal::Contacts;
use scarab::safety::FaultCode;
use scarab_base::random::Random;

use crate::faults::aftermath::{RESET, RESET_EVERY, hand};
use crate::faults::event::apply;
use crate::faults::invariants::{Invariants, Scope};
use crate::faults::scenario::{Event, Expected, Onset, Row, Scenario};
use scarab::model::planar::JOINTS;

pub use crate::faults::outcome::{Blind, Manner, Outcome};
use scarab_identify::formats::leg_file::LegFile;

use crate::faults::recording::FaultCurves;
use crate::faulty_board::{PERIOD_MS, PERIODS_PER_S, Rig};
use hal_sim::faults::{Channel, Injector};
use hal_sim::world::periods::PERIODS_PER_TICK;

mod judge;
mod keep;

/// Periods for which a safe machine is watched: no bridge may switch again.
const AFTERWARDS: u64 = PERIODS_PER_S / 50;
/// Periods for which a restarted machine is watched, with the switch opened and closed.
const REFUSED: u64 = PERIODS_PER_S / 2;
/// Periods of random contacts.
const HANDS: u64 = 6 * PERIODS_PER_S;

/// Runs a fork of `base` with the faults of the scenario.
pub fn run<const B: usize>(
    leg: &LegFile,
    row: &'static Row,
    scenario: &Scenario,
    seed: u64,
    manner: Manner,
    base: &Rig<JOINTS, B>,
) -> Outcome {
    catch_unwind(AssertUnwindSafe(|| Watched::new(leg, row, scenario, seed, manner, base).finish()))
        .unwrap_or_else(|_| Outcome {
            fault: row.fault.id,
            seed,
            period: base.period,
            magnitude: scenario.magnitude,
            broken: vec!["a panic".into()],
            ..Outcome::default()
        })
}

/// Next servo tick that reads the fault: the servo's sample is read before its tick, its target after it.
fn next_servo_tick(scenario: &Scenario, begun: u64) -> u64 {
    let target = scenario.injections[0].is_some_and(|injection| injection.channel == Channel::Target);
    let periods = u64::from(PERIODS_PER_TICK);
    (if target { begun } else { begun + 1 }).next_multiple_of(periods)
}

struct Watched<'a, const B: usize> {
    row: &'static Row,
    scenario: &'a Scenario,
    seed: u64,
    rig: Rig<JOINTS, B>,
    invariants: Invariants<JOINTS>,
    random: Random,
    begun: u64,
    onset: Option<u64>,
    /// Angles of the joints at the injection, anatomical, rad.
    angles: [f64; JOINTS],
    /// Speed of the faulted joint at the injection, rad/s.
    speed: f64,
    /// Requested currents of the phases with shunts at the injection, and in the previous period, A.
    requested: [f64; 2],
    before: [f64; 2],
    /// Largest change of them within a period since then, A.
    steepest: [f64; 2],
    /// Time until which the operator's contacts stay as they are.
    held_until: u64,
    recording: Option<FaultCurves>,
    brief: bool,
}

/// Requested currents of a joint's phases B and C at the present rotor angle, A.
fn requested<const B: usize>(rig: &Rig<JOINTS, B>, joint: usize) -> [f64; 2] {
    let current = rig.requested(joint);
    let angle = rig.world.complete_drives().map_or(0.0, |drives| drives.axes()[joint].electrical_angle());
    [1.0, 2.0].map(|phase| -current * (angle - phase * core::f64::consts::TAU / 3.0).sin())
}

impl<'a, const B: usize> Watched<'a, B> {
    fn new(
        leg: &LegFile,
        row: &'static Row,
        scenario: &'a Scenario,
        seed: u64,
        manner: Manner,
        base: &Rig<JOINTS, B>,
    ) -> Self {
        let mut rig = base.clone();
        let begun = rig.period;
        rig.injector = Injector::new(seed);
        rig.blind = match manner.blind {
            Blind::None => &[],
            Blind::Row => row.fault.codes,
            Blind::Code(code) => {
                row.fault.codes.iter().find(|own| **own == code).map_or(&[], core::slice::from_ref)
            }
        };
        for injection in scenario.injections.into_iter().flatten() {
            let mut injection = injection;
            injection.timing.begin = injection.timing.begin.saturating_add(begun);
            rig.injector.add(injection);
        }
        apply(scenario.event, leg, &mut rig);
        let scope = Scope::new(scenario.injections.iter().flatten(), &[scenario.event]);
        let onset = match scenario.onset {
            Onset::Injection => Some(begun),
            Onset::ServoTick => Some(next_servo_tick(scenario, begun)),
            Onset::After(periods) => Some(begun + periods),
            _ => None,
        };
        let joint = scenario.injections[0].map_or(0, |injection| injection.joint);
        Self {
            row,
            scenario,
            seed,
            invariants: Invariants::new(leg, scope, &rig),
            random: Random::new(row.fault.id, !seed),
            begun,
            onset,
            angles: rig.world.anatomical_position(),
            speed: rig.world.velocity()[joint].abs(),
            requested: requested(&rig, joint),
            before: [f64::NAN; 2],
            steepest: [0.0; 2],
            held_until: 0,
            recording: manner.recorded.then(FaultCurves::default),
            brief: manner.brief,
            rig,
        }
    }

    fn step(&mut self) {
        if self.scenario.event == Event::Hands {
            self.hands();
        }
        let stop = self.rig.injector.happens(Channel::EmergencyStop, 0, self.rig.period);
        self.rig.advance();
        // A firmware with changed limits in memory cannot enforce the true ones; after the alarm it has to.
        if !matches!(self.scenario.event, Event::Upset { .. }) || self.rig.alarm().is_some() {
            self.invariants.see(&self.rig, stop);
        }
        if let Some(recording) = &mut self.recording {
            recording.see(&self.rig, self.begun);
        }
        let phases = self.requested();
        let step = |shunt: usize| self.steepest[shunt].max((phases[shunt] - self.before[shunt]).abs());
        (self.steepest, self.before) = ([0, 1].map(step), phases);
        match (self.onset, self.has_begun()) {
            (None, true) => self.onset = Some(self.rig.period),
            // A fault under a condition that no longer holds.
            (Some(_), false) if self.rig.alarm().is_none() => self.onset = None,
            _ => {}
        }
    }

    fn has_begun(&self) -> bool {
        let lasts = matches!(self.scenario.onset, Onset::Driven { .. } | Onset::Requested(_));
        if self.onset.is_some() && !lasts {
            return true;
        }
        let joint = self.joint();
        let bus = || self.rig.world.complete_drives().map_or(0.0, |drives| drives.supply().voltage());
        match self.scenario.onset {
            Onset::Injection | Onset::ServoTick | Onset::After(_) => true,
            Onset::BusAbove(volts) => bus() > volts,
            Onset::BusBelow(volts) => bus() < volts,
            Onset::Driven { speed, per_ampere, current, sudden } => {
                self.speed > sudden
                    || self.turns(joint, speed, per_ampere) && self.rig.requested(joint).abs() > current
            }
            Onset::Requested(amperes) => {
                let requested = self.requested();
                // The axis knows the rotor angle, and so the current at the injection, with an error of a
                // period or two.
                let has_changed = |shunt: usize| {
                    (requested[shunt] - self.requested[shunt]).abs() > amperes + 2.0 * self.steepest[shunt]
                };
                (0..2).any(|shunt| has_changed(shunt) && self.spoils(shunt))
            }
            Onset::Speed(factor) => {
                let truth = self.rig.world.velocity();
                let limits = self.rig.leg.control().limits().joints();
                (0..JOINTS).any(|joint| truth[joint].abs() > factor * f64::from(limits[joint].speed.0))
            }
        }
    }

    fn turns(&self, joint: usize, speed: f64, per_ampere: f64) -> bool {
        self.rig.world.velocity()[joint].abs() > speed + per_ampere * self.rig.requested(joint).abs()
    }

    /// Joint of the first injection.
    fn joint(&self) -> usize {
        self.scenario.injections[0].map_or(0, |injection| injection.joint)
    }

    fn spoils(&self, shunt: usize) -> bool {
        let channel = [Channel::ShuntB, Channel::ShuntC][shunt];
        self.scenario.injections.iter().flatten().any(|injection| injection.channel == channel)
    }

    /// Requested currents of the phases with shunts, A.
    fn requested(&self) -> [f64; 2] {
        requested(&self.rig, self.joint())
    }

    /// Deadline of this run where it is longer than the row's, ms.
    fn intermittent_ms(&self) -> Option<f64> {
        self.scenario.within_ms.filter(|within| *within > self.row.fault.deadline_ms)
    }

    /// Deadline of this run, ms.
    fn deadline_ms(&self) -> f64 {
        self.scenario.within_ms.unwrap_or(self.row.fault.deadline_ms)
    }

    /// Operates the contacts at random, with a complete reset now and then.
    fn hands(&mut self) {
        let now = self.rig.period;
        if now < self.held_until {
            return;
        }
        let choice = self.random.below(6);
        let hand = match choice {
            0 | 1 => Contacts { enabling: true, start: false },
            2 => Contacts { enabling: true, start: true },
            3 => Contacts { enabling: false, start: true },
            _ => Contacts::default(),
        };
        // Sometimes long enough for a reset.
        let longest = if choice == 3 { 3 * PERIODS_PER_S } else { PERIODS_PER_S / 2 };
        self.held_until = now + 1 + self.random.below(longest);
        self.rig.hand = hand;
    }

    fn finish(mut self) -> Outcome {
        match self.scenario.expected {
            Expected::Kept => return self.keep(),
            Expected::Ignored => return self.ignore(),
            _ => {}
        }
        let seen = self.run_until_safe();
        let safe = self.rig.period;
        let alarm = self.rig.alarm();
        // A fault that begins only while the safe machine is watched does not belong to this run.
        let onset = self.onset;
        if let (Some(state), Some(code)) = (seen, alarm) {
            self.judge(state, code);
        }
        self.watch_on(seen);
        // A single wrong reading must not stop the leg.
        let mut false_alarm = self.scenario.expected == Expected::Rejected && self.rig.alarm().is_some();
        // An alarm before the onset counts for this row only if its own detectors reported.
        let own = alarm.is_none_or(|code| self.row.fault.codes.contains(&code));
        let early = onset.is_none() && !own;
        let elsewhere = !early && seen.is_some_and(|state| !self.leads_to(state));
        false_alarm |= self.is_only_pushed() && alarm.is_some_and(|code| !Self::is_caused_by_a_push(code));
        let begun = onset.map_or(safe, |onset| onset.min(safe));
        let after_ms = seen.map(|_| (safe - begun) as f64 * PERIOD_MS);
        let in_time = after_ms.is_some_and(|after| after <= self.deadline_ms() + 1e-9);
        let nothing_came = onset.is_none() && (seen.is_none() || early);
        let stood = self.row.fault.deadline_ms.is_infinite() && !self.has_turned();
        let in_time = in_time && !early && !elsewhere;
        let undetectable = !in_time && !elsewhere && (self.scenario.by_design || nothing_came || stood);
        let intermittent_ms = self.intermittent_ms();
        let found = self.ended(alarm);
        Outcome {
            detected: in_time,
            undetectable,
            false_alarm,
            after_ms,
            intermittent_ms,
            state: seen,
            ..found
        }
    }

    /// Outcome of this run before it is judged.
    fn ended(self, alarm: Option<FaultCode>) -> Outcome {
        Outcome {
            fault: self.row.fault.id,
            seed: self.seed,
            period: self.begun,
            alarm: alarm.map(FaultCode::name),
            magnitude: self.scenario.magnitude,
            broken: self.invariants.into_broken(),
            hash: format!("{:016x}", self.rig.hash),
            recording: self.recording,
            ..Outcome::default()
        }
    }

    /// Runs until the state that the fault must lead to, which is returned, or until it is too late.
    fn run_until_safe(&mut self) -> Option<&'static str> {
        let before = *self.rig.commands();
        let limit = self.begun + self.scenario.patience;
        let mut seen = None;
        while seen.is_none() && (self.rig.period < limit) {
            self.step();
            if self.scenario.expected == Expected::Rejected && self.rig.period == self.begun + 1 {
                let joint = self.joint();
                let kept = self.rig.commands()[joint] == before[joint];
                let rejected = kept && self.rig.alarm().is_none();
                seen = rejected.then_some("Limit");
                if !rejected {
                    break;
                }
            } else if self.rig.alarm().is_some() && !self.is_before() {
                seen = self.safe_state();
            }
            if self.onset.is_some_and(|onset| self.is_too_late(onset)) {
                break;
            }
        }
        seen
    }

    fn is_too_late(&self, onset: u64) -> bool {
        let since = self.rig.period.saturating_sub(onset) as f64 * PERIOD_MS;
        if self.row.fault.deadline_ms.is_infinite() {
            return self.has_turned();
        }
        since > 2.0 * self.deadline_ms() + 1.0
    }

    /// Returns whether the rotor has made the allowed turns since the injection.
    fn has_turned(&self) -> bool {
        let position = self.rig.world.anatomical_position();
        let drives = self.rig.world.complete_drives();
        let joint = self.joint();
        let ratio = drives.map_or(1.0, |drives| drives.axes()[joint].description().ratio);
        (position[joint] - self.angles[joint]).abs() * ratio > self.scenario.turns * core::f64::consts::TAU
    }

    /// Returns whether the decisive one of several faults has not begun yet.
    fn is_before(&self) -> bool {
        matches!(self.scenario.onset, Onset::After(_)) && self.onset >= Some(self.rig.period)
    }

    /// In some runs the operator resets and tries to enable again.
    fn reset(&mut self) {
        self.invariants.check_positions_from_now();
        for since in 0..RESET {
            self.rig.hand = hand(since);
            self.step();
        }
    }

    /// Watches the machine after the safe state: no bridge switches again, and damping ends.
    fn watch_on(&mut self, seen: Option<&'static str>) {
        let periods = match (self.scenario.event, seen) {
            (Event::Hands, _) => HANDS,
            (_, Some("Damp")) => PERIODS_PER_S * 3 / 10 + AFTERWARDS,
            (_, Some("Refuse")) => REFUSED,
            _ if self.brief => AFTERWARDS / 10,
            _ => AFTERWARDS,
        };
        for period in 0..periods {
            // The enabling switch is opened and closed again, which must not enable.
            if seen == Some("Refuse") && period.is_multiple_of(REFUSED / 2) {
                self.rig.hand = Contacts { enabling: period > 0, start: false };
            }
            self.step();
        }
        let resets =
            self.seed.is_multiple_of(RESET_EVERY) && !self.brief && self.scenario.event != Event::Hands;
        if resets && seen.is_some() {
            self.reset();
        }
    }
}
