//! Assistance of a periodic motion.

use super::bench::{Bench, SECOND, insisting};
use super::{MOST, POSTURE, gait, walking};
use hal_sim::wearer::motion::{CadenceChange, IntendedMotion};
use hal_sim::wearer::muscles::Intention;
use scarab::leg::AssistShares;

fn shares(periodic: f32) -> AssistShares {
    AssistShares { periodic, ..MOST }
}

/// Root mean square of both joints' muscles, N m.
fn effort(bench: &mut Bench, ticks: u32) -> f64 {
    let [hip, knee] = bench.measure(ticks).muscle;
    hip.hypot(knee)
}

fn oscillates_at(bench: &Bench) -> (f64, f64) {
    let periodic = bench.leg.law().periodic().expect("a session");
    (f64::from(periodic.oscillator().hertz()), f64::from(periodic.gate()))
}

#[test]
fn three_tenths_reduce_the_effort_by_a_quarter_and_resistance_raises_it() {
    for cadence in [0.5, 0.8, 1.2] {
        let [none, assisted, resisted] = [0.0, 0.3, -0.3].map(|share| {
            let mut bench = Bench::assisting(&insisting(), POSTURE, shares(share));
            bench.intend(Intention::Follow(walking(cadence)));
            bench.run(8 * SECOND);
            let effort = effort(&mut bench, 10 * SECOND);
            assert!(bench.assists());
            effort
        });
        let ratio = assisted / none;
        assert!(ratio < 0.75 && resisted > 1.1 * none, "{cadence} Hz: {none} {assisted} {resisted}");
    }
}

#[test]
fn a_change_of_cadence_by_a_fifth_is_followed_in_three_cycles() {
    for (before, after) in [(0.8, 0.96), (0.8, 0.64)] {
        let change = CadenceChange { at: 12.0, cadence_hz: after, within: 0.5 };
        let motion =
            IntendedMotion::Gait(hal_sim::wearer::motion::Gait { change: Some(change), ..gait(before) });
        let mut bench = Bench::assisting(&insisting(), POSTURE, shares(0.3));
        bench.intend(Intention::Follow(motion));
        bench.run(12 * SECOND);
        let (hertz, gate) = oscillates_at(&bench);
        assert!((hertz / before - 1.0).abs() < 0.02 && gate == 1.0, "{hertz} {gate}");
        let cycles = (3.0 / after * f64::from(SECOND)) as u32;
        bench.run(SECOND / 2 + cycles);
        let (hertz, gate) = oscillates_at(&bench);
        assert!((hertz / after - 1.0).abs() < 0.04 && gate > 0.5, "{hertz} {gate}");
    }
}

#[test]
fn a_wearer_who_goes_limp_or_resists_gets_nothing_after_a_cycle() {
    for after in [Intention::Limp, Intention::Resist] {
        let mut bench = Bench::assisting(&super::bench::person(), POSTURE, shares(0.5));
        bench.intend(Intention::Follow(walking(0.8)));
        bench.run(10 * SECOND);
        assert!(oscillates_at(&bench).1 > 0.5, "the gate is open");
        bench.intend(after);
        let cycle = 5 * SECOND / 4;
        bench.run(cycle);
        let from = bench.received_j();
        bench.run(4 * cycle);
        let given = bench.received_j() - from;
        assert!(given < 0.05 && oscillates_at(&bench).1 == 0.0, "{after:?}: {given} J");
    }
}

#[test]
fn irregular_motion_is_not_assisted() {
    let reaching = hal_sim::wearer::motion::Reaching {
        low: [0.3, 0.5],
        high: [0.7, 1.3],
        durations: [0.5, 1.2],
        seed: 5,
    };
    let mut bench = Bench::assisting(&insisting(), POSTURE, shares(0.5));
    bench.intend(Intention::Follow(IntendedMotion::Reaching(reaching)));
    let mut widest = 0.0_f64;
    for _ in 0..30 * SECOND {
        bench.tick(None);
        widest = widest.max(oscillates_at(&bench).1);
    }
    assert!(widest < 0.5, "{widest}");
}
