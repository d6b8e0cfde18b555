//! From base parameters back to all fourteen of every joint: measured, grouped, or from the prior only.
//!
//! ```text
//! minimise (p - p0)' W^-1 (p - p0)  subject to  K p = beta
//! p = p0 + W K' (K W K')^-1 (beta - K p0)
//! ```
//!
//! `K` holds the base parameters' terms, `p0` the prior and `W` its variances. The prior's standard deviation
//! is half of each parameter's size, at least a hundredth of the largest of its kind. Parameters without
//! effect on torque keep the prior's value. Grouped ones share the deviation of their group; only a prior can
//! separate them, and the status says so.

use super::estimate::Estimate;
use crate::ident::record::factor::Factor;
use crate::ident::record::motion_record::Record;
use crate::ident::record::row_model::RowModel;
use crate::listed::listed;
use crate::model::{LegParameters, PARAMETERS_PER_JOINT, Parameter, Standing};
use crate::real::{self, Real};

listed! {
    /// Where a reported parameter's value comes from.
    pub enum Status {
        /// All states, in the order of the enum.
        ALL,
        /// Word used in reports.
        name;
        /// Measured alone.
        Identified, "identified";
        /// Measured only in a sum with others; the split comes from the prior.
        Grouped, "grouped";
        /// Measured, but hard to separate from others.
        Weak, "weak";
        /// Without effect on torque, so the prior's value; or not estimated, then zero.
        Prior, "prior";
    }
}

/// Limit for a weak base parameter: share of a joint's torque that changes with an error of one standard
/// deviation, the others unchanged. Such an error stays hidden only because the others compensate it.
const WEAK_SHARE: f64 = 0.02;

/// True if the data hardly separate base parameter `base` from the others.
pub(crate) fn is_weak<T: Real, const N: usize, const B: usize>(
    record: &Record<T, N, B>,
    estimate: &Estimate<T, B>,
    base: usize,
) -> bool {
    let Some(sigma) = estimate.sigma(base) else { return true };
    record.factors.iter().zip(&record.torque).zip(&record.rows).any(|((factor, size), &rows)| {
        let rows = real::sqrt(T::from_double(f64::from(rows.max(1))));
        sigma * factor.column_length(base) / rows > T::from_double(WEAK_SHARE) * size.root_mean_square
    })
}

/// Status of one parameter.
pub fn status<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    record: &Record<T, N, B>,
    estimate: &Estimate<T, B>,
    joint: usize,
    parameter: Parameter,
) -> Status {
    match model.base.standing(joint, parameter) {
        Standing::Alone(base) if record.selection.dropped[base] => Status::Prior,
        Standing::Alone(base) if is_weak(record, estimate, base) => Status::Weak,
        Standing::Alone(_) => Status::Identified,
        Standing::Grouped(..) => Status::Grouped,
        Standing::Unseen | Standing::Off => Status::Prior,
    }
}

/// All parameters of all joints: the nearest to the prior with these base parameters.
///
/// `None` when the groups are degenerate beyond rounding.
pub(super) fn complete_within<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    base_values: &[T; B],
    prior: &LegParameters<T, N>,
    deviations: &LegParameters<T, N>,
) -> Option<LegParameters<T, N>> {
    let mut variances = *deviations;
    for variance in variances.as_flattened_mut() {
        *variance *= *variance;
    }
    let expected = model.base.project(prior);
    let rank = model.base.rank();
    // As many equations as multipliers: the factor solves them exactly.
    let mut equations = Factor::<T, B>::new();
    for row in 0..rank {
        let mut products = [T::zero(); B];
        for (column, product) in products.iter_mut().enumerate().take(rank) {
            *product = weighted_product(model.base.terms(row), model.base.terms(column), &variances);
        }
        equations.insert(&products, base_values[row] - expected[row]);
    }
    let multipliers = equations.solve(rank);
    if !multipliers.iter().all(|&multiplier| real::is_finite(multiplier)) {
        return None;
    }
    let mut parameters = *prior;
    for row in 0..rank {
        for joint in 0..N {
            for index in 0..PARAMETERS_PER_JOINT {
                parameters[joint][index] +=
                    variances[joint][index] * model.base.terms(row)[joint][index] * multipliers[row];
            }
        }
    }
    Some(parameters)
}

/// Standard deviations of a prior: half of each value, at least a hundredth of the largest of its kind.
pub(super) fn prior_deviations<T: Real, const N: usize>(prior: &LegParameters<T, N>) -> LegParameters<T, N> {
    let kind = |index: usize| match index {
        0..=5 | 10 => 0, // inertias, including the rotor's
        6..=8 => 1,
        9 => 2,
        _ => 3,
    };
    let mut largest = [T::from_double(1e-3); 4];
    for parameters in prior {
        for (index, &value) in parameters.iter().enumerate() {
            largest[kind(index)] = real::max(largest[kind(index)], real::abs(value));
        }
    }
    let mut deviations = *prior;
    for parameters in &mut deviations {
        for (index, value) in parameters.iter_mut().enumerate() {
            *value = real::max(
                T::from_double(0.5) * real::abs(*value),
                T::from_double(0.01) * largest[kind(index)],
            );
        }
    }
    deviations
}

fn weighted_product<T: Real, const N: usize>(
    one: &LegParameters<T, N>,
    other: &LegParameters<T, N>,
    weights: &LegParameters<T, N>,
) -> T {
    let terms = one.iter().flatten().zip(other.iter().flatten()).zip(weights.iter().flatten());
    terms.fold(T::zero(), |sum, ((&left, &right), &weight)| sum + left * right * weight)
}
