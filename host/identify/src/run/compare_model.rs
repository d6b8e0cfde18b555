//! Compares two identifications: is it the same leg, and what was added to it?
//!
//! ```text
//! chi2 = d' (C_stored + C_found)^-1 d     d: difference of the common base parameters
//! one leg identified twice: chi2 has the chi-square distribution with as many degrees of freedom, k
//! limit = k (1 - 2/(9 k) + z sqrt(2/(9 k)))^3     its quantile, z that of the normal distribution
//! ```
//!
//! The distance is tested, not each parameter alone: errors of hardly separable parameters are large and
//! correlated. Each of them may be wrong while their sum is accurate.
//!
//! Source: E. B. Wilson and M. M. Hilferty, The distribution of chi-square, 1931.
//! Limits: differences between two days (temperature of the gears, fit of the wearer in the shell) are not in
//! the sigma of one recording. The test reports them as a change.

use nalgebra::SVector;

use crate::formats::model_file::{BaseSet, LARGEST_BASE_SET, ModelFile, StoredBase, padded};
use crate::formats::temperature;
use crate::report::{ComparisonReport, DifferenceReport};
use crate::run::added_mass;

/// Quantile of the normal distribution at 0.999, standard deviations.
const NORMAL_QUANTILE: f64 = 3.090_232;
/// Added to the diagonal of the correlations: rounding of the smallest eigenvalue in single precision.
pub(super) const ROUNDING: f64 = 1e-6;
/// Number of parameters named in the line.
const NAMED: usize = 3;

/// Common base parameters of two models.
pub(super) struct Common<'a> {
    /// Parameter in the stored model, and its value in the other one.
    pub(crate) pairs: Vec<(&'a StoredBase, f64)>,
    /// Covariance of the differences.
    pub(crate) covariance: Vec<Vec<f64>>,
    /// Parameters of one model only.
    pub(crate) not_compared: Vec<String>,
}

impl<'a> Common<'a> {
    fn new(stored: &'a BaseSet, found: &BaseSet) -> Self {
        let same = |one: &StoredBase, other: &StoredBase| {
            one.terms.len() == other.terms.len()
                && one.terms.iter().all(|(name, factor)| {
                    other.terms.get(name).is_some_and(|own| (own - factor).abs() <= 1e-6)
                })
        };
        let matches: Vec<(usize, usize)> = found
            .parameters
            .iter()
            .enumerate()
            .filter_map(|(index, base)| {
                Some((stored.parameters.iter().position(|other| same(other, base))?, index))
            })
            .collect();
        let alone = |bases: &[StoredBase], compared: &dyn Fn(usize) -> bool| -> Vec<String> {
            let rest = bases.iter().enumerate().filter(|(index, _)| !compared(*index));
            rest.map(|(_, base)| base.name.clone()).collect()
        };
        let mut not_compared = alone(&stored.parameters, &|stored_index| {
            matches.iter().any(|(other, _)| *other == stored_index)
        });
        not_compared
            .extend(alone(&found.parameters, &|index| matches.iter().any(|(_, other)| *other == index)));
        not_compared.sort();
        not_compared.dedup();
        let element = |one: &(usize, usize), other: &(usize, usize)| {
            stored.covariance[one.0][other.0] + found.covariance[one.1][other.1]
        };
        let row = |one| matches.iter().map(|other| element(one, other)).collect();
        Self {
            pairs: matches
                .iter()
                .map(|&(stored_index, index)| {
                    (&stored.parameters[stored_index], found.parameters[index].value)
                })
                .collect(),
            covariance: matches.iter().map(row).collect(),
            not_compared,
        }
    }
}

/// Compares a base set, found at this temperature, with a stored model; `None` without common parameters.
pub fn compare(
    model: &ModelFile,
    file: &str,
    found: &BaseSet,
    temperature_c: Option<f64>,
) -> Option<ComparisonReport> {
    let common = Common::new(&model.base_set, found);
    let count = common.pairs.len();
    let covariance = |row: usize, column: usize| common.covariance[row][column];
    let sigma: Vec<f64> = (0..count).map(|row| covariance(row, row).sqrt()).collect();
    let mut away = SVector::<f64, LARGEST_BASE_SET>::zeros();
    for (row, (base, value)) in common.pairs.iter().enumerate() {
        away[row] = (value - base.value) / sigma[row];
    }
    let correlations = padded(count, |row, column| {
        let own = if row == column { ROUNDING } else { 0.0 };
        covariance(row, column) / (sigma[row] * sigma[column]) + own
    });
    let chi2 = away.dot(&correlations.cholesky()?.solve(&away));
    let chi2_limit = quantile(count);
    let mut differences: Vec<_> = common
        .pairs
        .iter()
        .zip(away.iter())
        .map(|(&(base, found), &sigmas)| DifferenceReport {
            name: base.name.clone(),
            stored: base.value,
            found,
            sigmas,
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
        added_mass: added_mass::explain(model, &common),
        not_compared: common.not_compared,
        warning: temperature::warning(model.conditions.temperature_c, temperature_c),
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
pub(super) fn quantile(freedom: usize) -> f64 {
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
