//! Encoders.

use scarab::safety::FaultCode;

use super::super::dice::Dice;
use super::super::draw::{at, one};
use super::super::rig::{PERIOD_MS, PERIODS_PER_S};
use super::{Bounds, Expected, JOINTS, Onset, Row, Scenario};
use crate::faults::{Channel, Form, Injection, Timing};

/// Rows of this group.
pub static ROWS: [Row; 2] = [
    Row {
        id: "E2",
        fault: "wrong reading of an encoder, one or three in 10 ms",
        detector: "greatest step per tick: the duties of the tick before are kept; three in 10 ms in the servo",
        state: "Limit, Damp",
        codes: &[FaultCode::EncoderStep],
        // The servo's next tick.
        deadline_ms: 7.0 * PERIOD_MS,
        unit: "counts",
        lacking: None,
        draw: glitch,
    },
    Row {
        id: "E4",
        fault: "lost counts, no index; a single wrong index pulse is none",
        detector: "two index pulses at one wrong place, two turns without a right one; greatest step",
        state: "Damp",
        codes: &[FaultCode::EncoderPlace],
        deadline_ms: f64::INFINITY,
        unit: "counts",
        lacking: Some("braked (Short) instead of damped, since the rotor's angle is lost with the counts"),
        draw: lost_counts,
    },
];

/// E2: one wrong reading of a counter, or three in 10 ms.
fn glitch(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    let size = dice.logarithmic(2.0, 32_767.0).round();
    let sign = dice.sign();
    let offset = at(Channel::Counter, joint, Form::Offset(sign * size), Timing::lasting(0, 1));
    // A joint at its limit makes half of the greatest step by itself, so a glitch may be that much nearer.
    let by_design = size <= 1.5 * f64::from(bounds.greatest_step[1]);
    if dice.coin() {
        return Scenario { magnitude: Some(size), by_design, ..one(offset, Expected::Rejected) };
    }
    // Three within 10 ms, each in another servo tick.
    let apart = 6 + dice.below(112);
    let timing = Timing { begin: 0, duration: 2 * apart + 1, on: 1, off: apart - 1 };
    Scenario {
        injections: [Some(Injection { timing, ..offset }), None],
        onset: Onset::After(2 * apart),
        magnitude: Some(size),
        by_design,
        ..one(offset, Expected::Damp)
    }
}

/// Turns of the rotor within which lost counts are seen: the second index, 2 1/8 turns after the last right one at the latest.
pub const LOST_TURNS: f64 = 2.15;

/// E4: a counter that lost counts, or won some; an index that no longer comes; a glitch on the index line.
fn lost_counts(dice: &mut Dice, bounds: &Bounds) -> Scenario {
    let joint = dice.below(JOINTS as u64) as usize;
    match dice.below(4) {
        0 => {
            // Seen two turns and an eighth from where the index came last.
            let gone = at(Channel::Index, joint, Form::Off, Timing::from(0));
            Scenario { patience: 4 * PERIODS_PER_S, turns: 3.3, ..one(gone, Expected::Brake) }
        }
        1 => glitch_of_index(joint, 1 + dice.below(24)),
        _ => {
            let size = dice.logarithmic(1.0, 0.25 * f64::from(bounds.counts_per_turn)).round();
            // 4 counts of index, and the way within a quarter of a period.
            let by_design = size <= 4.0 + f64::from(bounds.greatest_step[1]) / 4.0;
            Scenario { by_design, ..lost(joint, dice.sign() * size) }
        }
    }
}

/// Counts that are lost from now on.
fn lost(joint: usize, counts: f64) -> Scenario {
    let offset = at(Channel::Counter, joint, Form::Offset(counts), Timing::from(0));
    Scenario {
        magnitude: Some(counts.abs()),
        patience: 4 * PERIODS_PER_S,
        turns: LOST_TURNS,
        ..one(offset, Expected::Brake)
    }
}

/// Pulses on the index line, wherever the rotor is, in so many periods (a millisecond has 24).
fn glitch_of_index(joint: usize, periods: u64) -> Scenario {
    let glitch = at(Channel::Index, joint, Form::Garbage, Timing::lasting(0, periods));
    Scenario { patience: PERIODS_PER_S, turns: LOST_TURNS, ..one(glitch, Expected::Ignored) }
}

#[cfg(test)]
mod tests {
    use scarab::safety::DriveState;

    use super::super::super::campaign::{BASE, begin};
    use super::super::super::rig::Rig;
    use super::super::super::run::{Manner, Outcome, run};
    use super::*;
    use crate::tool::leg_file::{DEFAULT_LEG, LegFile};
    use crate::tool::pair::Context;
    use crate::tool::simulate::{DriveModel, SimulationOptions};

    /// The default leg with its drive off, holding its pose, and in an identification's motion.
    fn machines(leg: &LegFile) -> [Rig<JOINTS, BASE>; 3] {
        let options = SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::of_seed(1) };
        let context = Context::<JOINTS, BASE>::new(leg, &options).expect("the default leg");
        let mut rig = Rig::new(leg, &context, 1).expect("complete drives");
        let advance = |rig: &mut Rig<JOINTS, BASE>| (0..PERIODS_PER_S / 2).for_each(|_| rig.advance());
        advance(&mut rig);
        let off = rig.clone();
        rig.hand.enabling = true;
        advance(&mut rig);
        assert_eq!(rig.state(), DriveState::OperationEnabled);
        let holding = rig.clone();
        begin(leg, &mut rig).expect("it identifies");
        // Past the approach.
        (0..3).for_each(|_| advance(&mut rig));
        [off, holding, rig]
    }

    #[test]
    fn a_wrong_index_pulse_takes_nothing_at_rest_or_in_motion_and_lost_counts_brake() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let row = &ROWS[1];
        let machines = machines(&leg);
        let of =
            |base, scenario: &Scenario| -> Outcome { run(&leg, row, scenario, 1, Manner::default(), base) };
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
    fn a_run_whose_fault_begins_after_its_end_is_not_missed() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let [.., mut moving] = machines(&leg);
        let speed = |rig: &Rig<JOINTS, BASE>| rig.world.velocity()[0].abs();
        // A joint that gets faster: 20 ms later it passes the speed from which this fault is one.
        let (slow, fast) = loop {
            let slow = moving.clone();
            (0..PERIODS_PER_S / 50).for_each(|_| moving.advance());
            if speed(&moving) > speed(&slow) + 0.02 {
                break (slow, speed(&moving));
            }
        };
        let scenario = |patience| Scenario {
            onset: Onset::Driven { speed: fast - 0.01, per_ampere: 0.0, current: 0.0 },
            patience,
            ..one(at(Channel::Index, 0, Form::Off, Timing::from(u64::MAX)), Expected::Brake)
        };
        for (patience, undetectable) in [(1, true), (PERIODS_PER_S / 20, false)] {
            let outcome = run(&leg, &ROWS[0], &scenario(patience), 1, Manner::default(), &slow);
            assert_eq!((outcome.detected, outcome.undetectable), (false, undetectable), "{patience}");
        }
    }
}
