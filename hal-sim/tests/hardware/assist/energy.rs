//! Energy given to the wearer: the firmware's observer against the simulated bodies and cuffs.

use super::bench::{Bench, SECOND, exoskeleton, insisting, person};
use super::{MOST, POSTURE, walking};
use hal_sim::mechanism::Mechanism;
use hal_sim::wearer::muscles::Intention;
use scarab::assist::energy::BUDGET_J;
use scarab::leg::AssistShares;

/// Energy that the motors injected besides weight and friction: what passed to the wearer, and the kinetic
/// energy that the compensation does not lend, J.
fn injected_j(bench: &Bench, mechanism: &Mechanism<2>) -> f64 {
    let truth = bench.world.truth();
    let joints = |[hip, knee]: [f64; 2]| [hip, -knee];
    let kinetic = mechanism.kinetic_energy(&joints(truth.position), &joints(truth.velocity));
    let given: f64 = bench.wearer().cuffs.iter().map(|cuff| cuff.given).sum();
    given + (1.0 - f64::from(MOST.inertia)) * kinetic
}

#[test]
fn the_observer_agrees_with_the_bodies_and_cuffs() {
    let mut bench = Bench::assisting(&insisting(), POSTURE, MOST);
    bench.intend(Intention::Follow(walking(0.8)));
    let mechanism = Mechanism::new(&exoskeleton());
    let mut lowest = injected_j(&bench, &mechanism);
    let (mut worst, mut most) = (0.0_f64, 0.0_f64);
    for _ in 0..10 * SECOND {
        bench.tick(None);
        let injected = injected_j(&bench, &mechanism);
        lowest = lowest.min(injected);
        let observed = f64::from(bench.leg.law().energy().expect("a session").given_j());
        worst = worst.max((observed - (injected - lowest)).abs());
        most = most.max(observed);
    }
    // 30 J flow back and forth in each cycle.
    assert!(worst < 0.4 && most > 3.0 * worst, "{worst} of {most} J");
}

/// Most energy that a wearer received from any instant on, less what raised or moved the wearer's own leg, J.
fn most_received(bench: &mut Bench, ticks: u32) -> f64 {
    let received = |bench: &Bench| bench.received_j() - bench.wearer().mechanical_energy;
    let (mut lowest, mut most) = (received(bench), 0.0_f64);
    for _ in 0..ticks {
        bench.tick(None);
        let received = received(bench);
        lowest = lowest.min(received);
        most = most.max(received - lowest);
    }
    most
}

#[test]
fn a_limp_or_resisting_wearer_receives_less_than_the_budget() {
    for shares in [MOST, AssistShares { weight: 0.5, ..MOST }, AssistShares { weight: 1.0, ..MOST }] {
        for intention in [Intention::Limp, Intention::Resist] {
            let mut bench = Bench::enabled(&person(), POSTURE);
            bench.run(SECOND / 2);
            bench.begin(shares);
            bench.intend(intention);
            bench.run(SECOND);
            // A push that sets both legs in motion.
            bench.world.push(1, 25.0, 0.3);
            bench.run(SECOND / 2);
            let most = most_received(&mut bench, 10 * SECOND);
            assert!(most < f64::from(BUDGET_J), "{shares:?} {intention:?}: {most} J");
        }
    }
}
