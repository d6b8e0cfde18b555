//! Encoder counters and index.

use hal_sim::faults::{Channel, Form, Injection, Timing};
use scarab_base::random::Random;

use crate::faults::draw::{at, one};
use crate::faults::scenario::{Bounds, Expected, Onset, Scenario};
use crate::faulty_board::PERIODS_PER_S;
use scarab::model::planar::JOINTS;

/// E2: one wrong counter reading, or three in 10 ms.
pub(super) fn glitch(random: &mut Random, bounds: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    let size = random.logarithmic(2.0, 32_767.0).round();
    let sign = random.sign();
    let offset = at(Channel::Counter, joint, Form::Offset(sign * size), Timing::lasting(0, 1));
    // A joint at its speed limit makes half of the greatest step by itself, so a glitch may be that much
    // larger.
    let by_design = size <= 1.5 * f64::from(bounds.greatest_step[1]);
    if random.coin() {
        return Scenario { magnitude: Some(size), by_design, ..one(offset, Expected::Rejected) };
    }
    // Three within 10 ms, each in another servo tick.
    let apart = 6 + random.below(112);
    let timing = Timing { begin: 0, duration: 2 * apart + 1, on: 1, off: apart - 1 };
    Scenario {
        injections: [Some(Injection { timing, ..offset }), None],
        onset: Onset::After(2 * apart),
        magnitude: Some(size),
        by_design,
        ..one(offset, Expected::Damp)
    }
}

/// Rotor turns within which lost counts are detected: at the second index, at the latest 2 1/8 turns after
/// the last correct one.
pub(crate) const LOST_TURNS: f64 = 2.15;

/// E4: a counter that lost or gained counts; an index that no longer comes; a glitch on the index line.
pub(super) fn lost_counts(random: &mut Random, bounds: &Bounds) -> Scenario {
    let joint = random.below(JOINTS as u64) as usize;
    match random.below(4) {
        0 => {
            // Detected two turns and an eighth after the last index.
            let gone = at(Channel::Index, joint, Form::Off, Timing::from(0));
            Scenario { patience: 4 * PERIODS_PER_S, turns: 3.3, ..one(gone, Expected::Brake) }
        }
        1 => glitch_of_index(joint, 1 + random.below(24)),
        _ => {
            let size = random.logarithmic(1.0, 0.25 * f64::from(bounds.counts_per_turn)).round();
            // 4 counts of the index, and the motion within a quarter of a period.
            let by_design = size <= 4.0 + f64::from(bounds.greatest_step[1]) / 4.0;
            Scenario { by_design, ..lost(joint, random.sign() * size) }
        }
    }
}

/// Counts lost from now on.
fn lost(joint: usize, counts: f64) -> Scenario {
    let offset = at(Channel::Counter, joint, Form::Offset(counts), Timing::from(0));
    Scenario {
        magnitude: Some(counts.abs()),
        patience: 4 * PERIODS_PER_S,
        turns: LOST_TURNS,
        ..one(offset, Expected::Brake)
    }
}

/// Pulses on the index line at any rotor position, for `periods` (24 per millisecond).
fn glitch_of_index(joint: usize, periods: u64) -> Scenario {
    let glitch = at(Channel::Index, joint, Form::Garbage, Timing::lasting(0, periods));
    Scenario { patience: PERIODS_PER_S, turns: LOST_TURNS, ..one(glitch, Expected::Ignored) }
}

#[cfg(test)]
mod tests {
    use scarab::safety::DriveState;

    use super::*;
    use crate::faults::forks::ROWS;
    use crate::faults::run::{Manner, Outcome, run};
    use crate::faulty_board::Rig;
    use crate::operator::begin;
    use crate::pair::Context;
    use scarab::model::planar::BASE;
    use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};

    /// The default leg with its drive off, holding its pose, and during an identification's motion.
    fn machines(leg: &LegFile) -> [Rig<JOINTS, BASE>; 3] {
        let context = Context::with_complete_drives(leg, 1).expect("the default leg");
        let mut rig = Rig::new(leg, &context, 1).expect("complete drives");
        let advance = |rig: &mut Rig<JOINTS, BASE>| (0..PERIODS_PER_S / 2).for_each(|_| rig.advance());
        advance(&mut rig);
        let off = rig.clone();
        rig.hand.enabling = true;
        advance(&mut rig);
        assert_eq!(rig.state(), DriveState::OperationEnabled);
        let holding = rig.clone();
        begin(leg, &mut rig).expect("it identifies");
        // Continues past the approach.
        (0..3).for_each(|_| advance(&mut rig));
        [off, holding, rig]
    }

    #[test]
    fn wrong_index_pulses_are_ignored_and_lost_counts_brake() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let machines = machines(&leg);
        let of = |base, scenario: &Scenario| -> Outcome {
            run(&leg, &ROWS[1], scenario, 1, Manner::default(), base)
        };
        for joint in 0..JOINTS {
            for (base, machine) in machines.iter().zip(["off", "holding", "moving"]) {
                for periods in [1, 24] {
                    let outcome = of(base, &glitch_of_index(joint, periods));
                    assert!(outcome.undetectable && !outcome.false_alarm, "{machine}: {outcome:?}");
                    assert_eq!((outcome.alarm, outcome.broken.len()), (None, 0), "{machine}");
                }
            }
            for counts in [-20.0, 20.0] {
                let outcome = of(&machines[2], &lost(joint, counts));
                assert!(outcome.detected && outcome.broken.is_empty(), "{outcome:?}");
                assert_eq!((outcome.alarm, outcome.state), (Some("encoder_place"), Some("Short")));
            }
        }
    }

    #[test]
    fn a_fault_that_begins_after_the_run_does_not_count_as_missed() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let [.., mut moving] = machines(&leg);
        let speed = |rig: &Rig<JOINTS, BASE>| rig.world.velocity()[0].abs();
        // An accelerating joint: 20 ms later it passes the speed above which this fault counts.
        let (slow, fast) = loop {
            let slow = moving.clone();
            (0..PERIODS_PER_S / 50).for_each(|_| moving.advance());
            if speed(&moving) > speed(&slow) + 0.02 {
                break (slow, speed(&moving));
            }
        };
        let scenario = |patience| Scenario {
            onset: Onset::Driven { speed: fast - 0.01, per_ampere: 0.0, current: 0.0, sudden: f64::INFINITY },
            patience,
            ..one(at(Channel::Index, 0, Form::Off, Timing::from(u64::MAX)), Expected::Brake)
        };
        for (patience, undetectable) in [(1, true), (PERIODS_PER_S / 20, false)] {
            let outcome = run(&leg, &ROWS[0], &scenario(patience), 1, Manner::default(), &slow);
            assert_eq!((outcome.detected, outcome.undetectable), (false, undetectable), "{patience}");
        }
    }
}
