use super::*;
use crate::ident::record::motion_record::TorqueSize;
use crate::ident::record::row_model::RowModel;
use crate::ident::signal::smoothing::Smoothed;
use crate::ident::solve::estimate::{Plan, Problem};
use crate::ident::solve::testing::{ALL, B as BASE, planar};
use crate::model::{LegParameters, Payload};
use crate::testing::TestRandom;
use nalgebra::Vector3;

fn model<T: Real>() -> RowModel<T, 2, BASE> {
    planar(0.39, &ALL)
}

/// XX XY XZ YY YZ ZZ HX HY HZ M IA FC FV OFF of hip and knee.
const LEG: LegParameters<f64, 2> = [
    [0.03, 0.0, 0.0, 0.58, 0.0, 0.585, 2.04, 0.02, 0.0, 10.3, 1.9, 4.6, 5.0, 0.4],
    [0.05, -0.08, 0.0, 0.59, 0.0, 0.633, 1.76, 0.20, 0.0, 6.9, 1.9, 4.7, 3.3, -0.2],
];
const ON_THE_KNEE: Payload<f64> = Payload { joint: 1, mass: 5.0, position: Vector3::new(0.2, 0.0, 0.0) };
const ON_THE_HIP: Payload<f64> = Payload { joint: 0, mass: 5.0, position: Vector3::new(0.3, 0.0, 0.0) };

fn base_of<T: Real>(payload: &Payload<f64>) -> [T; BASE] {
    model::<f64>().base.project(&payload.parameters::<2>()).map(T::from_double)
}

/// 500 independent rows; torque in true N m times `ratios`, with white noise of `noise` times that.
fn record<T: Real>(
    carried: Option<&Payload<f64>>,
    ratios: [f64; 2],
    noise: f64,
    seed: u64,
) -> Record<T, 2, BASE> {
    let (exact, rounded) = (model::<f64>(), model::<T>());
    let mut leg = LEG;
    carried.into_iter().for_each(|payload| payload.add_to(&mut leg));
    let values = exact.base.project(&leg);
    let mut random = TestRandom::new(seed);
    let mut factors: [Factor<T, BASE>; 2] = core::array::from_fn(|_| Factor::new());
    let mut squares = [0.0; 2];
    for _ in 0..500 {
        let instant = Smoothed {
            position: [0.5 + random.within(0.4), -0.9 + random.within(0.7)],
            velocity: [random.within(1.5), random.within(2.0)],
            acceleration: [random.within(4.0), random.within(6.0)],
            torque: [0.0; 2],
        };
        let rows = exact.rows(&instant);
        let device = rounded.rows(&Smoothed {
            position: instant.position.map(T::from_double),
            velocity: instant.velocity.map(T::from_double),
            acceleration: instant.acceleration.map(T::from_double),
            torque: [T::zero(); 2],
        });
        for joint in 0..2 {
            let real: f64 = rows.regressor[joint].iter().zip(&values).map(|(left, right)| left * right).sum();
            let logged = ratios[joint] * (real + noise * random.normal());
            factors[joint].insert(&device.regressor[joint], T::from_double(logged));
            squares[joint] += logged * logged / 500.0;
        }
    }
    let torque = squares.map(|square| {
        let size = T::from_double(real::sqrt(square));
        TorqueSize { mean_absolute: size, root_mean_square: size, speed: T::one() }
    });
    Record::plain(factors, torque, 500)
}

const RATIOS: [f64; 2] = [1.0 / 1.2, 1.1];

#[test]
fn a_mass_on_the_last_link_determines_every_constant_in_either_precision() {
    let load = base_of(&ON_THE_KNEE);
    let (without, with) = (record::<f64>(None, RATIOS, 0.0, 1), record(Some(&ON_THE_KNEE), RATIOS, 0.0, 2));
    let (device, device_with) =
        (record::<f32>(None, RATIOS, 0.0, 1), record(Some(&ON_THE_KNEE), RATIOS, 0.0, 2));
    for joint in 0..2 {
        let found = torque_constant_ratio(&without, &with, joint, &load).expect("felt");
        // Thousands of rotations in double precision.
        assert!((found.ratio - RATIOS[joint]).abs() < 1e-10, "{}", found.ratio);
        assert!(found.is_consistent());
        let single = torque_constant_ratio(&device, &device_with, joint, &load.map(|value| value as f32));
        // Rounding of single precision.
        assert!((f64::from(single.expect("felt").ratio) - RATIOS[joint]).abs() < 1e-4);
    }
}

#[test]
fn a_mass_on_the_first_link_determines_the_first_constant_only() {
    let load = base_of(&ON_THE_HIP);
    let (without, with) = (record::<f64>(None, RATIOS, 0.0, 1), record(Some(&ON_THE_HIP), RATIOS, 0.0, 2));
    let hip = torque_constant_ratio(&without, &with, 0, &load).expect("felt");
    assert!((hip.ratio - RATIOS[0]).abs() < 1e-10);
    assert_eq!(torque_constant_ratio(&without, &with, 1, &load), None);
    assert_eq!(torque_constant_ratio(&without, &with, 2, &load), None, "no such joint");
}

#[test]
fn the_reported_sigma_of_the_ratio_is_its_spread_and_honest_runs_are_consistent() {
    let load = base_of(&ON_THE_KNEE);
    let (mut pulls, mut consistent) = (Vec::new(), 0);
    for seed in 0..200 {
        let without = record::<f64>(None, RATIOS, 1.0, 1000 + seed);
        let with = record(Some(&ON_THE_KNEE), RATIOS, 1.0, 5000 + seed);
        for (joint, truth) in RATIOS.iter().enumerate() {
            let found = torque_constant_ratio(&without, &with, joint, &load).expect("felt");
            pulls.push((found.ratio - truth) / found.sigma);
            consistent += u32::from(found.is_consistent());
        }
    }
    let spread = real::sqrt(pulls.iter().map(|pull| pull * pull).sum::<f64>() / 400.0);
    // 400 draws: 3.5 % of spread each way, three of them.
    assert!((spread - 1.0).abs() < 0.105, "{spread}");
    let mean = pulls.iter().sum::<f64>() / 400.0;
    assert!(mean.abs() < 0.15, "{mean}");
    // Five spreads of chi-square: none of 400.
    assert_eq!(consistent, 400);
}

#[test]
fn a_wrong_mass_scales_the_constant_unnoticed_and_a_wrong_position_is_noticed() {
    let without = record::<f64>(None, RATIOS, 0.3, 1);
    let with = record(Some(&ON_THE_KNEE), RATIOS, 0.3, 2);
    let stated = |mass: f64, x: f64| {
        let load = base_of(&Payload { mass, position: Vector3::new(x, 0.0, 0.0), ..ON_THE_KNEE });
        torque_constant_ratio(&without, &with, 1, &load).expect("felt")
    };
    let right = stated(5.0, 0.2);
    let heavy = stated(5.5, 0.2);
    // The product of mass and ratio is what is measured.
    assert!((heavy.ratio * 1.1 - right.ratio).abs() < 1e-9);
    assert!(right.is_consistent() && heavy.is_consistent());
    assert!(!stated(5.0, 0.4).is_consistent());
}

#[test]
fn a_corrected_record_is_the_record_of_right_constants_without_the_load() {
    let load: [f64; BASE] = base_of(&ON_THE_KNEE);
    let noise = 0.2;
    let corrected = record::<f64>(Some(&ON_THE_KNEE), RATIOS, noise, 7).corrected(&RATIOS, &load);
    let right = record::<f64>(None, [1.0; 2], noise, 7);
    for plan in [Plan::OneTime, Plan::Sequential] {
        let found = Problem::new(&corrected, &model()).least_squares(plan);
        let expected = Problem::new(&right, &model()).least_squares(plan);
        for base in 0..BASE {
            assert!((found.values[base] - expected.values[base]).abs() < 1e-9);
            assert!((found.covariance[base][base] - expected.covariance[base][base]).abs() < 1e-9);
        }
    }
    for joint in 0..2 {
        let (size, expected) = (corrected.torque[joint], right.torque[joint]);
        assert!((size.root_mean_square - expected.root_mean_square).abs() < 1e-9);
    }
}

#[test]
fn a_widened_covariance_holds_the_spread_that_an_uncertain_constant_adds() {
    let exact = record::<f64>(None, [1.0; 2], 0.5, 3);
    let solve = |ratios: [f64; 2]| {
        Problem::new(&exact.corrected(&ratios, &[0.0; BASE]), &model()).least_squares(Plan::OneTime)
    };
    let (sigma, narrow) = (0.02, solve([1.0; 2]));
    let mut wide = narrow.clone();
    widen(&mut wide, &solve([1.0 + sigma, 1.0]));
    widen(&mut wide, &solve([1.0, 1.0 + sigma]));
    let mut random = TestRandom::new(4);
    let mut squares = [0.0; BASE];
    for _ in 0..400 {
        let drawn = solve([1.0 + sigma * random.normal(), 1.0 + sigma * random.normal()]);
        for (sum, (value, middle)) in squares.iter_mut().zip(drawn.values.iter().zip(&narrow.values)) {
            *sum += (value - middle) * (value - middle) / 400.0;
        }
    }
    for base in 0..BASE {
        let added = wide.covariance[base][base] - narrow.covariance[base][base];
        // A variance of 400 draws spreads by 7 %; three of them, plus the nonlinearity of a step of 2 %.
        assert!((squares[base] / added - 1.0).abs() < 0.27, "{base}: {} {added}", squares[base]);
    }
}
