//! Curves of friction that falls with speed, as combinations of the fixed ones in the rows: (S1) and (S2).

use super::{BANK, SLOWEST_RAD_S};
use crate::ident::record::factor::Factor;
use crate::real::{self, Real};

/// Upper end of the fit between curves, rad/s.
const FASTEST_RAD_S: f64 = 1.5;

/// The bank's columns at a speed, rad/s.
pub(crate) fn bank_columns<T: Real>(speed: T) -> [T; BANK] {
    let ratio = speed / T::from_double(4.0 * SLOWEST_RAD_S);
    let fastest = real::exp(-(ratio * ratio));
    let fourth = |value: T| (value * value) * (value * value);
    let middle = fourth(fastest);
    let sign = real::sign(speed);
    [sign * fourth(middle), sign * middle, sign * fastest]
}

/// (S2): a curve as a combination of the bank with the columns of Coulomb and viscous friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Combination<T> {
    /// Weights of the bank's columns.
    pub bank: [T; BANK],
    /// Weights of the columns of Coulomb and viscous friction.
    pub friction: [T; 2],
}

impl<T: Real> Combination<T> {
    pub(super) fn scaled(&self, factor: T) -> Self {
        Self {
            bank: self.bank.map(|weight| weight * factor),
            friction: self.friction.map(|weight| weight * factor),
        }
    }
}

/// (S2): weights that give the column of `speed` (rad/s).
pub fn combination<T: Real>(speed: T) -> Combination<T> {
    const COLUMNS: usize = BANK + 2;
    let half_root_pi = T::from_double(0.886_226_925_452_758);
    let bank: [T; BANK] = core::array::from_fn(|index| {
        T::from_double(SLOWEST_RAD_S) * T::from_double(f64::from(1_u32 << index))
    });
    let product = |one: T, other: T| half_root_pi * one * other / real::sqrt(one * one + other * other);
    // Inner products of a curve of the family with the bank, a constant and a line.
    let row = |speed: T| {
        let [one, two, three] = bank.map(|other| product(speed, other));
        [one, two, three, half_root_pi * speed, T::from_double(0.5) * speed * speed]
    };
    let end = T::from_double(FASTEST_RAD_S);
    let mut equations = Factor::<T, COLUMNS>::new();
    let right = row(speed);
    for (index, curve) in bank.iter().enumerate() {
        equations.insert(&row(*curve), right[index]);
    }
    let [constant, line] = [BANK, BANK + 1].map(|column| bank.map(|curve| row(curve)[column]));
    let (square, cube) = (T::from_double(0.5) * end * end, end * end * end / T::from_double(3.0));
    equations.insert(&[constant[0], constant[1], constant[2], end, square], right[BANK]);
    equations.insert(&[line[0], line[1], line[2], square, cube], right[BANK + 1]);
    let [one, two, three, coulomb, viscous] = equations.solve(COLUMNS);
    Combination { bank: [one, two, three], friction: [coulomb, viscous] }
}

/// Derivative of [`combination`] with respect to ln speed.
pub(super) fn slope<T: Real>(speed: T) -> Combination<T> {
    let step = T::from_double(0.02);
    let (up, down) = (combination(speed * real::exp(step)), combination(speed * real::exp(-step)));
    let difference = |up: T, down: T| (up - down) / (step + step);
    Combination {
        bank: core::array::from_fn(|index| difference(up.bank[index], down.bank[index])),
        friction: core::array::from_fn(|index| difference(up.friction[index], down.friction[index])),
    }
}
