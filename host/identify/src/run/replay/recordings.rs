//! Scatter of the parameters between recordings: each recording is excluded once (D3 of docs/method.md).
//!
//! ```text
//! sigma^2 = (G - 1) / G sum_g (p_g - mean p)^2        jackknife (Tukey 1958)
//! ```
//!
//! p_g are the parameters without recording g, by the weights of the fit to all G. Why: temperature, posture
//! and mounting differ between recordings, but not between segments of one recording. Limit: two or three
//! recordings determine the scatter only to a factor of two.

use crate::run::logging_errors::fit::solve;
use crate::run::logging_errors::rows::Equations;

/// Number of training recordings, and the standard deviation of each base parameter; `None` if one recording
/// alone determines a parameter.
pub(super) fn leave_one_out(equations: &Equations, file_of: &[usize]) -> (usize, Option<Vec<f64>>) {
    let weight = equations.training_weight();
    let of_rows: Vec<usize> = equations.sources.iter().map(|source| file_of[source.motion]).collect();
    let trains = |file: &usize| of_rows.iter().zip(&weight).any(|(own, weight)| own == file && *weight > 0.0);
    let files: Vec<usize> = (0..=file_of.iter().copied().max().unwrap_or(0)).filter(trains).collect();
    if files.len() < 2 {
        return (files.len(), None);
    }
    let without = |left_out: Option<usize>| {
        let rest: Vec<f64> = of_rows
            .iter()
            .zip(&weight)
            .map(|(file, weight)| if Some(*file) == left_out { 0.0 } else { *weight })
            .collect();
        solve(&equations.columns, &equations.torque, &rest, &equations.active, &equations.known)
    };
    let rank = without(None).rank;
    let fits: Vec<_> = files.iter().map(|&file| without(Some(file))).collect();
    if fits.iter().any(|fit| fit.rank < rank) {
        return (files.len(), None);
    }
    let count = files.len() as f64;
    let sigma = |base: usize| {
        let mean = fits.iter().map(|fit| fit.values[base]).sum::<f64>() / count;
        let squares: f64 = fits.iter().map(|fit| (fit.values[base] - mean).powi(2)).sum();
        ((count - 1.0) / count * squares).sqrt()
    };
    (files.len(), Some((0..equations.active.len()).map(sigma).collect()))
}
