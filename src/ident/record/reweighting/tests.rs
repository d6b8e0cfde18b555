//! Pushes lose their weight; noise and torque that the columns explain do not.

use super::*;
use crate::ident::record::rows::FilteredRows;
use crate::ident::record::stribeck::BANK;
use crate::testing::TestRandom;

const COLUMNS: usize = 6;
const TRUTH: [f64; COLUMNS] = [10.0, 3.0, 1.0, -0.5, 2.0, 3.0];
const ROW_S: f64 = 0.02;
type Blocks = Window<f32, 1, COLUMNS, 8192>;

fn columns(time: f64) -> [f64; COLUMNS] {
    let phase = |rate: f64| real::sin_cos(rate * time);
    let (slow, fast) = (phase(0.63), phase(2.51));
    [slow.0, slow.1, fast.0, 0.3 * fast.1, 1.0, real::sign(phase(1.1).0)]
}

/// Independent rows with noise of one N m, plus `disturbance` at each row's time.
fn motion(rows: u32, seed: u64, disturbance: impl Fn(f64) -> f64) -> Blocks {
    let mut random = TestRandom::new(seed);
    let mut window = Blocks::with_columns(COLUMNS, [None; 2], 0);
    for index in 0..rows {
        let time = ROW_S * f64::from(index);
        let row = columns(time);
        let torque = row.iter().zip(TRUTH).map(|(element, value)| element * value).sum::<f64>();
        let torque = torque + disturbance(time) + random.normal();
        let rows = FilteredRows {
            regressor: [row.map(|element| element as f32)],
            stribeck: [[0.0; BANK]],
            torque: [torque as f32],
            still: [0.0],
        };
        assert!(window.insert(&rows, &[true]));
    }
    window
}

/// Half a sine of 0.4 s.
fn push(time: f64, start: f64, peak: f64) -> f64 {
    let phase = (time - start) / 0.4;
    if (0.0..1.0).contains(&phase) { peak * real::sin_cos(core::f64::consts::PI * phase).0 } else { 0.0 }
}

/// Six pushes in 18 s, both signs: a third of twenty a minute.
fn pushes(time: f64) -> f64 {
    let starts = [1.3, 4.1, 6.9, 10.2, 13.6, 16.4];
    starts.iter().zip([12.0, -9.0, 15.0].iter().cycle()).map(|(&start, &peak)| push(time, start, peak)).sum()
}

/// Share of the blocks that lose half of their weight.
fn lost(window: &Blocks, weights: &Weights<f32>) -> f64 {
    let blocks = window.blocks();
    weights.iter().take(blocks).filter(|&&weight| weight < 0.5).count() as f64 / blocks as f64
}

/// Largest error of a parameter, in the standard deviations that undisturbed rows would leave.
fn error(window: &Blocks, weights: &Weights<f32>) -> f64 {
    let found = packed::solve(&weighted(window, 0, weights), COLUMNS, 1e-4);
    let mut information = crate::ident::record::factor::Factor::<f64, COLUMNS>::new();
    for index in 0..900_u32 {
        information.insert(&columns(ROW_S * f64::from(index)), 0.0);
    }
    let inverse = information.inverse(COLUMNS);
    let sigma =
        |column: usize| real::sqrt(inverse[column].iter().map(|element| element * element).sum::<f64>());
    let errors = (0..COLUMNS).map(|column| (f64::from(found[column]) - TRUTH[column]).abs() / sigma(column));
    errors.fold(0.0, f64::max)
}

#[test]
fn pushes_lose_their_weight_and_the_parameters_come_back() {
    for seed in 0..10 {
        let window = motion(900, seed, pushes);
        let weights = weigh(&window, 0, 1.0);
        let (plain, robust) = (error(&window, &[1.0; LARGEST_BLOCKS]), error(&window, &weights));
        let lost = lost(&window, &weights);
        println!("seed {seed}: {plain:.1} sigma plain, {robust:.1} robust, {lost:.2} lost");
        // Six parameters from a sixth fewer rows: 4.5 sigma in one of ten thousand sets.
        assert!(robust < 4.5 && plain > 2.0 * robust, "{robust} {plain}");
        // 2.4 of 18 s, in blocks of 0.16 and 0.32 s.
        assert!((0.1..0.35).contains(&lost));
    }
}

#[test]
fn noise_alone_loses_next_to_nothing() {
    const SEEDS: u64 = 50;
    let of = |seed| {
        let window = motion(900, seed, |_| 0.0);
        lost(&window, &weigh(&window, 0, 1.0))
    };
    let share = (0..SEEDS).map(of).sum::<f64>() / SEEDS as f64;
    println!("{share:.5}");
    // Half of the weight is lost beyond 3.3 standard deviations: one block of two thousand.
    assert!(share < 3e-3, "{share}");
}

#[test]
fn what_the_columns_explain_is_never_excluded() {
    // Another leg, moved equally: all of the torque differs, none of it is disturbed.
    let other = |time: f64| {
        columns(time).iter().zip([-6.0, 4.0, 8.0, 9.0, -3.0, 2.0]).map(|(y, p)| y * p).sum::<f64>()
    };
    for seed in 0..5 {
        let (one, another) =
            (motion(900, seed, pushes), motion(900, seed, |time| pushes(time) + other(time)));
        for (one, another) in weigh(&one, 0, 1.0).iter().zip(weigh(&another, 0, 1.0)) {
            // Rounding, and the round in which reweighting ends.
            assert!((one - another).abs() < 0.05, "{one} {another}");
        }
    }
}

#[test]
fn a_misfit_that_is_everywhere_is_no_disturbance() {
    let misfit = |time: f64| 3.0 * real::sin_cos(5.3 * time).0;
    for seed in 0..10 {
        let window = motion(900, seed, misfit);
        let share = lost(&window, &weigh(&window, 0, 1.0));
        assert!(share < 0.03, "{share}");
    }
}

#[test]
fn with_too_little_to_trust_every_row_counts() {
    let pushed = |time: f64| push(time, 0.3, 20.0);
    // Seven blocks; then ten blocks whose rows are worth 5.3 independent ones for each column.
    for (rows, information) in [(56, 1.1), (80, 0.4)] {
        let weights = weigh(&motion(rows, 1, pushed), 0, information);
        assert!(weights.iter().all(|&weight| weight == 1.0));
    }
}
