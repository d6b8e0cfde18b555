//! Cost of full parameters as one triangular factor: the data, and a weak prior in directions without data.
//!
//! ```text
//! y = (p - p0) / w                                  each parameter in the prior's standard deviations
//! F(y) = |R K W^1/2 y - R (beta - K p0)|^2 + pull |N y|^2 = |A y - b|^2 + const
//! N = E - Q Q'                                      Q: orthonormal rows of K W^1/2 (determined ones)
//! ```
//!
//! With the projector `N` instead of the identity the prior has no influence on what is measured.
//! The minimum of `F` is `p0 + W K' (K W K')^-1 (beta - K p0)` for any `pull`. Columns not estimated
//! are held at `p0`, which is 0.
//!
//! Cost: `28 + rank` rows into a factor of 28 columns (two joints), about 70,000 multiplications once; an
//! evaluation 400. Memory: `14 N (14 N + 3)` scalars.

use super::limits::Limits;
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::estimate::Stage;
use crate::model::{INERTIAL_PARAMETERS, LegParameters, PARAMETERS_PER_JOINT, Parameter, row_torque};
use crate::real::{self, Real};

/// Parameters of a leg, all zero.
pub(super) const fn zeros<T: Real, const N: usize>(zero: T) -> LegParameters<T, N> {
    [[zero; PARAMETERS_PER_JOINT]; N]
}

/// Quadratic cost over scaled full parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct LegCost<T: Real, const N: usize> {
    origin: LegParameters<T, N>,
    scale: LegParameters<T, N>,
    /// Upper triangular, rows in the order of the parameters.
    triangle: [[LegParameters<T, N>; PARAMETERS_PER_JOINT]; N],
    right: LegParameters<T, N>,
    /// Drive parameters that are estimated.
    estimated: [[bool; 4]; N],
}

impl<T: Real, const N: usize> LegCost<T, N> {
    /// Cost without rows; prior and standard deviations come from `limits`.
    pub fn new(limits: &Limits<T, N>) -> Self {
        let zero = zeros(T::zero());
        Self {
            origin: *limits.origin(),
            scale: *limits.deviations(),
            triangle: [[zero; PARAMETERS_PER_JOINT]; N],
            right: zero,
            estimated: limits.links.map(|link| link.estimated),
        }
    }

    /// Takes the data's rows (`stage`, about the base values `centre`) and the
    /// prior's rows with weight `pull`.
    #[inline(never)]
    pub fn fill<const B: usize>(
        &mut self,
        model: &RowModel<T, N, B>,
        stage: &Stage<T, B>,
        centre: &[T; B],
        pull: T,
    ) {
        let zero = zeros(T::zero());
        self.triangle = [[zero; PARAMETERS_PER_JOINT]; N];
        self.right = zero;
        let expected = model.base.project(&self.origin);
        for row in stage.factor().triangle().iter().take(stage.columns().len()) {
            let (mut full, mut right) = (zero, T::zero());
            for (&element, &base) in row.iter().zip(stage.columns()) {
                add_scaled(&mut full, model.base.terms(base), element);
                if let (Some(&value), Some(&prior)) = (centre.get(base), expected.get(base)) {
                    right += element * (value - prior);
                }
            }
            multiply(&mut full, &self.scale);
            self.insert(&mut full, right);
        }
        self.insert_prior(model, stage.columns(), real::sqrt(pull));
    }

    #[inline(never)]
    fn insert_prior<const B: usize>(&mut self, model: &RowModel<T, N, B>, columns: &[usize], weight: T) {
        let mut seen = [zeros::<T, N>(T::zero()); B];
        for (index, &base) in columns.iter().enumerate().take(B) {
            let mut row = *model.base.terms(base);
            multiply(&mut row, &self.scale);
            // Two passes of Gram-Schmidt are enough (Kahan): the rows are far from parallel.
            for _ in 0..2 {
                for other in seen.iter().take(index) {
                    let share = row_torque(&row, other);
                    add_scaled(&mut row, other, -share);
                }
            }
            let length = real::sqrt(row_torque(&row, &row));
            if length > T::zero()
                && let Some(slot) = seen.get_mut(index)
            {
                add_scaled(slot, &row, T::one() / length);
            }
        }
        for joint in 0..N {
            for parameter in Parameter::ALL {
                let mut row = zeros(T::zero());
                let entry = (joint, parameter.index());
                let drive = parameter.index().checked_sub(INERTIAL_PARAMETERS);
                if drive.is_some_and(|drive| !self.estimated[joint][drive]) {
                    row[entry.0][entry.1] = T::one();
                } else {
                    row[entry.0][entry.1] = weight;
                    for other in &seen {
                        add_scaled(&mut row, other, -weight * other[entry.0][entry.1]);
                    }
                }
                self.insert(&mut row, T::zero());
            }
        }
    }

    /// Rotates one row in (Golub and Van Loan 5.1.8). Overwrites `row`.
    #[inline(never)]
    pub(super) fn insert(&mut self, row: &mut LegParameters<T, N>, mut right: T) {
        let row = row.as_flattened_mut();
        let stored_rows = self.triangle.as_flattened_mut().iter_mut().zip(self.right.as_flattened_mut());
        for (column, (stored, stored_right)) in stored_rows.enumerate() {
            let stored = stored.as_flattened_mut();
            let (Some(&entering), Some(&diagonal)) = (row.get(column), stored.get(column)) else { break };
            if entering == T::zero() {
                continue;
            }
            let length = real::sqrt(diagonal * diagonal + entering * entering);
            if !(length > T::zero()) {
                continue; // squares that underflow carry no information
            }
            let (cosine, sine) = (diagonal / length, entering / length);
            for (old, new) in stored.iter_mut().zip(row.iter_mut()).skip(column) {
                (*old, *new) = (cosine * *old + sine * *new, cosine * *new - sine * *old);
            }
            (*stored_right, right) =
                (cosine * *stored_right + sine * right, cosine * right - sine * *stored_right);
        }
    }

    /// Shifts the origin to `point`: the unknown becomes the step from there.
    pub(super) fn shift(&mut self, point: &LegParameters<T, N>) {
        let point = point.as_flattened();
        let rows = self.triangle.as_flattened().iter().zip(self.right.as_flattened_mut());
        for (index, (row, right)) in rows.enumerate() {
            for (&element, &value) in row.as_flattened().iter().zip(point).skip(index) {
                *right -= element * value;
            }
        }
    }

    /// Back substitution; a column without information gives zero.
    #[inline(never)]
    pub(super) fn solve(&self) -> LegParameters<T, N> {
        let mut solution = zeros(T::zero());
        let rows = self.triangle.as_flattened().iter().zip(self.right.as_flattened());
        for (index, (row, &right)) in rows.enumerate().rev() {
            let row = row.as_flattened();
            let known = row.iter().zip(solution.as_flattened()).skip(index + 1);
            let rest = known.fold(right, |rest, (&element, &value)| rest - element * value);
            if let (Some(&diagonal), Some(slot)) =
                (row.get(index), solution.as_flattened_mut().get_mut(index))
                && diagonal != T::zero()
            {
                *slot = rest / diagonal;
            }
        }
        solution
    }

    /// `|b|^2` of the rotated problem: the decrease in cost of a full step.
    pub(super) fn right_squared(&self) -> T {
        row_torque(&self.right, &self.right)
    }

    /// `F` above its unconstrained minimum.
    pub(crate) fn excess(&self, point: &LegParameters<T, N>) -> T {
        let point = point.as_flattened();
        let rows = self.triangle.as_flattened().iter().zip(self.right.as_flattened());
        rows.enumerate().fold(T::zero(), |total, (index, (row, &right))| {
            let known = row.as_flattened().iter().zip(point).skip(index);
            let error = known.fold(-right, |error, (&element, &value)| error + element * value);
            total + error * error
        })
    }

    /// Converts scaled coordinates to parameters.
    pub fn parameters(&self, point: &LegParameters<T, N>) -> LegParameters<T, N> {
        let mut parameters = *point;
        multiply(&mut parameters, &self.scale);
        add_scaled(&mut parameters, &self.origin, T::one());
        parameters
    }

    /// Converts parameters to scaled coordinates.
    pub(crate) fn scaled_point(&self, parameters: &LegParameters<T, N>) -> LegParameters<T, N> {
        let mut point = *parameters;
        add_scaled(&mut point, &self.origin, -T::one());
        for (value, &scale) in point.as_flattened_mut().iter_mut().zip(self.scale.as_flattened()) {
            *value /= scale;
        }
        point
    }

    /// Standard deviations that scale the parameters.
    pub(super) fn scale(&self) -> &LegParameters<T, N> {
        &self.scale
    }

    /// Parameters of the prior.
    pub(super) fn origin(&self) -> &LegParameters<T, N> {
        &self.origin
    }
}

/// `sum += factor * row`.
pub(super) fn add_scaled<T: Real, const N: usize>(
    sum: &mut LegParameters<T, N>,
    row: &LegParameters<T, N>,
    factor: T,
) {
    for (slot, &element) in sum.as_flattened_mut().iter_mut().zip(row.as_flattened()) {
        *slot += factor * element;
    }
}

fn multiply<T: Real, const N: usize>(row: &mut LegParameters<T, N>, factors: &LegParameters<T, N>) {
    for (slot, &factor) in row.as_flattened_mut().iter_mut().zip(factors.as_flattened()) {
        *slot *= factor;
    }
}
