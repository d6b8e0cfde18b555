//! Weighted least squares over filtered rows, and a further column beside the parameters.
//!
//! ```text
//! A = sum w^2 x' x,   p = A^-1 sum w^2 x' y,   r = y - x p
//! u = z - x A^-1 sum w^2 x' z,   S = sum w^2 u^2,   delta = sum w^2 u r / S
//! sigma_noise = 1 / sqrt S
//! sigma_segments^2 = c(G) sum_g (sum_(k in g) w^2 u r1)^2 / S^2,   r1 = r - u delta
//! ```
//!
//! g are the segments (clusters). The second sigma needs no model of the noise, only that segments err
//! independently (Liang and Zeger 1986). The covariance of the parameters has the same two forms.

use scarab::real::dot;

/// Smallest independent share of a column that counts as determined.
const DETERMINED_SHARE: f64 = 1e-9;

/// Solution of a weighted least-squares problem.
#[derive(Clone, Debug)]
pub(crate) struct Fit<const B: usize> {
    /// Values; zero where not determined.
    pub(crate) values: [f64; B],
    /// Inverse of A: covariance if the weights are one over sigma.
    pub(crate) inverse: Box<[[f64; B]; B]>,
    /// Sum of squared weighted residuals.
    pub(crate) cost: f64,
    /// Number of determined columns.
    pub(crate) rank: usize,
}

impl<const B: usize> Fit<B> {
    /// Torque minus prediction of every equation.
    pub(crate) fn residuals(&self, columns: &[[f64; B]], torque: &[f64]) -> Vec<f64> {
        columns.iter().zip(torque).map(|(row, torque)| torque - dot(row, &self.values)).collect()
    }

    /// Predicted torque of every equation.
    pub(crate) fn predictions(&self, columns: &[[f64; B]]) -> Vec<f64> {
        columns.iter().map(|row| dot(row, &self.values)).collect()
    }
}

/// Inverse of the normal matrix; columns that are not determined are zero.
fn inverse<const B: usize>(matrix: &[[f64; B]; B], active: &[bool; B]) -> (Box<[[f64; B]; B]>, usize) {
    let scale: [f64; B] = core::array::from_fn(|column| matrix[column][column].max(0.0).sqrt());
    let mut lower = [[0.0; B]; B];
    let mut kept = [false; B];
    for row in 0..B {
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
                lower[row] = [0.0; B];
            }
        }
    }
    let mut result = Box::new([[0.0; B]; B]);
    let rank = kept.iter().filter(|kept| **kept).count();
    // Columns of L^-1, then L^-T L^-1.
    let mut half = [[0.0; B]; B];
    for unit in (0..B).filter(|&unit| kept[unit]) {
        for row in (unit..B).filter(|&row| kept[row]) {
            let mut sum = if row == unit { 1.0 } else { 0.0 };
            for inner in unit..row {
                sum -= lower[row][inner] * half[inner][unit];
            }
            half[row][unit] = sum / lower[row][row];
        }
    }
    for row in (0..B).filter(|&row| kept[row]) {
        for column in (0..B).filter(|&column| kept[column]) {
            let sum: f64 = (row.max(column)..B).map(|inner| half[inner][row] * half[inner][column]).sum();
            result[row][column] = sum / (scale[row] * scale[column]);
        }
    }
    (result, rank)
}

fn apply<const B: usize>(matrix: &[[f64; B]; B], vector: &[f64; B]) -> [f64; B] {
    core::array::from_fn(|row| dot(&matrix[row], vector))
}

/// Solves in closed form.
pub(crate) fn solve<const B: usize>(
    columns: &[[f64; B]],
    torque: &[f64],
    weight: &[f64],
    active: &[bool; B],
) -> Fit<B> {
    let mut normal = Box::new([[0.0; B]; B]);
    let mut right = [0.0; B];
    for ((row, torque), weight) in columns.iter().zip(torque).zip(weight) {
        let square = weight * weight;
        if square == 0.0 {
            continue;
        }
        for (one, element) in row.iter().enumerate() {
            let scaled = square * element;
            right[one] += scaled * torque;
            for (slot, other) in normal[one].iter_mut().zip(&row[..=one]) {
                *slot += scaled * other;
            }
        }
    }
    let (inverse, rank) = inverse(&normal, active);
    let values = apply(&inverse, &right);
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
pub(crate) fn score<const B: usize>(
    fit: &Fit<B>,
    columns: &[[f64; B]],
    torque: &[f64],
    z: &[f64],
    weight: &[f64],
    segment: &[usize],
) -> Score {
    let mut across = [0.0; B];
    for ((row, z), weight) in columns.iter().zip(z).zip(weight) {
        if *z == 0.0 {
            continue;
        }
        for (slot, element) in across.iter_mut().zip(row) {
            *slot += weight * weight * element * z;
        }
    }
    let absorbed = apply(&fit.inverse, &across);
    let column: Vec<f64> = columns
        .iter()
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
pub(crate) fn segment_sigma<const B: usize>(
    fit: &Fit<B>,
    columns: &[[f64; B]],
    torque: &[f64],
    weight: &[f64],
    segment: &[usize],
) -> [f64; B] {
    let residual = fit.residuals(columns, torque);
    let mut sums = vec![[0.0; B]; segment.iter().max().map_or(0, |last| last + 1)];
    for (((row, residual), weight), &segment) in columns.iter().zip(&residual).zip(weight).zip(segment) {
        for (slot, element) in sums[segment].iter_mut().zip(row) {
            *slot += weight * weight * residual * element;
        }
    }
    let shifts: Vec<[f64; B]> = sums.iter().map(|sum| apply(&fit.inverse, sum)).collect();
    core::array::from_fn(|base| {
        let of: Vec<f64> = shifts.iter().map(|shift| shift[base]).collect();
        (of.iter().map(|shift| shift * shift).sum::<f64>() * small_sample(&of)).sqrt()
    })
}
