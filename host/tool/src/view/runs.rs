//! Statistics of many runs: errors over their bounds, coverage, searches, and the spread of parameters that
//! torque does not determine.

use scarab_base::error::ToolError;
use scarab_base::number::number;
use scarab_base::output::say;
use scarab_base::stats::{quantile, rms};
use scarab_base::table::{Table, cells};
use scarab_identify::report::scale::summary;
use scarab_identify::report::{ConsistentSearchReport, FitReport, RunReport, RunsReport};

/// Goals of a cold start: iterations, and excess in chi-square units.
const ITERATIONS: u32 = 125;
const EXCESS: f64 = 0.5;

/// Selects one of a run's two searches.
type Search = fn(&RunReport) -> Option<&ConsistentSearchReport>;

/// Prints both searches, then the parameters that torque alone does not determine.
fn print_searches(runs: &[RunReport]) -> Result<(), ToolError> {
    let mut table = Table::default().label("search for a physically consistent leg").numbers([
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
        ("whole legs, for comparison", |run| run.consistent.full.as_ref()),
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
        table.row(cells![
            name,
            of(excess.iter().filter(|excess| **excess <= EXCESS).count()),
            number(excess.iter().copied().fold(f64::NEG_INFINITY, f64::max).into()),
            of(to_half.iter().filter(|iterations| **iterations <= f64::from(ITERATIONS)).count()),
            quantile(to_half.clone(), 0.5).to_string(),
            quantile(to_half, 0.95).to_string(),
            quantile(iterations.clone(), 0.5).to_string(),
            quantile(iterations, 0.95).to_string(),
            quantile(evaluations.clone(), 0.5).to_string(),
            quantile(evaluations, 0.95).to_string(),
            all.iter().map(|run| run.steps).max().unwrap_or(0),
            of(all.iter().filter(|run| run.consistent == Some(false)).count()),
        ]);
    }
    say!("\n{}", table.to_text().trim_end());
    hidden(runs)
}

/// Parameters from the prior or in a group: their distance and the prior's distance from the truth.
fn hidden(runs: &[RunReport]) -> Result<(), ToolError> {
    let Some(first) = runs.first() else { return Ok(()) };
    let mut table = Table::default().label("not determined by torque").text(["status"]).numbers([
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
        table.row(cells![
            &parameter.name,
            parameter.status,
            number(truth.into()),
            number(rms(prior).into()),
            number(rms(base).into()),
            number(rms(full).into()),
            number(rms(between).into()),
        ]);
    }
    if !table.is_empty() {
        say!("\n{}", table.to_text().trim_end());
    }
    Ok(())
}

/// Table of the errors for each base parameter; torque without noise has no bound.
fn spread_table(report: &RunsReport) -> Table {
    let mut table = Table::default().label("base parameter").numbers([
        "truth",
        "rms sigma",
        "rms error",
        "bso rmse / CRB",
        "ls rmse / CRB",
        "bso bias / CRB",
    ]);
    let names = report.runs.iter().flat_map(|run| &run.base_parameters).map(|base| &base.name);
    let mut seen = Vec::new();
    names.for_each(|name| {
        if !seen.contains(&name) {
            seen.push(name);
        }
    });
    let named =
        |run: &RunReport, name: &str| run.base_parameters.iter().find(|base| base.name == name).cloned();
    let first = |name: &&String| report.runs.iter().find_map(|run| named(run, name));
    for base in seen.iter().filter_map(first) {
        let Some(truth) = base.truth.known() else { continue };
        let of = |value: &dyn Fn(&RunReport) -> Option<f64>| -> Vec<f64> {
            report.runs.iter().filter_map(value).collect()
        };
        let swarm = of(&|run| named(run, &base.name)?.value.known());
        let squares = of(&|run| run.least_squares.base_parameters.get(&base.name)?.known());
        let sigma = of(&|run| named(run, &base.name)?.sigma.known());
        let bound = rms(of(&|run| named(run, &base.name)?.cramer_rao.known()));
        let over_bound = |error: f64| {
            if bound > 0.0 { format!("{:.2}", error / bound) } else { "-".to_owned() }
        };
        let error = rms(swarm.iter().map(|value| value - truth));
        let bias = swarm.iter().map(|value| value - truth).sum::<f64>() / swarm.len().max(1) as f64;
        table.row(cells![
            &base.name,
            number(truth.into()),
            number(rms(sigma).into()),
            number(error.into()),
            over_bound(error),
            over_bound(rms(squares.iter().map(|value| value - truth))),
            over_bound(bias),
        ]);
    }
    table
}

/// Torque errors of each joint on every unused motion, against the noise-free and the measured torque.
fn fit_table(runs: &[RunReport]) -> Table {
    let mut table = Table::default().label("motion").numbers([
        "joint",
        "% of mean abs, noise-free: median",
        "worst",
        "% of mean abs, measured: median",
    ]);
    for (index, fit) in runs.first().into_iter().flat_map(|run| &run.validation).enumerate() {
        let errors = |error: &dyn Fn(&FitReport) -> Option<f64>| -> Vec<f64> {
            runs.iter().filter_map(|run| error(run.validation.get(index)?)).collect()
        };
        let truth = errors(&|fit| fit.percent_of_mean_abs_vs_truth.known());
        let measured = errors(&|fit| fit.percent_of_mean_abs.known());
        table.row(cells![
            &fit.motion,
            fit.joint,
            format!("{:.3}", quantile(truth.clone(), 0.5)),
            format!("{:.3}", quantile(truth, 1.0)),
            format!("{:.3}", quantile(measured, 0.5)),
        ]);
    }
    table
}

/// Share of errors within a number of reported sigma, pooled.
fn coverage(report: &RunsReport, sigmas: f64) -> f64 {
    let (mut within, mut all) = (0_u32, 0_u32);
    for base in report.runs.iter().flat_map(|run| &run.base_parameters) {
        if let (Some(value), Some(truth), Some(sigma)) =
            (base.value.known(), base.truth.known(), base.sigma.known())
        {
            within += u32::from((value - truth).abs() <= sigmas * sigma);
            all += 1;
        }
    }
    100.0 * f64::from(within) / f64::from(all.max(1))
}

/// Prints statistics of many runs.
pub(crate) fn print_runs(report: &RunsReport) -> Result<(), ToolError> {
    let runs = &report.runs;
    let Some(first) = runs.first() else { return Ok(()) };
    say!("{}: {} runs, prior {}, plan {}\n", first.leg, runs.len(), first.prior, first.plan);
    say!("{}", spread_table(report).to_text());
    say!(
        "sigma covers {:.1} % within one and {:.1} % within three (68.3, 99.7 for a normal distribution)",
        coverage(report, 1.0),
        coverage(report, 3.0)
    );
    say!("\n{}", fit_table(runs).to_text());
    let excess: Vec<f64> = runs.iter().filter_map(|run| run.bso.excess_chi2.known()).collect();
    let to_half: Vec<f64> =
        runs.iter().map(|run| run.bso.iterations_to_half_chi2.map_or(f64::INFINITY, f64::from)).collect();
    let iterations: Vec<f64> = runs.iter().map(|run| f64::from(run.bso.iterations)).collect();
    say!(
        "beetle swarm, cold start: excess <= 0.5 chi-square units in {} of {} runs (worst {}); iterations to there {} \
         median, {} in 95 %; to the end {} median, {} in 95 %",
        excess.iter().filter(|excess| **excess <= 0.5).count(),
        runs.len(),
        number(excess.iter().copied().fold(f64::NEG_INFINITY, f64::max).into()),
        quantile(to_half.clone(), 0.5),
        quantile(to_half.clone(), 0.95),
        quantile(iterations.clone(), 0.5),
        quantile(iterations.clone(), 0.95),
    );
    print_searches(runs)?;
    for joint in 0..first.tracking.len() {
        let of = |value: &dyn Fn(&scarab_identify::report::TrackingReport) -> Option<f64>| -> f64 {
            let values: Vec<f64> = runs.iter().filter_map(|run| value(run.tracking.get(joint)?)).collect();
            quantile(values.clone(), 0.5)
        };
        say!(
            "tracking on gait, joint {}: {} deg rms without the model, {} with it (medians)",
            joint + 1,
            number(of(&|tracking| tracking.rms_deg_without_model.known()).into()),
            number(of(&|tracking| tracking.rms_deg_with_model.known()).into()),
        );
    }
    for line in summary(runs) {
        say!("{line}");
    }
    let accepted = runs.iter().filter(|run| run.accepted()).count();
    say!("\naccepted: {accepted} of {}", runs.len());
    for run in runs.iter().filter(|run| !run.accepted()) {
        say!("seed {}: refused, {}", run.seed.unwrap_or(0), run.reasons.join(", "));
    }
    let (simulated, wall) = runs
        .iter()
        .fold((0.0, 0.0), |(simulated, wall), run| (simulated + run.simulated_s, wall + run.wall_s));
    say!("simulated time over time on one core: {:.0} times real time", simulated / wall);
    Ok(())
}
