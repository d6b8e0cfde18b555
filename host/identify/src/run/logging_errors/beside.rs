//! Further columns beside the parameters: torques that the model lacks, fitted with it.
//!
//! ```text
//! torque = Y p + X e            sigma_e: the larger of noise and scatter over segments
//! shift_e  = C_pe / C_ee sigma_e              C: inverse of the normal matrix
//! ```
//!
//! The shifts are what the covariance of the parameters lacks where X e is taken for known. A spring and
//! friction by load ([`AdditionalTorque`](crate::report::additional_torque::AdditionalTorque)) are such
//! columns; the second contains the load, which is that of the fit before. The values count as independent
//! of each other.

use scarab::model::Parameter;
use scarab::real::{dot, sign};

use crate::report::additional_torque::AdditionalKind;
use crate::report::doubt::CauseReport;
use crate::run::logging_errors::fit::{segment_sigma, solve};
use crate::run::logging_errors::rows::Equations;
use crate::run::logging_errors::table::Table;
use crate::run::logging_errors::{Question, Refitted};

/// Significance from which a joint's share of a cause is listed.
pub(crate) const LISTED: f64 = 3.0;
/// Fits after which the load is settled.
const LOAD_FITS: usize = 3;

/// Further columns with the parameters fitted beside them.
pub(crate) struct Beside {
    /// Columns and values of both.
    pub(crate) refitted: Refitted,
    /// Each further value with its standard deviation.
    pub(crate) found: Vec<(f64, f64)>,
    /// Change of each parameter with one standard deviation of each further value.
    pub(crate) shifts: Vec<Vec<f64>>,
}

/// A value over its standard deviation.
pub(crate) fn significance((value, sigma): (f64, f64)) -> f64 {
    value.abs() / sigma.max(1e-300)
}

/// Fits further columns beside the parameters.
pub(crate) fn beside(equations: &Equations, torque: Vec<f64>, further: &[Vec<f64>]) -> Beside {
    let rank = equations.active.len();
    let rows = equations.columns.rows().enumerate();
    let columns = Table::of_rows(
        rank + further.len(),
        rows.map(|(index, row)| {
            row.iter().copied().chain(further.iter().map(|column| column[index])).collect::<Vec<f64>>()
        }),
    );
    let active: Vec<bool> = equations.active.iter().copied().chain(further.iter().map(|_| true)).collect();
    let fit = solve(&columns, &torque, &equations.weight, &active, &equations.known);
    let scatter = segment_sigma(&fit, &columns, &torque, &equations.weight, &equations.clusters());
    // The weights are those of the misfit without the columns.
    let plain = equations.fit(&equations.columns, &torque, false).cost;
    let remaining = (fit.cost / plain.max(1e-300)).min(1.0).sqrt();
    let found: Vec<(f64, f64)> = (rank..rank + further.len())
        .map(|at| (fit.values[at], scatter[at].max(remaining * fit.inverse[at][at].max(0.0).sqrt())))
        .collect();
    let shift = |(at, (_, sigma)): (usize, &(f64, f64))| {
        let by_sigma = sigma / fit.inverse[at][at].max(1e-300);
        (0..rank).map(|base| fit.inverse[base][at] * by_sigma).collect()
    };
    let shifts = (rank..).zip(&found).map(shift).collect();
    let significance = found.iter().map(|found| significance(*found)).fold(0.0, f64::max);
    let values = fit.values;
    let refitted = Refitted { cause: CauseReport::default(), values, columns, torque, significance };
    Beside { refitted, found, shifts }
}

/// Fits springs and frictions by load of joints (from 0) beside the parameters. What is known of an offset is
/// not known of its sum with a spring's torque at rest.
pub(crate) fn additional(
    question: &Question,
    equations: &Equations,
    wanted: &[(usize, AdditionalKind)],
) -> Beside {
    let zero = question.zero();
    let rank = equations.active.len();
    let mut equations = equations.clone();
    for (base, known) in equations.known.iter_mut().enumerate() {
        let carrier = equations.regressor.carrier(base);
        let has_spring = |(joint, kind): &(usize, AdditionalKind)| {
            *kind == AdditionalKind::Spring && carrier == Some((*joint, Parameter::OFF))
        };
        *known *= if wanted.iter().any(has_spring) { 0.0 } else { 1.0 };
    }
    let equations = &equations;
    let mut values = equations.fit(&equations.columns, &equations.torque, false).values;
    values.resize(rank + wanted.len(), 0.0);
    let mut fits = LOAD_FITS;
    loop {
        let transmitted: Vec<f64> = (0..rank)
            .map(|base| match equations.regressor.carrier(base) {
                Some((_, Parameter::FC | Parameter::FV | Parameter::OFF)) => 0.0,
                _ => values[base],
            })
            .collect();
        let of_kind = |kind: AdditionalKind| {
            equations.torques_of(&|instant| {
                let rows = equations.regressor.rows(instant);
                for (joint, row) in rows.rows().enumerate() {
                    instant.torque[joint] = match kind {
                        AdditionalKind::Spring => instant.position[joint] - zero[joint],
                        AdditionalKind::LoadFriction => {
                            sign(instant.velocity[joint]) * dot(row, &transmitted).abs()
                        }
                    };
                }
            })
        };
        let all = AdditionalKind::ALL
            .map(|kind| wanted.iter().any(|wanted| wanted.1 == kind).then(|| of_kind(kind)));
        let column = |(joint, kind): &(usize, AdditionalKind)| -> Vec<f64> {
            let torques = all[*kind as usize].as_deref().unwrap_or_default();
            let pairs = torques.iter().zip(&equations.sources);
            pairs.map(|(torque, source)| if source.joint == *joint { *torque } else { 0.0 }).collect()
        };
        let columns: Vec<Vec<f64>> = wanted.iter().map(column).collect();
        let found = beside(equations, equations.torque.clone(), &columns);
        fits -= 1;
        if fits == 0 || all[AdditionalKind::LoadFriction as usize].is_none() {
            return found;
        }
        values = found.refitted.values;
    }
}
