//! Hours of rows in single precision; no row lost, no order broken.

use super::*;
use crate::ident::record::factor::Factor;
use crate::ident::record::reweighting::weighted;
use crate::testing::TestRandom;

const COLUMNS: usize = 6;
type Blocks = Window<f32, 1, COLUMNS, 1500>;

fn blocks() -> Blocks {
    Blocks::with_columns(COLUMNS, [None; 2], 0)
}

fn row(index: u32) -> FilteredRows<f64, 1, COLUMNS> {
    let time = f64::from(index) / 50.0;
    let phase = |rate: f64| real::sin_cos(rate * (time % 1000.0));
    let (slow, fast) = (phase(0.63), phase(2.51));
    let regressor = [slow.0, slow.1, fast.0, 0.3 * fast.1, 1.0, real::sign(slow.0)];
    let torque = 10.0 * slow.0 + 3.0 * slow.1 + fast.0 - 0.5 * fast.1 + 2.0 + 3.0 * regressor[5];
    FilteredRows { regressor: [regressor], stribeck: [[0.0; BANK]], torque: [torque], still: [0.0] }
}

fn rounded(rows: &FilteredRows<f64, 1, COLUMNS>) -> FilteredRows<f32, 1, COLUMNS> {
    FilteredRows {
        regressor: rows.regressor.map(|row| row.map(|element| element as f32)),
        stribeck: [[0.0; BANK]],
        torque: rows.torque.map(|torque| torque as f32),
        still: [0.0],
    }
}

#[test]
fn ten_hours_of_rows_in_single_precision_keep_the_parameters() {
    let mut random = TestRandom::new(5);
    let mut window = blocks();
    let (mut naive, mut double) = (Factor::<f32, COLUMNS>::new(), Factor::<f64, COLUMNS>::new());
    for index in 0..1_800_000 {
        let mut exact = row(index);
        exact.torque[0] += random.normal();
        let single = rounded(&exact);
        double.insert(&exact.regressor[0], exact.torque[0]);
        naive.insert(&single.regressor[0], single.torque[0]);
        assert!(window.insert(&single, &[true]));
    }
    let all = weighted(&window, 0, &[1.0; LARGEST_BLOCKS]);
    let (truth, inverse) = (double.solve(COLUMNS), double.inverse(COLUMNS));
    let sigmas = |values: &[f32]| {
        let errors = (0..COLUMNS).map(|column| {
            let sigma = inverse[column].iter().map(|element| element * element).sum::<f64>();
            (f64::from(values[column]) - truth[column]).abs() / real::sqrt(sigma)
        });
        errors.fold(0.0, f64::max)
    };
    let (kept, lost) = (sigmas(&packed::solve(&all, COLUMNS, 1e-4)), sigmas(&naive.solve(COLUMNS)));
    assert!(kept < 0.1, "window {kept} sigma off");
    assert!(lost > 1.0, "a single factor would do as well ({lost}): then blocks are not needed for this");
    assert!((f64::from(packed::residual(&all, COLUMNS)) / double.residual() - 1.0).abs() < 1e-3);
}

#[test]
fn blocks_keep_their_order_and_every_row_and_differ_by_two_levels_only() {
    let mut window = blocks();
    let capacity = window.capacity;
    for index in 0..20_000 {
        assert!(window.insert(&rounded(&row(index)), &[true]));
        if index % 997 != 0 {
            continue;
        }
        let blocks = window.blocks();
        assert!(blocks <= capacity);
        let rows: f32 = (0..blocks).filter_map(|block| window.part(block, 0)).map(|part| part.rows).sum();
        assert_eq!(rows, (index + 1) as f32);
        // Older blocks are never shorter, except for the open one.
        let lengths = (0..blocks.saturating_sub(1)).map(|block| window.outputs(block));
        assert!(lengths.clone().zip(lengths.skip(1)).all(|(older, younger)| older >= younger));
        // At least half of the blocks have one of the two largest lengths.
        let longest = window.outputs(0);
        let long = (0..blocks).filter(|&block| window.outputs(block) * 2 >= longest).count();
        assert!(blocks < capacity - 1 || 2 * long >= capacity, "{long} of {blocks}");
    }
}

#[test]
fn a_window_without_room_says_so() {
    let mut window = Window::<f32, 1, COLUMNS, 40>::new();
    let base = core::array::from_fn(|column| column);
    window.arrange([Columns { base, count: COLUMNS, friction: [None; 2], bank: 0, start: 0 }]);
    assert!(!window.insert(&rounded(&row(0)), &[true]));
    assert_eq!(window.blocks(), 0);
}

#[test]
fn blocks_say_the_same_before_while_and_after_two_of_them_are_joined() {
    let mut window = Window::<f64, 2, COLUMNS, 1500>::with_columns(COLUMNS, [None; 2], 0);
    let (mut joined, parameters) = (0, [0.5; COLUMNS]);
    for index in 0..2000 {
        let [one, torque] = [row(index), row(index)].map(|rows| (rows.regressor[0], rows.torque[0]));
        let rows = FilteredRows {
            regressor: [one.0; 2],
            stribeck: [[0.0; BANK]; 2],
            torque: [torque.1, 2.0 * torque.1],
            still: [0.0; 2],
        };
        assert!(window.insert(&rows, &[true; 2]));
        let content = |window: &Window<f64, 2, COLUMNS, 1500>, joint| {
            let parts = (0..window.blocks()).filter_map(|block| window.part(block, joint));
            parts.fold((0.0, 0.0), |(rows, cost), part| {
                (rows + part.rows, cost + packed::cost(part.factor, COLUMNS, &parameters))
            })
        };
        let before = [content(&window, 0), content(&window, 1)];
        while window.tidy() {
            joined += 1;
            for joint in 0..2 {
                let now = content(&window, joint);
                assert_eq!(now.0, f64::from(index + 1));
                // Two thousand rows in double precision.
                assert!((now.1 / before[joint].1 - 1.0).abs() < 1e-11, "{now:?} {before:?}");
            }
        }
    }
    assert!(joined > 100, "{joined} parts joined: the room was never full");
}
