//! The difference of two models as a mass added to one link.
//!
//! ```text
//! d = D theta + e        d: differences of the base parameters, Cov e = S = C_stored + C_found
//! theta = (D' S^-1 D)^-1 D' S^-1 d,   Cov theta = (D' S^-1 D)^-1    generalised least squares (Aitken 1935)
//! chi2 = (d - D theta)' S^-1 (d - D theta)
//! x = HX / M,   var x = (var HX - 2 x cov(HX, M) + x^2 var M) / M^2
//! ```
//!
//! | symbol | meaning |
//! | --- | --- |
//! | theta | ten rigid-body parameters of the mass added to a link: M, H, inertia |
//! | D | factor of each parameter in each base parameter |
//!
//! Friction and offset are not compared: they change from day to day. Sums that the base parameters do not
//! separate stay undetermined: the mass on the first link, for example, appears only in its first moments.

use nalgebra::SVector;
use scarab::model::{INERTIAL_PARAMETERS, Parameter};
use scarab_base::number::Number;

use crate::formats::model_file::{LARGEST_BASE_SET, ModelFile, padded};
use crate::report::AddedMassReport;
use crate::run::compare_model::{Common, ROUNDING, quantile};

/// Smallest independent share of a column's length for its parameter to be determined.
const INDEPENDENT_SHARE: f64 = 1e-3;
/// Significance, in sigma, from which the position of a mass is reported.
const LEAST_SIGMAS: f64 = 3.0;

type Column = SVector<f64, LARGEST_BASE_SET>;

/// Explanations by a mass on each link, the best one first.
pub(super) fn explain(model: &ModelFile, common: &Common) -> Vec<AddedMassReport> {
    let is_compared = |name: &str| {
        model.parameter(name).is_some_and(|(_, parameter)| {
            !matches!(parameter, Parameter::FC | Parameter::FV | Parameter::OFF)
        })
    };
    let rows: Vec<usize> = (0..common.pairs.len())
        .filter(|&row| common.pairs[row].0.terms.keys().all(|name| is_compared(name)))
        .collect();
    let sigma: Vec<f64> = rows.iter().map(|&row| common.covariance[row][row].sqrt()).collect();
    let correlations = padded(rows.len(), |row, column| {
        let own = if row == column { ROUNDING } else { 0.0 };
        common.covariance[rows[row]][rows[column]] / (sigma[row] * sigma[column]) + own
    });
    let Some(cholesky) = correlations.cholesky() else { return Vec::new() };
    let whitened = |element: &dyn Fn(usize) -> f64| -> Option<Column> {
        let mut column = Column::zeros();
        for (slot, (&row, sigma)) in rows.iter().zip(&sigma).enumerate() {
            column[slot] = element(row) / sigma;
        }
        cholesky.l_dirty().solve_lower_triangular(&column)
    };
    let Some(difference) = whitened(&|row| common.pairs[row].1 - common.pairs[row].0.value) else {
        return Vec::new();
    };
    let on_link = |joint: usize| {
        let columns = Parameter::ALL.iter().take(INERTIAL_PARAMETERS).filter_map(|parameter| {
            let name = format!("{}{}", parameter.symbol(), joint + 1);
            let column = whitened(&|row| common.pairs[row].0.terms.get(&name).copied().unwrap_or(0.0))?;
            (column.norm() > 0.0).then_some((*parameter, column))
        });
        let fit = Fit::new(&columns.collect::<Vec<_>>(), &difference);
        (!fit.parameters.is_empty()).then(|| fit.report(joint, rows.len()))
    };
    let mut found: Vec<(f64, AddedMassReport)> = (0..model.leg.joints.len()).filter_map(on_link).collect();
    // Akaike (1974): a free parameter must gain two.
    found.sort_by(|one, other| one.0.total_cmp(&other.0));
    found.into_iter().map(|(_, report)| report).collect()
}

/// Least squares over whitened columns.
struct Fit {
    /// Parameters with independent columns.
    parameters: Vec<Parameter>,
    values: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    /// False where a dropped column shares the parameter's effect.
    determined: Vec<bool>,
    chi2: f64,
}

/// Solves the upper triangle of columns `upper` for this right side.
fn back(upper: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let mut values = right.to_vec();
    for row in (0..right.len()).rev() {
        let known: f64 = (row + 1..right.len()).map(|column| upper[column][row] * values[column]).sum();
        values[row] = (values[row] - known) / upper[row][row];
    }
    values
}

impl Fit {
    fn new(columns: &[(Parameter, Column)], difference: &Column) -> Self {
        let (mut parameters, mut basis, mut upper): (Vec<_>, Vec<Column>, Vec<Vec<f64>>) = Default::default();
        let (mut lengths, mut shared) = (Vec::new(), Vec::new());
        for (parameter, column) in columns {
            let mut rest = *column;
            let mut along = Vec::new();
            for direction in &basis {
                let share = direction.dot(&rest);
                rest -= direction * share;
                along.push(share);
            }
            let length = rest.norm();
            if length > INDEPENDENT_SHARE * column.norm() {
                along.push(length);
                basis.push(rest / length);
                upper.push(along);
                parameters.push(*parameter);
                lengths.push(column.norm());
            } else {
                let factors = back(&upper, &along);
                let large = |(index, factor): (usize, f64)| {
                    (factor.abs() * lengths[index] > INDEPENDENT_SHARE * column.norm()).then_some(index)
                };
                shared.extend(factors.into_iter().enumerate().filter_map(large));
            }
        }
        let right: Vec<f64> = basis.iter().map(|direction| direction.dot(difference)).collect();
        let count = parameters.len();
        let unit =
            |index: usize| -> Vec<f64> { (0..count).map(|row| f64::from(u8::from(row == index))).collect() };
        let inverse: Vec<Vec<f64>> = (0..count).map(|index| back(&upper, &unit(index))).collect();
        let element = |row: usize, column: usize| inverse.iter().map(|half| half[row] * half[column]).sum();
        Self {
            values: back(&upper, &right),
            covariance: (0..count)
                .map(|row| (0..count).map(|column| element(row, column)).collect())
                .collect(),
            determined: (0..count).map(|index| !shared.contains(&index)).collect(),
            parameters,
            chi2: difference.norm_squared() - right.iter().map(|element| element * element).sum::<f64>(),
        }
    }

    fn index_of(&self, parameter: Parameter) -> Option<usize> {
        let index = self.parameters.iter().position(|own| *own == parameter)?;
        self.determined[index].then_some(index)
    }

    /// Criterion of Akaike, and the report.
    fn report(&self, joint: usize, rows: usize) -> (f64, AddedMassReport) {
        let known = |parameter| {
            let index = self.index_of(parameter)?;
            Some((self.values[index], self.covariance[index][index].sqrt()))
        };
        let mass = known(Parameter::M);
        let moments = [Parameter::HX, Parameter::HY].map(known);
        let is_large = mass.is_some_and(|(mass, sigma)| mass.abs() > LEAST_SIGMAS * sigma);
        let positions = [Parameter::HX, Parameter::HY].map(|parameter| {
            let (moment, mass) =
                (self.index_of(parameter)?, self.index_of(Parameter::M).filter(|_| is_large)?);
            let position = self.values[moment] / self.values[mass];
            let variance = self.covariance[moment][moment] - 2.0 * position * self.covariance[moment][mass]
                + position * position * self.covariance[mass][mass];
            Some((position, variance.max(0.0).sqrt() / self.values[mass].abs()))
        });
        let first = |pair: Option<(f64, f64)>| Number::from(pair.map(|(value, _)| value));
        let second = |pair: Option<(f64, f64)>| Number::from(pair.map(|(_, sigma)| sigma));
        let count = self.parameters.len();
        let report = AddedMassReport {
            joint: joint + 1,
            mass_kg: first(mass),
            mass_sigma_kg: second(mass),
            moment_kgm: moments.map(first),
            moment_sigma_kgm: moments.map(second),
            place_m: positions.map(first),
            place_sigma_m: positions.map(second),
            chi2: self.chi2.max(0.0),
            chi2_limit: if rows > count { quantile(rows - count) } else { 0.0 },
        };
        (self.chi2 + 2.0 * count as f64, report)
    }
}
