//! Statistics of physically consistent legs over many runs: both searches, and the spread of
//! parameters that torque does not determine.

use super::error::ToolError;
use super::report::{ConsistentSearchReport, RunReport};
use super::tables::{self, say};

/// Goals of a cold start: iterations, and excess in chi-square units.
const ITERATIONS: u32 = 125;
const EXCESS: f64 = 0.5;

/// Selects one of a run's two searches.
type Search = fn(&RunReport) -> Option<&ConsistentSearchReport>;

fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let index = (share * values.len().saturating_sub(1) as f64).round() as usize;
    values.get(index).copied().unwrap_or(f64::NAN)
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Prints both searches, then the parameters that torque alone does not determine.
pub fn print(runs: &[RunReport]) -> Result<(), ToolError> {
    let mut table = tables::headed(&[
        "search for a leg that can exist",
        "excess <= 0.5",
        "worst excess",
        "within 125 iterations",
        "iterations to 0.5: median",
        "95 %",
        "to the end: median",
        "95 %",
        "evaluations: median",
        "95 %",
        "steps: most",
        "impossible legs",
    ]);
    let searches: [(&str, Search); 2] = [
        ("base values, completed (the result)", |run| Some(&run.consistent.base)),
        ("whole legs", |run| run.consistent.full.as_ref()),
    ];
    for (name, search) in searches {
        let all: Vec<_> = runs.iter().filter_map(search).collect();
        let column =
            |of: &dyn Fn(&ConsistentSearchReport) -> f64| all.iter().map(|&run| of(run)).collect::<Vec<_>>();
        let excess = column(&|run| run.excess_chi2.known().unwrap_or(f64::INFINITY));
        let to_half = column(&|run| run.iterations_to_half_chi2.map_or(f64::INFINITY, f64::from));
        let iterations = column(&|run| f64::from(run.iterations));
        let evaluations = column(&|run| f64::from(run.evaluations));
        let of = |count: usize| format!("{count} of {}", all.len());
        table.add_row(vec![
            name.to_owned(),
            of(excess.iter().filter(|excess| **excess <= EXCESS).count()),
            tables::number(excess.iter().copied().fold(f64::NEG_INFINITY, f64::max).into()),
            of(to_half.iter().filter(|iterations| **iterations <= f64::from(ITERATIONS)).count()),
            quantile(to_half.clone(), 0.5).to_string(),
            quantile(to_half, 0.95).to_string(),
            quantile(iterations.clone(), 0.5).to_string(),
            quantile(iterations, 0.95).to_string(),
            quantile(evaluations.clone(), 0.5).to_string(),
            quantile(evaluations, 0.95).to_string(),
            all.iter().map(|run| run.steps).max().unwrap_or(0).to_string(),
            of(all.iter().filter(|run| run.consistent == Some(false)).count()),
        ]);
    }
    say!("\n{table}");
    hidden(runs)
}

/// Parameters from the prior or in a group: their distance and the prior's distance from the truth.
fn hidden(runs: &[RunReport]) -> Result<(), ToolError> {
    let Some(first) = runs.first() else { return Ok(()) };
    let mut table = tables::headed(&[
        "what torque cannot tell",
        "status",
        "truth",
        "rms error: prior",
        "base values, completed",
        "whole legs",
        "between the two",
    ]);
    for (index, parameter) in first.parameters.iter().enumerate() {
        let (Some(truth), "grouped" | "prior") = (parameter.truth.known(), parameter.status) else {
            continue;
        };
        let values = |of: &dyn Fn(&RunReport) -> Option<f64>| runs.iter().filter_map(of).collect::<Vec<_>>();
        let off = |values: Vec<f64>| values.into_iter().map(|value| value - truth).collect::<Vec<_>>();
        let prior = off(values(&|run| run.parameters.get(index)?.prior.known()));
        let base = off(values(&|run| run.consistent.base.parameters.get(&parameter.name)?.known()));
        let full = off(values(&|run| run.consistent.full.as_ref()?.parameters.get(&parameter.name)?.known()));
        if base.is_empty() || full.len() != base.len() {
            continue;
        }
        let between: Vec<f64> = base.iter().zip(&full).map(|(base, full)| base - full).collect();
        table.add_row(vec![
            parameter.name.clone(),
            parameter.status.into(),
            tables::number(truth.into()),
            tables::number(rms(&prior).into()),
            tables::number(rms(&base).into()),
            tables::number(rms(&full).into()),
            tables::number(rms(&between).into()),
        ]);
    }
    if table.row_count() > 0 {
        say!("\n{table}");
    }
    Ok(())
}
