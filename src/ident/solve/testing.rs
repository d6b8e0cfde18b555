//! Records of random states for tests: a leg with or without the parameters that may be dropped.

use super::estimate::Plan;
use super::search::SearchState;
use super::solver::Solver;
use crate::ident::record::choice::{Choice, DriveChoice};
use crate::ident::record::motion_record::Record;
use crate::ident::record::recorder::Recorder;
use crate::ident::record::row_model::RowModel;
use crate::model::testing::down_along_x;
use crate::model::{
    BaseParameters, Chain, ColumnMask, DenavitHartenberg, JointState, LegParameters, Parameter, regressor,
};
use crate::real::Real;
use crate::testing::TestRandom;

pub(crate) use crate::model::planar::BASE as B;

const SIGMA: f64 = 0.3;
const STATES: u32 = 400;

pub(crate) type Model<T> = RowModel<T, 2, B>;

/// Mask of all columns.
pub(crate) const ALL: ColumnMask<2> = [[true; 14]; 2];

/// Rows of one or two parallel axes a thigh of `length` metres apart, with the columns of `mask`.
pub(crate) fn planar<T: Real, const N: usize>(length: f64, mask: &ColumnMask<N>) -> RowModel<T, N, B> {
    let length = |joint: usize| if joint == 0 { 0.0 } else { length };
    let geometry = core::array::from_fn(|joint| DenavitHartenberg { alpha: 0.0, a: length(joint), d: 0.0 });
    let chain = Chain::<f64, N>::new(&geometry).unwrap().convert();
    let gravity = down_along_x();
    RowModel::new(chain, gravity, BaseParameters::analyse(&chain, &gravity, mask).unwrap())
}

/// Model without the columns of `off`, with those of `choice` to be decided.
pub fn model<T: Real>(choice: Choice, off: &[(usize, Parameter)]) -> Model<T> {
    let mut mask = ALL;
    off.iter().for_each(|(joint, parameter)| mask[*joint][parameter.index()] = false);
    let mut model = planar(0.45, &mask);
    model.drive_choice = [DriveChoice { rotor: choice, constant: choice, ..DriveChoice::ALL }; 2];
    model
}

/// Leg with the knee's rotor inertia and both offsets, the candidates for dropping.
pub(crate) fn leg(rotor: f64, offsets: [f64; 2]) -> LegParameters<f64, 2> {
    [
        [0.03, 0.0, 0.0, 0.5, 0.0, 0.51, 1.7, 0.1, 0.0, 8.5, 0.12, 3.0, 1.2, offsets[0]],
        [0.01, 0.0, 0.0, 0.25, 0.0, 0.26, 0.86, -0.07, 0.0, 4.8, rotor, 2.0, 0.8, offsets[1]],
    ]
}

/// Noisy torque of a leg on random states; `angle` maps a random number in -1..1 to the hip's angle.
pub(crate) fn record_on<T: Real>(
    model: &Model<T>,
    leg: &LegParameters<f64, 2>,
    seed: u64,
    angle: fn(f64) -> f64,
) -> Record<T, 2, B> {
    let mut random = TestRandom::new(seed);
    let exact = self::model::<f64>(Choice::On, &[]);
    let mut record = Recorder::<T, 2, B, 256, 26>::new(T::from_double(8.0)).unwrap().finish();
    let mut squares = [0.0; 2];
    for _ in 0..STATES {
        let mut many = |bound: f64| core::array::from_fn(|_| random.within(bound));
        let mut state = JointState { q: many(1.0), qd: many(2.0), qdd: many(6.0) };
        state.q[0] = angle(state.q[0]);
        let rows = regressor(&exact.chain, &state, &exact.gravity);
        for (joint, full) in rows.iter().enumerate() {
            let mut row = [T::zero(); B];
            model.base.select(&full.map(|block| block.map(T::from_double)), &mut row);
            // Twelve uniform numbers: variance 12 a^2 / 3.
            let noise: f64 = (0..12).map(|_| random.within(SIGMA / 2.0)).sum();
            let torque = crate::model::row_torque(full, leg) + noise;
            record.factors[joint].insert(&row, T::from_double(torque));
            squares[joint] += torque * torque;
        }
    }
    for (joint, size) in record.torque.iter_mut().enumerate() {
        let mean = squares[joint] / f64::from(STATES);
        (size.root_mean_square, size.speed) = (T::from_double(crate::real::sqrt(mean)), T::from_double(1.2));
    }
    (record.rows, record.row_information) = ([STATES; 2], T::one());
    record
}

/// Noisy torque of a leg on random states of all angles.
pub(crate) fn record<T: Real>(model: &Model<T>, leg: &LegParameters<f64, 2>, seed: u64) -> Record<T, 2, B> {
    record_on(model, leg, seed, |angle| angle)
}

/// Solver of a record at its end, advanced in slices.
pub(crate) fn solved<T: Real>(model: &Model<T>, record: Record<T, 2, B>, slice: u32) -> Solver<T, 2, B> {
    let mut solver = Solver::new(model, record, Plan::OneTime, None, 1);
    while solver.advance(model, slice) == SearchState::Running {}
    solver
}

/// Whether the candidates of [`leg`] are dropped.
pub(crate) fn dropped<T: Real>(model: &Model<T>, record: &Record<T, 2, B>) -> [bool; 3] {
    [(1, Parameter::IA), (0, Parameter::OFF), (1, Parameter::OFF)]
        .map(|(joint, parameter)| record.selection.drops(model, joint, parameter))
}
