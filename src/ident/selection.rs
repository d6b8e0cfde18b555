//! Which of the columns that may be dropped are: backward elimination by what each explains.
//!
//! A column that the data do not tell from zero makes every other parameter that resembles it uncertain, and says
//! nothing itself. Where `auto` is asked for, the rotor's inertia and the constant torque of a joint are such columns.
//!
//! ```text
//! gain_c = J without c - J = beta_c^2 / Cov_cc                    chi-square of one degree of freedom if beta_c = 0   (C1)
//! until every candidate gains at least 9: the one that gains least is held at zero, the rest is solved again
//! ```
//!
//! (C1) is exact, since the cost is quadratic; a column without information gains nothing. Holding a column at zero takes
//! it out of the same factor: its entries are left out and the rows rotated to a triangle again
//! ([`super::factor::Factor::restricted`]), so that no row is needed twice.
//!
//! **The limit** is three standard deviations. A column that is zero is kept in 0.27 % of all cases; one that is not is
//! dropped in half of the cases where its value is three of its standard deviations, and hardly ever from six on. It is
//! the limit at which the verdict calls a rotor inertia negative, so that one that is negative beyond noise is kept and
//! refused, not dropped and forgotten.
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | J, beta, Cov | cost, least squares and its covariance over the columns still there | chi-square, SI |
//!
//! Source: backward elimination, Draper and Smith, Applied Regression Analysis, ch. 15.
//! Cost: one restricted factor and its inverse each step, about `2 B^3` multiplications; at most `2 N + 1` steps.
//! Limits: what is dropped counts as exactly zero afterwards. Of the others' sigma the part that resembled it is gone,
//! though up to three of its standard deviations may have been there: where the truth is neither zero nor clearly
//! seen, they are biased by that part and their sigma does not say so.

use super::choice::Choice;
use super::estimate::Problem;
use super::record::{Record, RowModel};
use crate::model::{Parameter, Standing};
use crate::real::Real;

/// Chi-square that a column must explain to be kept: three standard deviations.
pub const SMALLEST_GAIN: f64 = 9.0;

/// What was decided about the columns of one record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection<T, const N: usize, const B: usize> {
    /// Nothing more is to be decided.
    pub is_made: bool,
    /// Base parameters that are held at zero.
    pub dropped: [bool; B],
    /// (C1) of every candidate, of a dropped one when it was dropped; zero of what was no candidate.
    pub gain: [T; B],
    /// Gain and surplus (N m) of the best Stribeck curve of each joint that was looked for, taken or not.
    pub stribeck: [Option<(T, T)>; N],
}

impl<T: Real, const N: usize, const B: usize> Selection<T, N, B> {
    /// Every column is there; nothing was asked.
    #[must_use]
    pub fn all() -> Self {
        Self { is_made: false, dropped: [false; B], gain: [T::zero(); B], stribeck: [None; N] }
    }

    /// How many base parameters are held at zero.
    #[must_use]
    pub fn dropped_count(&self) -> usize {
        self.dropped.iter().filter(|dropped| **dropped).count()
    }

    /// Whether this parameter is one of them.
    #[must_use]
    pub fn drops(&self, model: &RowModel<T, N, B>, joint: usize, parameter: Parameter) -> bool {
        model.drive(joint, parameter).and_then(|base| self.dropped.get(base)).copied().unwrap_or(false)
    }

    /// The same in another precision.
    #[must_use]
    pub fn convert<U: Real>(&self) -> Selection<U, N, B> {
        let convert = |value: T| U::of(value.to_double());
        Selection {
            is_made: self.is_made,
            dropped: self.dropped,
            gain: self.gain.map(convert),
            stribeck: self
                .stribeck
                .map(|tried| tried.map(|(gain, surplus)| (convert(gain), convert(surplus)))),
        }
    }
}

/// The base parameters that may be dropped: those of one parameter alone. What is measured in a sum only (the first
/// joint's rotor, with its link's ZZ) has no column of its own, and its sum is needed all the same.
pub fn candidates<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
) -> impl Iterator<Item = usize> + '_ {
    (0..model.base.rank()).filter(|&base| {
        let Some((joint, parameter)) = model.base.independent(base) else { return false };
        let choice = model.drive_choice.get(joint).map(|choice| match parameter {
            Parameter::IA => choice.rotor,
            Parameter::OFF => choice.constant,
            _ => Choice::On,
        });
        choice == Some(Choice::Auto) && model.base.standing(joint, parameter) == Standing::Alone(base)
    })
}

/// One step of the elimination; true when there is nothing left to decide.
#[inline(never)]
pub fn step<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    record: &mut Record<T, N, B>,
) -> bool {
    if record.selection.is_made || candidates(model).next().is_none() {
        record.selection.is_made = true;
        return true;
    }
    let stage = Problem::new(record, model).whole();
    let count = stage.columns().len();
    let (values, inverse) = (stage.factor().solve(count), stage.factor().inverse(count));
    let gain = |base: usize| {
        let place = stage.columns().iter().position(|&column| column == base)?;
        let (&value, row) = (values.get(place)?, inverse.get(place)?);
        let variance = row.iter().fold(T::zero(), |sum, &element| sum + element * element);
        Some(value * value / variance)
    };
    let mut weakest: Option<(usize, T)> = None;
    for base in candidates(model) {
        if record.selection.dropped[base] {
            continue;
        }
        let gain = gain(base).unwrap_or(T::zero());
        record.selection.gain[base] = gain;
        if weakest.is_none_or(|(_, least)| gain < least) {
            weakest = Some((base, gain));
        }
    }
    match weakest {
        // A gain that is not a number is for the verdict to see.
        Some((base, gain)) if gain < T::of(SMALLEST_GAIN) => record.selection.dropped[base] = true,
        _ => record.selection.is_made = true,
    }
    record.selection.is_made
}

#[cfg(test)]
mod tests;
