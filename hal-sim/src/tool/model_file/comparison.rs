//! Compares a new identification with a stored model: is it the same leg?
//!
//! ```text
//! chi2 = d' (C_kept + C_found)^-1 d       d: difference of the common base parameters
//! one leg identified twice: chi2 has the chi-square distribution with as many degrees of freedom, k
//! limit = k (1 - 2/(9 k) + z sqrt(2/(9 k)))^3     its quantile, z that of the normal distribution
//! ```
//!
//! Why the distance and not each parameter alone: errors of hardly separable parameters are large
//! and correlated. Each of them may be off while their sum is accurate.
//!
//! Source: E. B. Wilson and M. M. Hilferty, The distribution of chi-square, 1931.
//! Limits: sigma counts noise of the torque only. Differences between two days (temperature of the
//! gears, fit of the wearer in the shell) therefore appear as a change, which they are.

use nalgebra::SVector;

use super::{LARGEST_BASE_SET, ModelFile, padded};
use crate::tool::report::{ComparisonReport, DifferenceReport, RunReport};
use crate::tool::temperature;

/// Quantile of the normal distribution at 0.999, standard deviations.
const NORMAL_QUANTILE: f64 = 3.090_232;
/// Added to the diagonal of the correlations: rounding of the smallest eigenvalue in single precision.
const ROUNDING: f64 = 1e-6;
/// Number of parameters named in the line.
const NAMED: usize = 3;

/// Compares the run's base set with a stored model's; `None` without common parameters.
#[must_use]
pub fn compare(model: &ModelFile, file: &str, run: &RunReport) -> Option<ComparisonReport> {
    let kept = &model.base_set;
    let mut pairs = Vec::new();
    let mut not_compared = Vec::new();
    for (index, base) in run.base_parameters.iter().enumerate() {
        let same = |other: &super::StoredBase| {
            other.terms.len() == base.terms.len()
                && other.terms.iter().all(|(name, factor)| {
                    base.terms.get(name).is_some_and(|own| (own - factor).abs() <= 1e-6)
                })
        };
        match (kept.parameters.iter().position(same), base.value.known(), base.sigma.known()) {
            (Some(place), Some(value), Some(_)) => pairs.push((place, index, value)),
            _ => not_compared.push(base.name.clone()),
        }
    }
    let missing = kept.parameters.iter().enumerate();
    not_compared.extend(
        missing
            .filter(|(place, _)| pairs.iter().all(|(other, ..)| other != place))
            .map(|(_, base)| base.name.clone()),
    );
    not_compared.sort();
    not_compared.dedup();

    let count = pairs.len();
    let covariance = |row: usize, column: usize| {
        let (one, other) = (&pairs[row], &pairs[column]);
        kept.covariance[one.0][other.0] + run.detail.covariance[one.1][other.1]
    };
    let sigma: Vec<f64> = (0..count).map(|row| covariance(row, row).sqrt()).collect();
    let mut away = SVector::<f64, LARGEST_BASE_SET>::zeros();
    for (row, (place, _, value)) in pairs.iter().enumerate() {
        away[row] = (value - kept.parameters[*place].value) / sigma[row];
    }
    let correlations = padded(count, |row, column| {
        let own = if row == column { ROUNDING } else { 0.0 };
        covariance(row, column) / (sigma[row] * sigma[column]) + own
    });
    let chi2 = away.dot(&correlations.cholesky()?.solve(&away));
    let chi2_limit = quantile(count);
    let mut differences: Vec<_> = pairs
        .iter()
        .zip(away.iter())
        .map(|(&(place, _, found), &sigmas)| {
            let base = &kept.parameters[place];
            DifferenceReport { name: base.name.clone(), stored: base.value, found, sigmas }
        })
        .collect();
    differences.sort_by(|one, other| other.sigmas.abs().total_cmp(&one.sigmas.abs()));
    let changed = !(chi2 <= chi2_limit);
    let line = if changed {
        changed_line(&differences, &model.created)
    } else {
        format!("the same leg as on {}", model.created)
    };
    Some(ComparisonReport {
        model: file.to_owned(),
        created: model.created.clone(),
        verdict: if changed { "changed" } else { "same" },
        line,
        chi2,
        chi2_limit,
        differences,
        not_compared,
        warning: temperature::warning(model.conditions.temperature_c, run.temperature_c.known()),
    })
}

fn changed_line(differences: &[DifferenceReport], created: &str) -> String {
    let named: Vec<_> = differences
        .iter()
        .take(NAMED)
        .map(|difference| format!("{} by {:+.1} sigma", difference.name, difference.sigmas))
        .collect();
    format!("changed since {created}: {}", named.join(", "))
}

/// Quantile of chi-square at 0.999.
fn quantile(freedom: usize) -> f64 {
    let freedom = freedom.max(1) as f64;
    let share = 2.0 / (9.0 * freedom);
    freedom * (1.0 - share + NORMAL_QUANTILE * share.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_table() {
        // Tables of chi-square at 0.999; the approximation is within 2 % from three degrees of freedom on.
        for (freedom, table) in [(3, 16.266), (6, 22.458), (13, 34.528), (25, 52.620)] {
            let found = quantile(freedom);
            assert!((found / table - 1.0).abs() < 0.02, "{freedom}: {found} against {table}");
        }
    }
}
