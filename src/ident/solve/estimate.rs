//! From records to parameters: noise weights, stages, least squares and its covariance.
//!
//! ```text
//! s_i^2 = residual variance of joint i / (m sum h^2)            variance of one independent row
//! J(p)  = sum_i |R_i p - z_i|^2 / s_i^2 + const                 chi-square units
//! Cov   = (sum_i R_i' R_i / s_i^2)^-1
//! ```
//!
//! A constant torque that is known to be zero within w ([`RowModel::known_to_be_zero`]) adds (p / w)^2 to J.
//! The sequential plan does not use it.
//!
//! Filtered rows overlap, so the naive standard deviation is too small. With a flat passband each row carries
//! the information of `m sum h^2` independent ones (m the decimation; exact while that is at most one). The
//! residual variance is unbiased with the same count: `n` rows lose `k / (m sum h^2)` to `k` parameters.
//!
//! Two plans (paper, 3.2 and 4.2):
//!
//! - **one-time**: all rows of all joints, weighted by each joint's noise, at once;
//! - **sequential**: from the distal joint to the proximal one. Each joint's own rows give the parameters
//!   that are still open; earlier results are substituted and their errors propagated.
//!
//! In both plans all joints move. A joint at rest sticks, which leaves its friction torque undetermined. A
//! distal joint that moves alone cannot separate its rotor's inertia from its link's.

use crate::ident::record::factor::Factor;
use crate::ident::record::motion_record::Record;
use crate::ident::record::row_model::RowModel;
use crate::real::{self, Real, dot};

/// Order in which the joints' rows give the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Plan {
    /// All joints at once, weighted by their noise.
    #[default]
    OneTime,
    /// Distal joint first, then substitution.
    Sequential,
}

/// Smallest independent share of a column that the data determine: the part that no earlier column explains.
/// Single precision leaves noise of 1e-6 there.
const DETERMINED_SHARE: f64 = 1e-4;
/// Smallest standard deviation of a row in units of the torque's root mean square. Below, single precision
/// decides, not the data (noise-free simulations).
const SMALLEST_NOISE_SHARE: f64 = 1e-5;

/// Standard deviation of one independent row of each joint, N m.
pub fn noise<T: Real, const N: usize, const B: usize>(record: &Record<T, N, B>) -> [T; N] {
    core::array::from_fn(|joint| {
        let factor = &record.factors[joint];
        let fitted = (0..B).filter(|&column| factor.triangle()[column][column] != T::zero()).count();
        let information = real::max(record.row_information, T::from_double(1e-3));
        let free =
            T::from_double(f64::from(record.rows[joint])) - T::from_double(fitted as f64) / information;
        let variance = factor.residual() / real::max(free, T::one()) / information;
        let floor = T::from_double(SMALLEST_NOISE_SHARE) * record.torque[joint].root_mean_square;
        real::max(real::sqrt(variance), real::max(floor, T::from_double(1e-9)))
    })
}

/// A quadratic cost in chi-square units over some of the base parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage<T, const B: usize> {
    columns: [usize; B],
    count: usize,
    requested: usize,
    factor: Factor<T, B>,
}

impl<T: Real, const B: usize> Stage<T, B> {
    fn new(source: &Factor<T, B>, weight: T, open: &[bool; B], held: &[T; B]) -> Self {
        let mut columns = [0; B];
        let mut count = 0;
        for (column, _) in open.iter().enumerate().filter(|(_, open)| **open) {
            columns[count] = column;
            count += 1;
        }
        let all = source.restricted(columns.get(..count).unwrap_or(&[]), held, weight);
        let mut free = 0;
        for index in 0..count {
            let share = T::from_double(DETERMINED_SHARE) * all.column_length(index);
            if real::abs(all.triangle()[index][index]) > share {
                columns[free] = columns[index];
                free += 1;
            }
        }
        let factor = if free == count {
            all
        } else {
            source.restricted(columns.get(..free).unwrap_or(&[]), held, weight)
        };
        Self { columns, count: free, requested: count, factor }
    }

    /// Base parameters that this stage determines.
    pub fn columns(&self) -> &[usize] {
        self.columns.get(..self.count).unwrap_or(&[])
    }

    /// Number of base parameters that were open in this stage.
    pub(crate) fn requested(&self) -> usize {
        self.requested
    }

    /// Cost in chi-square units, column `i` being base parameter `columns()[i]`.
    pub fn factor(&self) -> &Factor<T, B> {
        &self.factor
    }

    /// Condition number of the stage: largest over smallest singular value, columns scaled to unit length.
    /// `None` without columns.
    ///
    /// Power iteration on `S'S` and on its inverse, forty rounds each: a lower bound, within a few percent.
    pub fn condition(&self) -> Option<T> {
        if self.count == 0 {
            return None;
        }
        // S = R / lengths and S^-1 = lengths * R^-1.
        let mut inverse = self.factor.inverse(self.count);
        let mut scaled = *self.factor.triangle();
        for column in 0..B {
            let length = self.factor.column_length(column);
            for element in &mut inverse[column] {
                *element *= length;
            }
            for row in &mut scaled {
                row[column] = if column < self.count { row[column] / length } else { T::zero() };
            }
        }
        Some(spectral_norm(&scaled) * spectral_norm(&inverse))
    }
}

const POWER_ITERATIONS: usize = 40;

/// Largest singular value.
fn spectral_norm<T: Real, const B: usize>(matrix: &[[T; B]; B]) -> T {
    let mut vector = [T::one(); B];
    for (index, element) in vector.iter_mut().enumerate() {
        *element += T::from_double(0.1) * T::from_double(index as f64);
    }
    let mut norm = T::zero();
    for _ in 0..POWER_ITERATIONS {
        let mut back = [T::zero(); B];
        for row in matrix {
            let image = dot(row, &vector);
            for (sum, &element) in back.iter_mut().zip(row) {
                *sum += element * image;
            }
        }
        let length = real::sqrt(dot(&back, &back));
        if !(length > T::zero()) {
            return T::zero();
        }
        norm = real::sqrt(length);
        for (element, &image) in vector.iter_mut().zip(&back) {
            *element = image / length;
        }
    }
    norm
}

/// Variance of a weighted sum of values with this covariance.
pub(in crate::ident) fn variance<T: Real, const B: usize>(covariance: &[[T; B]; B], weights: &[T; B]) -> T {
    let mut variance = T::zero();
    for (row, &left) in covariance.iter().zip(weights) {
        for (&element, &right) in row.iter().zip(weights) {
            variance += left * element * right;
        }
    }
    real::max(variance, T::zero())
}

/// Base parameters with their covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate<T, const B: usize> {
    /// Value of each base parameter; zero where not determined.
    pub values: [T; B],
    /// Covariance, `[row][column]`; rows of parameters that are not determined are zero.
    pub covariance: [[T; B]; B],
    /// Base parameters that the data determine.
    pub determined: [bool; B],
}

impl<T: Real, const B: usize> Estimate<T, B> {
    /// Estimate without any determined parameter.
    pub fn nothing() -> Self {
        Self { values: [T::zero(); B], covariance: [[T::zero(); B]; B], determined: [false; B] }
    }

    /// Standard deviation of one base parameter; `None` where not determined.
    pub fn sigma(&self, index: usize) -> Option<T> {
        let determined = self.determined.get(index).copied().unwrap_or(false);
        let variance = self.covariance.get(index)?.get(index)?;
        determined.then(|| real::sqrt(*variance))
    }

    /// Standard deviation of the weighted sum of base parameters.
    pub fn sigma_of(&self, weights: &[T; B]) -> T {
        real::sqrt(variance(&self.covariance, weights))
    }

    /// Number of base parameters that the data determine.
    pub fn rank(&self) -> usize {
        self.determined.iter().filter(|determined| **determined).count()
    }
}

impl<T: Real, const N: usize, const B: usize> Record<T, N, B> {
    /// Root mean square torque error of one joint that the parameters' covariance
    /// explains, N m: `tr(R Cov R') / rows`.
    #[inline(never)]
    pub(crate) fn uncertainty(&self, joint: usize, estimate: &Estimate<T, B>) -> T {
        let (Some(factor), Some(&rows)) = (self.factors.get(joint), self.rows.get(joint)) else {
            return T::zero();
        };
        let mut sum = T::zero();
        for row in factor.triangle() {
            for (one, covariances) in row.iter().zip(&estimate.covariance) {
                for (other, &covariance) in row.iter().zip(covariances) {
                    sum += *one * covariance * *other;
                }
            }
        }
        real::sqrt(real::max(sum, T::zero()) / T::from_double(f64::from(rows.max(1))))
    }
}

/// The least-squares problem of one record.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem<'a, T: Real, const N: usize, const B: usize> {
    record: &'a Record<T, N, B>,
    noise: [T; N],
    owner: [usize; B],
    /// Base parameters that are not held at zero.
    free: [bool; B],
    /// One over the standard deviation by which a base parameter is known to be zero; zero where unknown.
    known: [T; B],
    rank: usize,
}

impl<'a, T: Real, const N: usize, const B: usize> Problem<'a, T, N, B> {
    /// Problem of `record` for the base parameters of `model`.
    pub fn new(record: &'a Record<T, N, B>, model: &RowModel<T, N, B>) -> Self {
        let mut owner = [0; B];
        for (base, slot) in owner.iter_mut().enumerate() {
            *slot = model.base.independent(base).map_or(0, |(joint, _)| joint);
        }
        let rank = model.base.rank();
        let free = core::array::from_fn(|base| base < rank && !record.selection.dropped[base]);
        let mut known = [T::zero(); B];
        for (base, within) in model.known_to_be_zero() {
            known[base] = T::one() / within;
        }
        Self { record, noise: noise(record), owner, free, known, rank }
    }

    /// Standard deviation of one independent row of each joint, N m.
    pub fn noise(&self) -> &[T; N] {
        &self.noise
    }

    /// All joints' rows, weighted: chi-square units. Columns held at zero are empty.
    pub fn weighted(&self) -> Factor<T, B> {
        let mut all = Factor::new();
        for (factor, &sigma) in self.record.factors.iter().zip(&self.noise) {
            all.merge_scaled(factor, T::one() / sigma);
        }
        for (base, &weight) in self.known.iter().enumerate().filter(|(_, weight)| **weight > T::zero()) {
            let mut row = [T::zero(); B];
            row[base] = weight;
            all.absorb(&row, T::zero());
        }
        if self.record.selection.dropped_count() > 0 {
            all = all.without(&self.record.selection.dropped);
        }
        all
    }

    /// All weighted rows as one stage over all base parameters.
    pub fn whole(&self) -> Stage<T, B> {
        Stage::new(&self.weighted(), T::one(), &self.free, &[T::zero(); B])
    }

    /// Number of stages of a plan.
    pub(crate) const fn stages(plan: Plan) -> usize {
        match plan {
            Plan::OneTime => 1,
            Plan::Sequential => N,
        }
    }

    /// One stage of a plan; parameters determined by earlier stages are held at `values`.
    pub(crate) fn stage(
        &self,
        plan: Plan,
        index: usize,
        values: &[T; B],
        determined: &[bool; B],
    ) -> Stage<T, B> {
        match (plan, self.sequential_joint(index)) {
            (Plan::Sequential, Some(joint)) => {
                let open = self.open(joint, determined);
                Stage::new(&self.record.factors[joint], T::one() / self.noise[joint], &open, values)
            }
            _ => self.whole(),
        }
    }

    fn sequential_joint(&self, index: usize) -> Option<usize> {
        (N.checked_sub(1)?).checked_sub(index)
    }

    fn open(&self, joint: usize, determined: &[bool; B]) -> [bool; B] {
        core::array::from_fn(|base| self.free[base] && self.owner[base] >= joint && !determined[base])
    }

    /// The least-squares estimate of a plan, in closed form.
    pub fn least_squares(&self, plan: Plan) -> Estimate<T, B> {
        let mut estimate = Estimate::nothing();
        for index in 0..Self::stages(plan) {
            let stage = self.stage(plan, index, &estimate.values, &estimate.determined);
            let found = stage.factor.solve(stage.count);
            self.carry_errors(plan, index, &stage, &mut estimate);
            for (&column, &value) in stage.columns().iter().zip(&found) {
                estimate.values[column] = value;
                estimate.determined[column] = true;
            }
        }
        estimate
    }

    /// Covariance of a stage's parameters: their own, plus the errors of the held ones by
    /// `p_u = R_uu^-1 (z - R_uf p_f)`.
    fn carry_errors(&self, plan: Plan, index: usize, stage: &Stage<T, B>, estimate: &mut Estimate<T, B>) {
        let inverse = stage.factor.inverse(stage.count);
        let mut gain = [[T::zero(); B]; B]; // d p_u / d p_f, row = index in the stage, column = base parameter
        if let (Plan::Sequential, Some(joint)) = (plan, self.sequential_joint(index)) {
            for base in (0..self.rank).filter(|&base| estimate.determined[base]) {
                // Least squares with the held column as right-hand side gives its gain.
                let mut unit = [T::zero(); B];
                unit[base] = -T::one();
                let weight = T::one() / self.noise[joint];
                let against =
                    self.record.factors[joint].without_right().restricted(stage.columns(), &unit, weight);
                let solved = against.solve(stage.count);
                for (row, &value) in gain.iter_mut().zip(&solved) {
                    row[base] = -value;
                }
            }
        }
        let old = estimate.covariance;
        for (number, &row) in stage.columns().iter().enumerate() {
            for base in 0..B {
                let passed = (0..B).fold(T::zero(), |sum, held| sum + gain[number][held] * old[held][base]);
                estimate.covariance[row][base] = passed;
                estimate.covariance[base][row] = passed;
            }
        }
        for (number, &row) in stage.columns().iter().enumerate() {
            for (other, &column) in stage.columns().iter().enumerate() {
                let own =
                    (0..B).fold(T::zero(), |sum, inner| sum + inverse[number][inner] * inverse[other][inner]);
                let mut passed = T::zero();
                for (held, weights) in old.iter().enumerate() {
                    for (against, &covariance) in weights.iter().enumerate() {
                        passed += gain[number][held] * covariance * gain[other][against];
                    }
                }
                estimate.covariance[row][column] = own + passed;
            }
        }
    }
}
