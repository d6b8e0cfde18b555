//! One explanation of a change: few free parameters, a chi-square with the model's uncertainty.
//!
//! The rows after the change, weighted and triangularised, read `R beta = z + e` with `e` of unit covariance.
//! The model gives beta_0 with covariance C, so
//!
//! ```text
//! w = z - R beta_0 = R D theta - R delta + e,   delta = beta_0 - beta(before), covariance C
//! S = E + R C R' = L L'                       covariance of w while theta = 0
//! theta = argmin |L^-1 (w - R D theta)|^2     generalised least squares (Aitken 1935), minimum chi2  (W4)
//! G = d theta / d w = P (R D)' S^-1           P = ((R D)' S^-1 R D)^-1, the covariance of theta
//! Cov(beta_0 + D theta) = C + D P D' - U P D' - D P U',   U = C R' S^-1 R D                          (W5)
//! ```
//!
//! | symbol | meaning |
//! | --- | --- |
//! | R, z | factor of the rows, B x B and B; chi-square units |
//! | D | base values of a unit of each free parameter, B x k |
//! | theta | change of the free parameters |
//!
//! (W5) includes the error that the held parameters pass on to theta. Columns that earlier ones explain to
//! within 1e-3 of their length are dropped: theta is then zero there and not determined.
//! Cost: `2 B^3 + k B^2` multiplications for S and each hypothesis. Stack: `3 B^2 + 3 k B` numbers.

use crate::ident::judge::verdict::Thresholds;
use crate::ident::record::factor::Factor;
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::estimate::{Estimate, variance};
use crate::model::{PARAMETERS_PER_JOINT, Parameter};
use crate::real::{self, Real, dot};

/// Most free parameters: the ten of a rigid body.
pub(crate) const DIRECTIONS: usize = 10;

/// Smallest independent share of a column's length for its parameter to be determined.
const DETERMINED_SHARE: f64 = 1e-3;

/// Result of one hypothesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hypothesis<T> {
    /// Change of each parameter; zero where it is not determined.
    pub values: [T; DIRECTIONS],
    /// Standard deviations of `values`, including the accepted model's uncertainty.
    pub(crate) sigmas: [T; DIRECTIONS],
    /// Parameters that the rows determine.
    pub determined: [bool; DIRECTIONS],
    /// Chi-square of the remaining residual.
    pub chi_square: T,
    /// Degrees of freedom of `chi_square`.
    pub freedom: T,
}

/// A hypothesis with its consequences for the model.
pub(crate) struct Explanation<T, const B: usize> {
    /// Summary of the hypothesis.
    pub(crate) hypothesis: Hypothesis<T>,
    /// Covariance of the hypothesis' values.
    pub(crate) covariance: [[T; DIRECTIONS]; DIRECTIONS],
    /// Base values after the change.
    pub(crate) estimate: Estimate<T, B>,
}

impl<T: Real> Hypothesis<T> {
    /// Hypothesis without any determined parameter.
    pub(crate) fn nothing() -> Self {
        Self {
            values: [T::zero(); DIRECTIONS],
            sigmas: [T::zero(); DIRECTIONS],
            determined: [false; DIRECTIONS],
            chi_square: T::zero(),
            freedom: T::one(),
        }
    }

    /// Standard deviation of one value; `None` where not determined.
    pub fn sigma(&self, index: usize) -> Option<T> {
        self.determined.get(index)?.then(|| self.sigmas.get(index).copied())?
    }

    /// True if the remaining residual is noise.
    pub fn explains(&self, thresholds: &Thresholds<T>) -> bool {
        self.chi_square <= thresholds.chance(self.freedom)
    }

    /// Akaike's criterion: smaller is better.
    pub(crate) fn score(&self) -> T {
        let free = self.determined.iter().filter(|determined| **determined).count();
        self.chi_square + T::from_double((2 * free) as f64)
    }
}

impl<T: Real, const B: usize> Explanation<T, B> {
    /// Variance of a weighted sum of the values.
    pub(crate) fn variance_of(&self, weights: &[T; DIRECTIONS]) -> T {
        variance(&self.covariance, weights)
    }
}

/// Rows after a change, compared with the accepted model's prediction.
pub(crate) struct Comparison<'a, T, const B: usize> {
    rows: &'a Factor<T, B>,
    before: &'a Estimate<T, B>,
    rank: usize,
    /// Factor L of S.
    cholesky: [[T; B]; B],
    /// `L^-1 w`.
    whitened: [T; B],
}

impl<'a, T: Real, const B: usize> Comparison<'a, T, B> {
    /// Prepares a comparison; `rows` are in units of an independent row's standard deviation.
    #[inline(never)]
    pub fn new(rows: &'a Factor<T, B>, before: &'a Estimate<T, B>, rank: usize) -> Self {
        let triangle = rows.triangle();
        let mut whitened = *rows.right();
        for (error, row) in whitened.iter_mut().zip(triangle) {
            for (&element, &value) in row.iter().zip(&before.values) {
                *error -= element * value;
            }
        }
        let mut cholesky = [[T::zero(); B]; B];
        for (covariance_row, row) in cholesky.iter_mut().zip(triangle) {
            let passed = times(&before.covariance, row);
            for (element, other) in covariance_row.iter_mut().zip(triangle) {
                *element = dot(&passed, other);
            }
        }
        for (index, row) in cholesky.iter_mut().enumerate() {
            row[index] += T::one();
        }
        factorise(&mut cholesky);
        forward(&cholesky, &mut whitened);
        Self { rows, before, rank, cholesky, whitened }
    }

    /// Chi-square and degrees of freedom of the old model.
    pub(crate) fn unchanged(&self) -> (T, T) {
        (dot(&self.whitened, &self.whitened), T::from_double(self.rank as f64))
    }

    /// Fits a hypothesis with these free parameters.
    #[inline(never)]
    pub(crate) fn explain<const N: usize>(
        &self,
        model: &RowModel<T, N, B>,
        parameters: &[(usize, Parameter); DIRECTIONS],
    ) -> Explanation<T, B> {
        let mut directions = [[T::zero(); B]; DIRECTIONS];
        let mut columns = [[T::zero(); B]; DIRECTIONS];
        for ((direction, column), &(joint, parameter)) in
            directions.iter_mut().zip(columns.iter_mut()).zip(parameters)
        {
            let mut unit = [[T::zero(); PARAMETERS_PER_JOINT]; N];
            if let Some(block) = unit.get_mut(joint) {
                block[parameter.index()] = T::one();
            }
            *direction = model.base.project(&unit);
            *column = times(self.rows.triangle(), direction);
            forward(&self.cholesky, column);
        }
        let (hypothesis, covariance) = self.fit(&columns);
        let mut explanation = Explanation { hypothesis, covariance, estimate: self.before.clone() };
        self.move_on(&mut explanation, &directions, &mut columns);
        explanation
    }

    /// Least squares over the whitened columns.
    #[inline(never)]
    fn fit(&self, columns: &[[T; B]; DIRECTIONS]) -> (Hypothesis<T>, [[T; DIRECTIONS]; DIRECTIONS]) {
        let mut chosen = [0; DIRECTIONS];
        let mut count = 0;
        let mut factor = Factor::<T, DIRECTIONS>::new();
        for candidate in 0..DIRECTIONS {
            chosen[count] = candidate;
            let tried = self.triangularised(columns, chosen.get(..=count).unwrap_or(&[]));
            let own = real::abs(tried.triangle()[count][count]);
            if own > T::from_double(DETERMINED_SHARE) * tried.column_length(count) {
                (factor, count) = (tried, count + 1);
            }
        }
        let (solved, inverse) = (factor.solve(count), factor.inverse(count));
        let mut covariance = [[T::zero(); DIRECTIONS]; DIRECTIONS];
        let mut hypothesis = Hypothesis {
            chi_square: if count > 0 { factor.residual() } else { dot(&self.whitened, &self.whitened) },
            freedom: T::from_double(self.rank.saturating_sub(count).max(1) as f64),
            ..Hypothesis::nothing()
        };
        for (number, &index) in chosen.iter().enumerate().take(count) {
            hypothesis.values[index] = solved[number];
            hypothesis.determined[index] = true;
            for (other, &column) in chosen.iter().enumerate().take(count) {
                covariance[index][column] = dot(&inverse[number], &inverse[other]);
            }
            hypothesis.sigmas[index] = real::sqrt(covariance[index][index]);
        }
        (hypothesis, covariance)
    }

    fn triangularised(&self, columns: &[[T; B]; DIRECTIONS], chosen: &[usize]) -> Factor<T, DIRECTIONS> {
        let mut factor = Factor::new();
        for (index, &right) in self.whitened.iter().enumerate() {
            let mut row = [T::zero(); DIRECTIONS];
            for (element, &column) in row.iter_mut().zip(chosen) {
                *element = columns.get(column).map_or(T::zero(), |column| column[index]);
            }
            factor.insert(&row, right);
        }
        factor
    }

    /// Moves the accepted model by the hypothesis, with (W5). `columns` hold `L^-1 R D` and are overwritten.
    #[inline(never)]
    fn move_on(
        &self,
        explanation: &mut Explanation<T, B>,
        directions: &[[T; B]; DIRECTIONS],
        columns: &mut [[T; B]; DIRECTIONS],
    ) {
        let Explanation { hypothesis, covariance, estimate } = explanation;
        for (direction, &value) in directions.iter().zip(&hypothesis.values) {
            for (sum, &element) in estimate.values.iter_mut().zip(direction) {
                *sum += value * element;
            }
        }
        for column in columns.iter_mut() {
            // U: back through L', then R' and C.
            backward(&self.cholesky, column);
            let mut spread = [T::zero(); B];
            for (row, &factor) in self.rows.triangle().iter().zip(column.iter()) {
                for (sum, &element) in spread.iter_mut().zip(row) {
                    *sum += factor * element;
                }
            }
            *column = times(&self.before.covariance, &spread);
        }
        for (first, covariances) in covariance.iter().enumerate() {
            for (second, &covariance) in covariances.iter().enumerate() {
                if covariance == T::zero() {
                    continue;
                }
                for (row, elements) in estimate.covariance.iter_mut().enumerate() {
                    for (column, element) in elements.iter_mut().enumerate() {
                        let own = directions[first][row] * directions[second][column];
                        let leaked = columns[first][row] * directions[second][column]
                            + directions[first][row] * columns[second][column];
                        *element += covariance * (own - leaked);
                    }
                }
            }
        }
    }
}

fn times<T: Real, const B: usize>(matrix: &[[T; B]; B], vector: &[T; B]) -> [T; B] {
    let mut product = [T::zero(); B];
    for (element, row) in product.iter_mut().zip(matrix) {
        *element = dot(row, vector);
    }
    product
}

/// Cholesky's lower factor in place; the upper half becomes zero. S is at least the
/// identity, so no pivot vanishes.
fn factorise<T: Real, const B: usize>(matrix: &mut [[T; B]; B]) {
    for column in 0..B {
        for row in column..B {
            let mut sum = matrix[row][column];
            for inner in 0..column {
                sum -= matrix[row][inner] * matrix[column][inner];
            }
            matrix[row][column] = if row == column {
                real::sqrt(real::max(sum, T::one()))
            } else {
                sum / matrix[column][column]
            };
        }
        for row in 0..column {
            matrix[row][column] = T::zero();
        }
    }
}

/// `L^-1 vector` in place.
fn forward<T: Real, const B: usize>(lower: &[[T; B]; B], vector: &mut [T; B]) {
    for row in 0..B {
        let mut sum = vector[row];
        for inner in 0..row {
            sum -= lower[row][inner] * vector[inner];
        }
        vector[row] = sum / lower[row][row];
    }
}

/// `L'^-1 vector` in place.
fn backward<T: Real, const B: usize>(lower: &[[T; B]; B], vector: &mut [T; B]) {
    for row in (0..B).rev() {
        let mut sum = vector[row];
        for inner in row + 1..B {
            sum -= lower[inner][row] * vector[inner];
        }
        vector[row] = sum / lower[row][row];
    }
}
