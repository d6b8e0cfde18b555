//! The quick update on rows made from a known change: noise of known size, gait-like postures, no filter.

use super::*;
use crate::ident::record::motion_record::TorqueSize;
use crate::ident::solve::estimate::{Plan, Problem};
use crate::ident::solve::testing::{ALL, B as BASE, planar};
use crate::model::{JointState, LegParameters, Payload, regressor};
use crate::testing::TestRandom;

const SIGMA: f64 = 0.5;
const TRUTH: LegParameters<f64, 2> = [
    [0.03, -0.016, 0.0, 0.5, 0.0, 0.506, 1.7, 0.10, 0.0, 8.5, 0.12, 3.0, 1.2, 0.4],
    [0.013, 0.011, 0.0, 0.25, 0.0, 0.2546, 0.864, -0.072, 0.0, 4.8, 0.08, 2.0, 0.8, -0.3],
];

fn model<T: Real>() -> RowModel<T, 2, BASE> {
    planar(0.45, &ALL)
}

/// Independent rows of random states: `speed` and `acceleration` bound them, `bias`
/// is a torque beyond the model.
fn record<T: Real>(
    truth: &LegParameters<f64, 2>,
    states: u32,
    [speed, acceleration, bias]: [f64; 3],
    seed: u64,
) -> Record<T, 2, BASE> {
    let (model, mut random) = (model::<f64>(), TestRandom::new(seed));
    let values = model.base.project(truth);
    let mut factors = [Factor::<T, BASE>::new(), Factor::new()];
    for _ in 0..states {
        let state = JointState {
            q: [0.45 + random.within(0.4), -0.8 + random.within(0.7)],
            qd: [random.within(speed), random.within(speed)],
            qdd: [random.within(acceleration), random.within(acceleration)],
        };
        let full = regressor(&model.chain, &state, &model.gravity);
        for (joint, row) in full.iter().enumerate() {
            let mut selected = [0.0; BASE];
            model.base.select(row, &mut selected);
            let exact: f64 = selected.iter().zip(&values).map(|(element, value)| element * value).sum();
            let torque = exact + bias * state.q[0] * state.q[0] + SIGMA * random.normal();
            factors[joint].insert(&selected.map(T::from_double), T::from_double(torque));
        }
    }
    let size = TorqueSize {
        mean_absolute: T::from_double(10.0),
        root_mean_square: T::from_double(12.0),
        speed: T::from_double(speed),
    };
    Record { noise: [T::from_double(SIGMA); 2], ..Record::plain(factors, [size; 2], states) }
}

const EXCITING: [f64; 3] = [3.0, 10.0, 0.0];
const WALKING: [f64; 3] = [1.5, 4.0, 0.0];

fn updated<T: Real>(after: &LegParameters<f64, 2>, motion: [f64; 3], seed: u64) -> Update<T, 2, BASE> {
    let (model, training) = (model::<T>(), record::<T>(&TRUTH, 700, EXCITING, seed));
    let estimate = Problem::new(&training, &model).least_squares(Plan::OneTime);
    let baseline = Baseline::new(estimate, &training, core::iter::empty());
    let rows = record::<T>(after, 400, motion, seed + 5000);
    Update::new(&model, &baseline, &rows, &Thresholds::default(), T::from_double(1.386))
}

fn loaded(joint: usize, mass: f64, position: [f64; 3]) -> LegParameters<f64, 2> {
    let mut leg = TRUTH;
    Payload { joint, mass, position: position.into() }.add_to(&mut leg);
    leg
}

fn with_friction(factor: f64) -> LegParameters<f64, 2> {
    TRUTH.map(|mut joint| {
        joint[Parameter::FC.index()] *= factor;
        joint[Parameter::FV.index()] *= factor;
        joint
    })
}

#[test]
fn what_changed_is_distinguished_from_what_did_not() {
    for seed in 0..10 {
        let cause = |leg: &LegParameters<f64, 2>| updated::<f32>(leg, WALKING, seed).cause;
        assert_eq!(cause(&loaded(1, 3.0, [0.2, 0.05, 0.0])), Cause::Payload { link: 1 });
        assert_eq!(cause(&loaded(1, -1.0, [0.2, 0.0, 0.0])), Cause::Payload { link: 1 });
        assert_eq!(cause(&loaded(0, 4.0, [0.2, 0.0, 0.0])), Cause::Payload { link: 0 });
        assert_eq!(cause(&with_friction(1.5)), Cause::Friction);
        assert_eq!(cause(&with_friction(0.6)), Cause::Friction);
    }
}

#[test]
fn rows_of_an_unchanged_leg_offer_no_change() {
    for seed in 0..40 {
        let update = updated::<f32>(&TRUTH, WALKING, 900 + seed);
        assert_eq!(update.cause, Cause::Nothing, "seed {seed}");
        assert!(!update.is_change());
        assert_eq!(update.energy_before, update.energy_after);
    }
}

#[test]
fn what_no_hypothesis_explains_is_refused_and_leaves_the_values() {
    let mut both = loaded(1, 3.0, [0.2, 0.0, 0.0]);
    both[1][Parameter::FC.index()] += 2.0;
    let bent = [WALKING[0], WALKING[1], 6.0];
    for update in [updated::<f64>(&both, WALKING, 1), updated::<f64>(&TRUTH, bent, 1)] {
        assert_eq!(update.cause, Cause::Unexplained);
        assert!(update.verdict.has(Reason::Residual));
        assert_eq!(update.energy_before, update.energy_after);
    }
}

#[test]
fn no_body_of_negative_inertia_is_ever_a_payload() {
    // A mass with less inertia than a point of its mass and moment: 2 kg at 0.3 m without the 0.18 kg m2.
    let mut impossible = TRUTH;
    impossible[1][Parameter::M.index()] += 2.0;
    impossible[1][Parameter::HX.index()] += 0.6;
    let update = updated::<f64>(&impossible, WALKING, 2);
    assert!(update.payload[1].explains(&Thresholds::default()), "it fits, and yet");
    assert_eq!(update.cause, Cause::Unexplained);
}

#[test]
fn the_sigma_of_a_payload_counts_the_models_own_error() {
    let find = |parameter| PAYLOAD_PARAMETERS.iter().position(|known| *known == parameter).expect("listed");
    let truth = [(Parameter::M, 3.0), (Parameter::HX, 0.6), (Parameter::HY, 0.15), (Parameter::ZZ, 0.1275)];
    let after = loaded(1, 3.0, [0.2, 0.05, 0.0]);
    let runs: Vec<_> = (0..150).map(|seed| updated::<f64>(&after, WALKING, 100 + seed)).collect();
    for (parameter, truth) in truth {
        let index = find(parameter);
        let squares = runs.iter().map(|run| {
            let off = (run.payload[1].values[index] - truth) / run.payload[1].sigma(index).expect("known");
            off * off
        });
        let mean = squares.sum::<f64>() / runs.len() as f64;
        // Mean square of 150 normal variables: 1 +- 0.115; without the model's error it would be about 1.6.
        assert!((0.65..=1.35).contains(&mean), "{parameter:?}: {mean}");
    }
    let chi_square = runs.iter().map(|run| run.payload[1].chi_square).sum::<f64>() / runs.len() as f64;
    let freedom = runs[0].payload[1].freedom;
    // Mean of 150 chi-squares of nine degrees of freedom: +- 0.35.
    assert!((chi_square - freedom).abs() < 1.05, "{chi_square} of {freedom}");
}

#[test]
fn the_updated_base_values_have_the_covariance_they_claim() {
    let after = loaded(1, 3.0, [0.2, 0.05, 0.0]);
    let truth = model::<f64>().base.project(&after);
    let mut squares = [0.0; BASE];
    let runs = 150;
    for seed in 0..runs {
        let update = updated::<f64>(&after, WALKING, 300 + seed);
        assert_eq!(update.cause, Cause::Payload { link: 1 });
        for (base, (sum, truth)) in squares.iter_mut().zip(truth).enumerate() {
            let off = (update.estimate.values[base] - truth) / update.estimate.sigma(base).expect("known");
            *sum += off * off / runs as f64;
        }
    }
    // Mean square of 150 normal variables: 1 +- 0.115. Without the error that the held parameters pass on to
    // the payload one of them has 0.54.
    assert!(squares.iter().all(|square| (0.65..=1.35).contains(square)), "{squares:?}");
}

#[test]
fn single_precision_agrees_with_double() {
    let after = loaded(1, 3.0, [0.2, 0.05, 0.0]);
    let (single, double) = (updated::<f32>(&after, WALKING, 7), updated::<f64>(&after, WALKING, 7));
    assert_eq!(single.cause, double.cause);
    for (base, (one, other)) in single.estimate.values.iter().zip(&double.estimate.values).enumerate() {
        // Two triangular factors with a condition number of some hundred, in units of the sigma.
        let sigma = double.estimate.sigma(base).expect("known");
        assert!((f64::from(*one) - other).abs() < 0.02 * sigma, "{base}: {one} {other} sigma {sigma}");
    }
}
