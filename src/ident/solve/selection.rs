//! Selection of columns to drop: backward elimination by the chi-square that each explains.
//!
//! A column that the data cannot distinguish from zero carries no information, and makes every similar
//! parameter uncertain. With the choice `auto` the rotor's inertia and the constant torque of a joint are
//! such candidates.
//!
//! ```text
//! gain_c = J without c - J = beta_c^2 / Cov_cc       chi-square of one degree of freedom if beta_c = 0  (C1)
//! repeat until every candidate gains at least 9: hold the one that gains least at zero, solve the rest again
//! ```
//!
//! (C1) is exact, since the cost is quadratic; a column without information gains nothing. A column at zero
//! leaves the factor: its entries are removed and the rows rotated to a triangle again
//! (`Factor::restricted`), so no row is needed twice.
//!
//! **The limit** is three standard deviations. A zero column is retained in 0.27 % of all cases. A nonzero
//! one is dropped in half of the cases where its value is three of its standard deviations, and hardly ever
//! from six on. The verdict uses the same limit for a negative rotor inertia: one that is negative beyond
//! noise is retained and refused, not silently dropped.
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | J, beta, Cov | cost, least squares and its covariance over the remaining columns | chi-square, SI |
//!
//! Source: backward elimination, Draper and Smith, Applied Regression Analysis, ch. 15.
//! Cost: one restricted factor and its inverse each step, about `2 B^3`
//! multiplications; at most `2 N + 1` steps.
//! Limits: a dropped value counts as exactly zero afterwards. The other parameters' sigma lose the part that
//! resembled it, although up to three of its standard deviations may be real. Where the truth is neither zero
//! nor clearly visible, the others are biased by that part, and their sigma does not show it (a replay on the
//! host adds the shift).

use super::estimate::Problem;
use crate::ident::record::choice::Choice;
use crate::ident::record::motion_record::Record;
use crate::ident::record::row_model::RowModel;
use crate::model::{Parameter, Standing};
use crate::real::Real;

/// Least chi-square that a retained column must explain: three standard deviations.
pub const SMALLEST_GAIN: f64 = 9.0;

/// Base parameters that may be dropped: those of one parameter alone. A parameter measured only in a sum has
/// no column of its own, for example the first joint's rotor with its link's ZZ. The sum is needed anyway.
pub(crate) fn candidates<T: Real, const N: usize, const B: usize>(
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

/// Takes one step of the elimination; true when finished.
#[inline(never)]
pub(crate) fn step<T: Real, const N: usize, const B: usize>(
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
        let index = stage.columns().iter().position(|&column| column == base)?;
        let (&value, row) = (values.get(index)?, inverse.get(index)?);
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
        // A gain of NaN is left for the verdict.
        Some((base, gain)) if gain < T::from_double(SMALLEST_GAIN) => record.selection.dropped[base] = true,
        _ => record.selection.is_made = true,
    }
    record.selection.is_made
}

#[cfg(test)]
mod tests;
