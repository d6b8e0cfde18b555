//! Ranks, combinations and standings of chains whose base sets are known.

use super::*;
use crate::model::chain::DenavitHartenberg;
use crate::model::parameter::rounded;
use crate::model::testing::{TestRandom, down_along_x, paper_chain, planar_leg, rounded_state};
use Parameter::{FC, FV, HX, HY, HZ, IA, M, OFF, XX, XY, XZ, YY, YZ, ZZ};

/// Mask of all parameters but these.
fn all_but<const N: usize>(off: &[Parameter]) -> ColumnMask<N> {
    let mut mask = [[true; PARAMETERS_PER_JOINT]; N];
    for joint in &mut mask {
        for parameter in off {
            joint[parameter.index()] = false;
        }
    }
    mask
}

/// Gravity along -z of the base: the paper chain's first axis is parallel to it.
fn down_along_z<T: Real>() -> Vector3<T> {
    Vector3::new(T::zero(), T::zero(), T::from_double(-9.81))
}

fn rank<T: Real, const N: usize>(chain: &Chain<T, N>, gravity: Vector3<T>, off: &[Parameter]) -> usize {
    let base = BaseParameters::<T, N, 42>::analyse(chain, &gravity, &all_but(off)).unwrap();
    let separation = base.separation();
    // Measured on these legs: retained 0.43 of a column or more; dropped up to 4e-10 (f64) and 1e-5 (f32).
    // The tolerances are 1.5e-8 and 3.5e-4.
    let tolerance = sqrt(T::EPSILON);
    assert!(separation.smallest_retained > T::from_double(0.3), "{separation:?}");
    assert!(separation.largest_dropped < tolerance * T::from_double(0.05), "{separation:?}");
    base.rank()
}

fn known_ranks<T: Real>() {
    let x = down_along_x::<T>();
    let origin = DenavitHartenberg { alpha: T::zero(), a: T::zero(), d: T::zero() };
    let link = Chain::new(&[origin]).unwrap();
    assert_eq!(rank::<T, 1>(&link, x, &[OFF]), 5);
    assert_eq!(rank::<T, 1>(&link, x, &[]), 6);
    let leg = planar_leg::<T>(0.45);
    assert_eq!(rank(&leg, x, &[IA, FC, FV, OFF]), 6);
    assert_eq!(rank(&leg, x, &[IA, OFF]), 10);
    assert_eq!(rank(&leg, x, &[]), 13);
    let chain = paper_chain::<T>();
    assert_eq!(rank(&chain, down_along_z(), &[IA, FC, FV, OFF]), 15);
    assert_eq!(rank(&chain, down_along_z(), &[IA, OFF]), 21);
    assert_eq!(rank(&chain, down_along_z(), &[]), 25);
}

#[test]
fn ranks_of_known_chains_in_double_precision() {
    known_ranks::<f64>();
}

#[test]
fn ranks_of_known_chains_in_single_precision() {
    known_ranks::<f32>();
}

/// Compares the base set with the expected one: for each base parameter its terms,
/// the independent column first.
fn assert_terms<T: Real, const N: usize, const B: usize>(
    base: &BaseParameters<T, N, B>,
    expected: &[&[(usize, Parameter, f64)]],
) {
    assert_eq!(base.rank(), expected.len());
    for (b, terms) in expected.iter().enumerate() {
        assert_eq!(base.independent(b), Some((terms[0].0 - 1, terms[0].1)));
        let mut wanted = [[0.0; 14]; N];
        for (joint, parameter, factor) in *terms {
            wanted[joint - 1][parameter.index()] = *factor;
        }
        for (found, wanted) in base.terms(b).iter().flatten().zip(wanted.iter().flatten()) {
            // Rounding of a factor with a condition number of a few tens (measured 3e-7 in f32).
            let bound = T::EPSILON.to_double() * 20.0;
            assert!((found.to_double() - wanted).abs() < bound, "base {b}: {:?}", base.terms(b));
            assert_eq!(*found == T::zero(), *wanted == 0.0, "base {b}: {:?}", base.terms(b));
        }
    }
}

fn combinations_of_the_planar_leg<T: Real>() {
    const L: f64 = 0.45;
    let leg = planar_leg::<T>(L);
    let base = BaseParameters::<T, 2, 13>::analyse(&leg, &down_along_x(), &all_but(&[])).unwrap();
    assert_terms(
        &base,
        &[
            &[(1, ZZ, 1.0), (1, IA, 1.0), (2, M, L * L)],
            &[(1, HX, 1.0), (2, M, L)],
            &[(1, HY, 1.0)],
            &[(2, ZZ, 1.0)],
            &[(2, HX, 1.0)],
            &[(2, HY, 1.0)],
            &[(1, FC, 1.0)],
            &[(1, FV, 1.0)],
            &[(1, OFF, 1.0)],
            &[(2, FC, 1.0)],
            &[(2, FV, 1.0)],
            &[(2, OFF, 1.0)],
            &[(2, IA, 1.0)],
        ],
    );
    assert_eq!(base.standing(0, ZZ), Standing::Grouped(0));
    assert_eq!(base.standing(0, IA), Standing::Grouped(0));
    assert_eq!(base.standing(1, M), Standing::Grouped(0));
    assert!(base.carriers(1, M).eq([0, 1]));
    assert_eq!(base.standing(0, HY), Standing::Alone(2));
    assert_eq!(base.standing(1, IA), Standing::Alone(12));
    assert_eq!(base.standing(0, XX), Standing::Unseen);
    assert_eq!(base.standing(1, YY), Standing::Unseen);
    assert_eq!(base.standing(2, ZZ), Standing::Off);
}

#[test]
fn the_planar_leg_groups_what_the_literature_groups() {
    combinations_of_the_planar_leg::<f64>();
    combinations_of_the_planar_leg::<f32>();
}

#[test]
fn the_paper_chain_has_the_set_of_table_six_with_minus_yy_in_xx() {
    const L: f64 = 0.45;
    let mask = all_but(&[IA, FC, FV, OFF]);
    let base = BaseParameters::<f64, 3, 15>::analyse(&paper_chain(), &down_along_z(), &mask).unwrap();
    assert_terms(
        &base,
        &[
            &[(1, ZZ, 1.0), (2, YY, 1.0), (3, YY, 1.0), (3, M, L * L)],
            &[(2, XX, 1.0), (2, YY, -1.0), (3, M, -L * L)],
            &[(2, XY, 1.0)],
            &[(2, XZ, 1.0), (3, HZ, -L)],
            &[(2, YZ, 1.0)],
            &[(2, ZZ, 1.0), (3, M, L * L)],
            &[(2, HX, 1.0), (3, M, L)],
            &[(2, HY, 1.0)],
            &[(3, XX, 1.0), (3, YY, -1.0)],
            &[(3, XY, 1.0)],
            &[(3, XZ, 1.0)],
            &[(3, YZ, 1.0)],
            &[(3, ZZ, 1.0)],
            &[(3, HX, 1.0)],
            &[(3, HY, 1.0)],
        ],
    );
    let alone = [(1, XY), (1, YZ), (1, HY), (2, XY), (2, XZ), (2, YZ), (2, ZZ), (2, HX), (2, HY)];
    for joint in 0..3 {
        for parameter in Parameter::ALL {
            let is_alone = matches!(base.standing(joint, parameter), Standing::Alone(_));
            assert_eq!(is_alone, alone.contains(&(joint, parameter)), "{parameter:?} of joint {joint}");
        }
    }
    assert_eq!(base.standing(0, IA), Standing::Off);
}

/// Ranks of random chains; dropped columns must be far below the tolerance.
fn ranks_without_special_angles<T: Real, const N: usize>() {
    let mut random = TestRandom::new(21);
    for _ in 0..100 {
        let (chain, gravity) = (random.chain::<N>().convert::<T>(), random.gravity().map(T::from_double));
        let base = BaseParameters::<T, N, 42>::analyse(&chain, &gravity, &all_but(&[FC, FV, OFF])).unwrap();
        let separation = base.separation();
        // Three parameters of the first link, seven of every other, rotors of all but the first.
        assert_eq!(base.rank(), 3 + 8 * (N - 1), "{separation:?}");
        // Measured over 600 chains in f32: retained 6e-4 or more, on a nearly special chain; dropped 5e-7 or
        // less. The tolerance is 3.5e-4.
        let tolerance = sqrt(T::EPSILON);
        assert!(separation.largest_dropped < tolerance * T::from_double(0.05), "{separation:?}");
    }
}

#[test]
fn chains_without_special_angles_have_the_rank_of_the_closed_form() {
    ranks_without_special_angles::<f64, 2>();
    ranks_without_special_angles::<f64, 3>();
    ranks_without_special_angles::<f32, 2>();
    ranks_without_special_angles::<f32, 3>();
}

#[test]
fn gravity_off_the_first_axis_by_a_thousandth_shows_the_first_centre_of_mass() {
    let tilted = Vector3::new(0.009_81_f32, 0.0, -9.81);
    let base = BaseParameters::<f32, 3, 27>::analyse(&paper_chain(), &tilted, &all_but(&[])).unwrap();
    assert_eq!(base.rank(), 27);
    assert!(matches!(base.standing(0, HY), Standing::Alone(_) | Standing::Grouped(_)));
    let upright =
        BaseParameters::<f32, 3, 27>::analyse(&paper_chain(), &down_along_z(), &all_but(&[])).unwrap();
    assert_eq!(upright.standing(0, HY), Standing::Unseen);
}

fn torque_from_base_values<T: Real>(bound: f64) {
    let mut random = TestRandom::new(22);
    let (chain, gravity) = (random.chain::<3>().convert::<T>(), random.gravity().map(T::from_double));
    let base = BaseParameters::<T, 3, 32>::analyse(&chain, &gravity, &all_but(&[])).unwrap();
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for _ in 0..50 {
        let leg = rounded(&random.leg());
        let values = base.project(&leg);
        let bare = base.complete(&values, &[[T::zero(); 14]; 3]);
        for row in regressor(&chain, &rounded_state(&random.state()), &gravity) {
            let mut columns = [T::zero(); 32];
            base.select(&row, &mut columns);
            let sum =
                columns.iter().zip(&values).fold(T::zero(), |sum, (column, value)| sum + *column * *value);
            let torque = row_torque(&row, &leg);
            worst = worst
                .max((sum - torque).to_double().abs())
                .max((row_torque(&row, &bare) - torque).to_double().abs());
            largest = largest.max(torque.to_double().abs());
        }
    }
    assert!(worst < bound * largest, "{:e}", worst / largest);
}

#[test]
fn base_values_times_independent_columns_give_the_torque() {
    // About twenty products of factors known to about ten roundings.
    torque_from_base_values::<f64>(1e-13);
    torque_from_base_values::<f32>(1e-4);
}

#[test]
fn completion_keeps_the_base_values_and_whatever_is_not_independent() {
    let mut random = TestRandom::new(23);
    let leg = planar_leg::<f64>(0.39);
    let base = BaseParameters::<f64, 2, 13>::analyse(&leg, &down_along_x(), &all_but(&[])).unwrap();
    let (truth, prior) = (random.leg::<2>(), random.leg::<2>());
    let completed = base.complete(&base.project(&truth), &prior);
    for (one, other) in base.project(&completed).iter().zip(&base.project(&truth)) {
        // Three roundings of numbers up to ten.
        assert!((one - other).abs() < 1e-14);
    }
    assert_eq!(completed[1][M.index()], prior[1][M.index()]);
    assert_eq!(completed[0][HZ.index()], prior[0][HZ.index()]);
    assert_eq!(completed[1][XZ.index()], prior[1][XZ.index()]);
    assert_eq!(completed[1][YZ.index()], prior[1][YZ.index()]);
    assert_eq!(completed[0][XY.index()], prior[0][XY.index()]);
}

#[test]
fn what_cannot_be_analysed_is_refused_with_the_reason() {
    let leg = planar_leg::<f32>(0.39);
    let down = down_along_x::<f32>();
    let too_small = BaseParameters::<f32, 2, 12>::analyse(&leg, &down, &all_but(&[]));
    assert_eq!(too_small, Err(BaseError::TooMany { rank: 13 }));
    let nothing = BaseParameters::<f32, 2, 12>::analyse(&leg, &down, &[[false; 14]; 2]);
    assert_eq!(nothing, Err(BaseError::NothingSeen));
    let nowhere = Vector3::new(f32::NAN, 0.0, 0.0);
    let lost = BaseParameters::<f32, 2, 13>::analyse(&leg, &nowhere, &all_but(&[]));
    assert_eq!(lost, Err(BaseError::NotFinite));
}
