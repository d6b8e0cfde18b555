//! Weight support.

use super::HALF;
use super::bench::{Bench, SECOND, insisting, models};
use hal_sim::wearer::motion::{IntendedMotion, Strokes};
use hal_sim::wearer::muscles::Intention;
use scarab::assist::CompensationModel;
use scarab::leg::AssistShares;

const GRAVITY: [f32; 3] = [9.81, 0.0, 0.0];

/// Weight of the wearer's leg at anatomical angles, N m, anatomical.
fn weight(model: &CompensationModel<2>, [hip, knee]: [f64; 2]) -> [f64; 2] {
    let [hip, knee] = model.wearer_weight(&[hip as f32, -knee as f32]).map(f64::from);
    [hip, -knee]
}

/// Share of the wearer's weight that the muscles carry in slow strokes: the slope of their torque over the
/// weight's. Friction of either direction cancels.
fn carried(share: f32) -> f64 {
    let [empty, worn] = models(1.0);
    let model = empty.compensation(Some(&worn), GRAVITY);
    let strokes = Strokes { postures: [[0.7, 1.4], [0.3, 0.5]], durations: [1.5, 0.5, 1.5, 0.5] };
    let shares = AssistShares { weight: share, ..HALF };
    let mut bench = Bench::assisting(&insisting(), [0.6, 1.0], shares);
    bench.intend(Intention::Follow(IntendedMotion::Strokes(strokes)));
    bench.run(4 * SECOND);
    let (mut both, mut square) = (0.0, 0.0);
    for _ in 0..16 * SECOND {
        bench.tick(None);
        let truth = bench.wearer();
        let needed = weight(&model, truth.position);
        for joint in 0..2 {
            both += truth.muscle_torque[joint] * needed[joint];
            square += needed[joint] * needed[joint];
        }
    }
    assert!(bench.assists());
    both / square
}

#[test]
fn half_support_takes_half_of_the_wearers_weight() {
    let [none, half, whole] = [0.0, 0.5, 1.0].map(carried);
    let (first, second) = (none - half, half - whole);
    assert!((0.45..0.55).contains(&first) && (0.45..0.55).contains(&second), "{none} {half} {whole}");
}
