use nalgebra::Vector3;
use rand_core::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::*;
use crate::ident::{
    Choice, DriveChoice, Plan, Recorder, SearchState, Solver, Status, Thresholds, Verdict, status,
};
use crate::model::{
    BaseParameters, Chain, ColumnMask, DenavitHartenberg, JointState, LegParameters, regressor,
};

const B: usize = 13;
const SIGMA: f64 = 0.3;
const STATES: u32 = 400;

type Model<T> = RowModel<T, 2, B>;

fn within(dice: &mut Xoshiro256PlusPlus, bound: f64) -> f64 {
    (dice.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0) * bound
}

/// Model without the columns of `off`, with those of `choice` to be decided.
fn model<T: Real>(choice: Choice, off: &[(usize, Parameter)]) -> Model<T> {
    let length = |joint: usize| if joint == 0 { 0.0 } else { 0.45 };
    let geometry = core::array::from_fn(|joint| DenavitHartenberg { alpha: 0.0, a: length(joint), d: 0.0 });
    let chain = Chain::<f64, 2>::new(&geometry).unwrap().convert();
    let gravity = Vector3::new(T::of(9.81), T::zero(), T::zero());
    let mut mask: ColumnMask<2> = [[true; 14]; 2];
    off.iter().for_each(|(joint, parameter)| mask[*joint][parameter.index()] = false);
    let mut model = RowModel::new(chain, gravity, BaseParameters::analyse(&chain, &gravity, &mask).unwrap());
    model.drive_choice = [DriveChoice { rotor: choice, constant: choice, ..DriveChoice::ALL }; 2];
    model
}

/// Leg with the knee's rotor inertia and both offsets, the candidates for dropping.
fn leg(rotor: f64, offsets: [f64; 2]) -> LegParameters<f64, 2> {
    let mut leg = [
        [0.03, 0.0, 0.0, 0.5, 0.0, 0.51, 1.7, 0.1, 0.0, 8.5, 0.12, 3.0, 1.2, offsets[0]],
        [0.01, 0.0, 0.0, 0.25, 0.0, 0.26, 0.86, -0.07, 0.0, 4.8, rotor, 2.0, 0.8, offsets[1]],
    ];
    leg[0][Parameter::OFF.index()] = offsets[0];
    leg
}

/// Noisy torque of a leg on random states; `angle` maps a random number in -1..1 to the hip's angle.
fn record_on<T: Real>(
    model: &Model<T>,
    leg: &LegParameters<f64, 2>,
    seed: u64,
    angle: fn(f64) -> f64,
) -> Record<T, 2, B> {
    let mut dice = Xoshiro256PlusPlus::seed_from_u64(seed);
    let exact = self::model::<f64>(Choice::On, &[]);
    let mut record = Recorder::<T, 2, B, 256, 26>::new(T::of(8.0)).unwrap().finish();
    let mut squares = [0.0; 2];
    for _ in 0..STATES {
        let mut many = |bound: f64| core::array::from_fn(|_| within(&mut dice, bound));
        let mut state = JointState { q: many(1.0), qd: many(2.0), qdd: many(6.0) };
        state.q[0] = angle(state.q[0]);
        let rows = regressor(&exact.chain, &state, &exact.gravity);
        for (joint, full) in rows.iter().enumerate() {
            let mut row = [T::zero(); B];
            model.base.select(&full.map(|block| block.map(T::of)), &mut row);
            // Twelve uniform numbers: variance 12 a^2 / 3.
            let noise: f64 = (0..12).map(|_| within(&mut dice, SIGMA / 2.0)).sum();
            let torque = crate::model::row_torque(full, leg) + noise;
            record.factors[joint].insert(&row, T::of(torque));
            squares[joint] += torque * torque;
        }
    }
    for (joint, size) in record.torque.iter_mut().enumerate() {
        let mean = squares[joint] / f64::from(STATES);
        (size.root_mean_square, size.speed) = (T::of(crate::real::sqrt(mean)), T::of(1.2));
    }
    (record.rows, record.row_information) = ([STATES; 2], T::one());
    record
}

fn record<T: Real>(model: &Model<T>, leg: &LegParameters<f64, 2>, seed: u64) -> Record<T, 2, B> {
    record_on(model, leg, seed, |angle| angle)
}

fn select<T: Real>(model: &Model<T>, mut record: Record<T, 2, B>) -> Record<T, 2, B> {
    while !step(model, &mut record) {}
    record
}

fn solved<T: Real>(model: &Model<T>, record: Record<T, 2, B>, slice: u32) -> Solver<T, 2, B> {
    let mut solver = Solver::new(model, record, Plan::OneTime, None, 1);
    while solver.advance(model, slice) == SearchState::Running {}
    solver
}

fn dropped<T: Real>(model: &Model<T>, record: &Record<T, 2, B>) -> [bool; 3] {
    [(1, Parameter::IA), (0, Parameter::OFF), (1, Parameter::OFF)]
        .map(|(joint, parameter)| record.selection.drops(model, joint, parameter))
}

#[test]
fn what_is_not_there_is_kept_as_seldom_as_three_standard_deviations_say() {
    let (model, nothing) = (model::<f64>(Choice::Auto, &[]), leg(0.0, [0.0; 2]));
    let kept = (1..=300).map(|seed| select(&model, record(&model, &nothing, seed)));
    let kept: usize = kept.map(|record| 3 - record.selection.dropped_count()).sum();
    // 0.27 % of 900 are 2.4; more than nine in one of 5,000 choices of seeds. A limit of two standard
    // deviations keeps 41.
    assert!(kept <= 9, "{kept} of 900 kept");
}

#[test]
fn what_is_there_is_kept_and_every_number_is_that_of_columns_that_are_on() {
    let truth = leg(0.3, [1.0, -0.5]);
    let (auto, on) = (model::<f32>(Choice::Auto, &[]), model::<f32>(Choice::On, &[]));
    for seed in 1..=20 {
        let chosen = solved(&auto, record(&auto, &truth, seed), 20);
        assert_eq!(
            dropped(&auto, chosen.record()),
            [false; 3],
            "seed {seed}: {:?}",
            chosen.record().selection
        );
        let plain = solved(&on, record(&on, &truth, seed), 20);
        assert_eq!(chosen.least_squares(), plain.least_squares());
        assert_eq!(chosen.parameters(), plain.parameters());
    }
}

#[test]
fn what_is_dropped_leaves_the_numbers_of_columns_that_are_off() {
    let off = [(1, Parameter::IA), (0, Parameter::OFF), (1, Parameter::OFF)];
    let truth = leg(0.0, [0.0; 2]);
    let (auto, without) = (model::<f64>(Choice::Auto, &[]), model::<f64>(Choice::On, &off));
    let on = model::<f64>(Choice::On, &[]);
    let chosen = solved(&auto, record(&auto, &truth, 1), 20);
    assert_eq!(dropped(&auto, chosen.record()), [true; 3]);
    let (plain, all) =
        (solved(&without, record(&without, &truth, 1), 20), solved(&on, record(&on, &truth, 1), 20));
    assert_eq!((chosen.least_squares().rank(), plain.least_squares().rank()), (10, 10));
    let mut narrower = 0;
    for base in 0..without.base.rank() {
        let same =
            (0..B).find(|&other| auto.base.independent(other) == without.base.independent(base)).unwrap();
        let (one, other) = (chosen.estimate(), plain.estimate());
        let (sigma, other_sigma) = (one.sigma(same).unwrap(), other.sigma(base).unwrap());
        // The noise is estimated with up to three columns fewer of 13 beside 400 rows: by half a per cent.
        assert!((sigma / other_sigma - 1.0).abs() < 0.01, "{base}: {sigma} {other_sigma}");
        // The swarm ends within 1e-3 chi-square units.
        assert!((one.values[same] - other.values[base]).abs() < 0.06 * sigma, "{base}");
        narrower += usize::from(sigma < 0.9 * all.estimate().sigma(same).unwrap());
    }
    assert!(narrower >= 2, "what resembled the dropped columns is known better: {narrower}");
    for (joint, parameter) in off {
        assert_eq!(chosen.parameters().unwrap()[joint][parameter.index()], 0.0);
        assert_eq!(plain.parameters().unwrap()[joint][parameter.index()], 0.0);
        let found = status(&auto, chosen.record(), &chosen.estimate(), joint, parameter);
        assert_eq!(found, Status::Prior);
    }
    let verdict = chosen.judge(
        &auto,
        &Thresholds::default(),
        core::iter::empty(),
        &[None; crate::ident::alignment::DIRECTIONS],
        &mut |_| {},
    );
    assert_eq!(verdict, Verdict::ACCEPTED, "a column that was dropped is not missing");
}

#[test]
fn slices_do_not_change_the_choice() {
    let model = model::<f32>(Choice::Auto, &[]);
    let of = |slice: u32| {
        let solver = solved(&model, record(&model, &leg(0.3, [0.0; 2]), 4), slice);
        assert_eq!(dropped(&model, solver.record()), [false, true, true]);
        (solver.search().evaluations(), solver.found().map(f32::to_bits), solver.parameters())
    };
    assert_eq!(of(1), of(7));
    assert_eq!(of(1), of(1000));
}

#[test]
fn a_rotor_inertia_that_is_negative_beyond_noise_is_kept_and_refused() {
    let model = model::<f64>(Choice::Auto, &[]);
    let solver = solved(&model, record(&model, &leg(-0.3, [0.0; 2]), 2), 20);
    assert_eq!(dropped(&model, solver.record()), [false, true, true]);
    let mut unheard = |_: &crate::ident::Evidence<f64>| {};
    let mut builder = crate::ident::VerdictBuilder::new(&mut unheard);
    Thresholds::default().judge_physics(&model, solver.record(), solver.least_squares(), &mut builder);
    assert!(builder.verdict().has(crate::ident::Reason::Unphysical));
}

#[test]
fn a_column_that_the_motion_does_not_tell_from_others_is_dropped() {
    // At two angles of the hip the moments' columns make up any constant.
    let (auto, on) = (model::<f64>(Choice::Auto, &[]), model::<f64>(Choice::On, &[]));
    let two = |model: &Model<f64>| {
        record_on(model, &leg(0.3, [1.0, -0.5]), 3, |angle| if angle > 0.0 { 0.4 } else { -0.3 })
    };
    assert!(Problem::new(&two(&on), &on).whole().columns().len() < B);
    let chosen = select(&auto, two(&auto));
    let stage = Problem::new(&chosen, &auto).whole();
    assert_eq!(
        (dropped(&auto, &chosen), stage.columns().len(), stage.asked()),
        ([false, true, false], 12, 12)
    );
}

#[test]
fn a_rotor_that_is_measured_in_a_sum_only_is_no_candidate() {
    let model = model::<f64>(Choice::Auto, &[]);
    let names: [_; 3] = {
        let mut all = candidates(&model).filter_map(|base| model.base.independent(base));
        core::array::from_fn(|_| all.next().unwrap())
    };
    assert_eq!(names, [(0, Parameter::OFF), (1, Parameter::OFF), (1, Parameter::IA)]);
    assert_eq!(candidates(&model).count(), 3);
}
