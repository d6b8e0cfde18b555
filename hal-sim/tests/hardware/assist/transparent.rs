//! Interaction torque with the drives off and with a transparent leg, at the same motion of the wearer.

use super::bench::{Bench, Measured, SECOND, insisting};
use super::{HALF, MOST, POSTURE, walking};
use hal_sim::wearer::motion::IntendedMotion;
use hal_sim::wearer::muscles::Intention;
use scarab::leg::AssistShares;

/// Steady motion of an insisting wearer; `None` leaves the drives off.
fn measured(motion: IntendedMotion, shares: Option<AssistShares>) -> Measured {
    let mut bench = match shares {
        Some(shares) => Bench::assisting(&insisting(), POSTURE, shares),
        None => Bench::off(&insisting(), POSTURE),
    };
    bench.intend(Intention::Follow(motion));
    bench.run(4 * SECOND);
    let measured = bench.measure(10 * SECOND);
    assert!(shares.is_none() || bench.assists());
    measured
}

#[test]
fn interaction_torque_falls_to_half_and_to_a_quarter() {
    for cadence in [0.5, 0.8] {
        let off = measured(walking(cadence), None);
        for (shares, goal) in [(HALF, 0.55), (MOST, 0.25)] {
            let on = measured(walking(cadence), Some(shares));
            for joint in 0..2 {
                let ratio = on.interaction[joint] / off.interaction[joint];
                // Half of the inertia leaves half of its torque and none of friction and weight.
                assert!(ratio < goal, "{cadence} Hz, joint {joint}: {ratio} of {off:?}");
            }
        }
    }
}

#[test]
fn an_insisting_wearer_moves_the_same_in_both() {
    let (off, on) = (measured(walking(0.5), None), measured(walking(0.5), Some(MOST)));
    for joint in 0..2 {
        // Amplitudes are 0.2 to 0.4 rad.
        assert!(off.deviation[joint] < 0.02 && on.deviation[joint] < 0.02, "{off:?} {on:?}");
    }
}

#[test]
fn a_leg_at_rest_stays_at_rest() {
    let mut bench = Bench::assisting(&insisting(), POSTURE, MOST);
    bench.intend(Intention::Follow(IntendedMotion::Rest(POSTURE)));
    bench.run(5 * SECOND);
    let from = bench.world.anatomical_position();
    let mut fastest = 0.0_f64;
    for _ in 0..5 * SECOND {
        bench.tick(None);
        fastest = bench.world.velocity().iter().fold(fastest, |fastest, speed| fastest.max(speed.abs()));
    }
    let to = bench.world.anatomical_position();
    // Less than one count (15 urad) in a tenth of a second.
    assert!(fastest < 1.5e-4, "{fastest}");
    assert!((0..2).all(|joint| (to[joint] - from[joint]).abs() < 1.5e-5), "{from:?} {to:?}");
}
