//! Weighted least squares over filtered rows, and a further column beside the parameters.
//!
//! ```text
//! A = sum w^2 x' x + K,   p = A^-1 sum w^2 x' y,   r = y - x p     K: known columns, one over variance
//! u = z - x A^-1 sum w^2 x' z,   S = sum w^2 u^2,   delta = sum w^2 u r / S
//! sigma_noise = 1 / sqrt S
//! sigma_segments^2 = c(G) sum_g (sum_(k in g) w^2 u r1)^2 / S^2,   r1 = r - u delta
//! ```
//!
//! g are the segments (clusters). The second sigma needs no model of the noise, only that segments err
//! independently (Liang and Zeger 1986). The covariance of the parameters has the same two forms.

use scarab::real::dot;

use crate::run::logging_errors::table::Table;

/// Smallest independent share of a column that counts as determined.
const DETERMINED_SHARE: f64 = 1e-9;

/// Solution of a weighted least-squares problem.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    /// Values; zero where not determined.
    pub(crate) values: Vec<f64>,
    /// Inverse of A: covariance if the weights are one over sigma.
    pub(crate) inverse: Table,
    /// Sum of squared weighted residuals.
    pub(crate) cost: f64,
    /// Number of determined columns.
    pub(crate) rank: usize,
}

impl Fit {
    /// Torque minus prediction of every equation.
    pub(crate) fn residuals(&self, columns: &Table, torque: &[f64]) -> Vec<f64> {
        columns.rows().zip(torque).map(|(row, torque)| torque - dot(row, &self.values)).collect()
    }

    /// Predicted torque of every equation.
    pub(crate) fn predictions(&self, columns: &Table) -> Vec<f64> {
        columns.times(&self.values)
    }
}

/// Inverse of the normal matrix; columns that are not determined are zero.
fn inverse(matrix: &Table, active: &[bool]) -> (Table, usize) {
    let size = active.len();
    let scale: Vec<f64> = (0..size).map(|column| matrix[column][column].max(0.0).sqrt()).collect();
    let mut lower = Table::zeros(size, size);
    let mut kept = vec![false; size];
    for row in 0..size {
        if !active[row] || !(scale[row] > 0.0) {
            continue;
        }
        for column in 0..=row {
            if column < row && !kept[column] {
                continue;
            }
            let mut sum = matrix[row][column] / (scale[row] * scale[column]);
            for inner in 0..column {
                sum -= lower[row][inner] * lower[column][inner];
            }
            if column < row {
                lower[row][column] = sum / lower[column][column];
            } else if sum > DETERMINED_SHARE {
                lower[row][row] = sum.sqrt();
                kept[row] = true;
            } else {
                lower[row].fill(0.0);
            }
        }
    }
    let mut result = Table::zeros(size, size);
    let rank = kept.iter().filter(|kept| **kept).count();
    // Columns of L^-1, then L^-T L^-1.
    let mut half = Table::zeros(size, size);
    for unit in (0..size).filter(|&unit| kept[unit]) {
        for row in (unit..size).filter(|&row| kept[row]) {
            let mut sum = if row == unit { 1.0 } else { 0.0 };
            for inner in unit..row {
                sum -= lower[row][inner] * half[inner][unit];
            }
            half[row][unit] = sum / lower[row][row];
        }
    }
    for row in (0..size).filter(|&row| kept[row]) {
        for column in (0..size).filter(|&column| kept[column]) {
            let sum: f64 = (row.max(column)..size).map(|inner| half[inner][row] * half[inner][column]).sum();
            result[row][column] = sum / (scale[row] * scale[column]);
        }
    }
    (result, rank)
}

/// Solves in closed form. `known` is one over the variance by which a column is known to be zero; missing
/// ones are unknown.
pub(crate) fn solve(columns: &Table, torque: &[f64], weight: &[f64], active: &[bool], known: &[f64]) -> Fit {
    let mut normal = Table::zeros(active.len(), active.len());
    let mut right = vec![0.0; active.len()];
    for ((row, torque), weight) in columns.rows().zip(torque).zip(weight) {
        let square = weight * weight;
        if square == 0.0 {
            continue;
        }
        for (one, (element, sums)) in row.iter().zip(normal.rows_mut()).enumerate() {
            let scaled = square * element;
            right[one] += scaled * torque;
            for (slot, other) in sums.iter_mut().zip(&row[..=one]) {
                *slot += scaled * other;
            }
        }
    }
    for (column, known) in known.iter().enumerate() {
        normal[column][column] += known;
    }
    let (inverse, rank) = inverse(&normal, active);
    let values = inverse.times(&right);
    let mut fit = Fit { values, inverse, cost: 0.0, rank };
    let residual = fit.residuals(columns, torque);
    fit.cost = residual.iter().zip(weight).map(|(residual, weight)| (residual * weight).powi(2)).sum();
    fit
}

/// Estimate of a further column beside the parameters.
#[derive(Clone, Debug)]
pub(crate) struct Score {
    /// Value.
    pub(crate) delta: f64,
    /// Standard deviation by the noise of the rows.
    pub(crate) noise_sigma: f64,
    /// Standard deviation by the scatter of the segments.
    pub(crate) segment_sigma: f64,
    /// Share of the column's power that the parameters leave.
    pub(crate) seen: f64,
    /// Weighted column minus the part that the parameters explain.
    pub(crate) column: Vec<f64>,
}

impl Score {
    /// The larger standard deviation.
    pub(crate) fn sigma(&self) -> f64 {
        self.noise_sigma.max(self.segment_sigma)
    }
}

/// Estimates column `z` beside the parameters of `fit`. `segment` is the segment of each equation.
pub(crate) fn score(
    fit: &Fit,
    columns: &Table,
    torque: &[f64],
    z: &[f64],
    weight: &[f64],
    segment: &[usize],
) -> Score {
    let mut across = vec![0.0; fit.values.len()];
    for ((row, z), weight) in columns.rows().zip(z).zip(weight) {
        if *z == 0.0 {
            continue;
        }
        for (slot, element) in across.iter_mut().zip(row) {
            *slot += weight * weight * element * z;
        }
    }
    let absorbed = fit.inverse.times(&across);
    let column: Vec<f64> = columns
        .rows()
        .zip(z)
        .zip(weight)
        .map(|((row, z), weight)| weight * (z - dot(row, &absorbed)))
        .collect();
    let residual = fit.residuals(columns, torque);
    let power: f64 = z.iter().zip(weight).map(|(z, weight)| (z * weight).powi(2)).sum();
    let seen: f64 = column.iter().map(|element| element * element).sum();
    let along: f64 = column
        .iter()
        .zip(residual.iter().zip(weight))
        .map(|(u, (residual, weight))| u * residual * weight)
        .sum();
    let delta = if seen > 0.0 { along / seen } else { 0.0 };
    let mut sums = vec![0.0; segment.iter().max().map_or(0, |last| last + 1)];
    for (((u, residual), weight), &segment) in column.iter().zip(&residual).zip(weight).zip(segment) {
        sums[segment] += u * (residual * weight - u * delta);
    }
    let squares: f64 = sums.iter().map(|sum| sum * sum).sum();
    Score {
        delta,
        noise_sigma: 1.0 / seen.max(1e-300).sqrt(),
        segment_sigma: (squares * small_sample(&sums)).sqrt() / seen.max(1e-300),
        seen: if power > 0.0 { seen / power } else { 0.0 },
        column,
    }
}

/// G / (G - 1) t^2 / z^2 for the G segments that have data. `t` and `z` are the 97.5 % quantiles of Student's
/// distribution with G - 1 degrees of freedom and of the normal one, since few segments determine the scatter
/// poorly. Expansion of `t`: Abramowitz and Stegun (1964), 26.7.5.
fn small_sample(sums: &[f64]) -> f64 {
    const Z: f64 = 1.96;
    let filled = sums.iter().filter(|sum| **sum != 0.0).count() as f64;
    let freedom = (filled - 1.0).max(1.0);
    let (z2, z4) = (Z * Z, Z * Z * Z * Z);
    let quantiles =
        1.0 + (z2 + 1.0) / (4.0 * freedom) + (5.0 * z4 + 16.0 * z2 + 3.0) / (96.0 * freedom * freedom);
    filled / freedom * quantiles * quantiles
}

/// Standard deviations of the parameters by the scatter of the segments.
pub(crate) fn segment_sigma(
    fit: &Fit,
    columns: &Table,
    torque: &[f64],
    weight: &[f64],
    segment: &[usize],
) -> Vec<f64> {
    let residual = fit.residuals(columns, torque);
    let parameters = fit.values.len();
    let mut sums = Table::zeros(segment.iter().max().map_or(0, |last| last + 1), parameters);
    for (((row, residual), weight), &segment) in columns.rows().zip(&residual).zip(weight).zip(segment) {
        for (slot, element) in sums[segment].iter_mut().zip(row) {
            *slot += weight * weight * residual * element;
        }
    }
    let shifts = Table::of_rows(parameters, sums.rows().map(|sum| fit.inverse.times(sum)));
    let scatter = |base: usize| {
        let of: Vec<f64> = shifts.column(base).collect();
        (of.iter().map(|shift| shift * shift).sum::<f64>() * small_sample(&of)).sqrt()
    };
    (0..parameters).map(scatter).collect()
}
