//! Physically consistent legs: result of the board, result of a swarm over whole legs, and the optimum.
//!
//! The board searches base values and completes them. The host also runs the beetle swarm over
//! log-Cholesky coordinates of every link, in the board's precision. In double precision it finds the least
//! cost of any allowed leg. That problem is convex, so the result is the global optimum to within 21 N times
//! 1e-8, the effect of the barriers.

use std::collections::BTreeMap;

use scarab::ident::{
    Completion, Effort, Factor, FullObjective, FullSearch, LegCost, Limits, Plan, Problem, Solver,
};
use scarab::model::{LegParameters, Parameter};
use scarab::swarm::BsoSettings;
use scarab_base::number::Number;

use crate::leg::background::Background;
use crate::report::{ConsistentReport, ConsistentSearchReport};

/// Capacity for the coordinates of three joints.
const DIMENSIONS: usize = 42;
/// Excess at which a search counts as finished, chi-square units.
const ARRIVED: f64 = 0.5;
/// Share of the optimum's cost within which single precision has converged.
const SHARE_OF_COST: f64 = 1e-3;

/// Least cost of an allowed leg above that of least squares, chi-square units.
pub fn optimum<const N: usize, const B: usize>(
    background: &Background<N, B>,
    solver: &Solver<f32, N, B>,
) -> (f64, Factor<f64, B>) {
    let (parameters, weighted) = completed(background, solver, Effort::reference());
    (weighted.excess(&background.model.base.project(&parameters)), weighted)
}

/// Consistent leg of least cost in double precision, and the cost of the data.
fn completed<const N: usize, const B: usize>(
    background: &Background<N, B>,
    solver: &Solver<f32, N, B>,
    effort: Effort<f64>,
) -> (LegParameters<f64, N>, Factor<f64, B>) {
    let record = solver.record().convert::<f64>();
    let problem = Problem::new(&record, &background.model);
    let values = problem.least_squares(Plan::OneTime).values;
    let mut completion = Completion::new(&background.model, &record, background.prior.as_ref(), effort);
    completion.start(&background.model, &problem.whole(), &values, &values);
    while !completion.step() {}
    (completion.parameters(), problem.weighted())
}

/// Replaces a completed leg by the optimum in double precision where single precision ended far above it, as
/// happens with three joints without a prior.
pub(crate) fn finish<const N: usize, const B: usize>(
    background: &Background<N, B>,
    solver: &mut Solver<f32, N, B>,
) {
    let excess = |solver: &Solver<f32, N, B>| solver.consistency().map(|found| f64::from(found.excess));
    if excess(solver).is_none_or(|excess| excess <= ARRIVED) {
        return;
    }
    let effort = Effort::device(background.prior.is_some());
    let (parameters, weighted) = completed(background, solver, effort);
    let optimum = weighted.excess(&background.model.base.project(&parameters));
    let single = parameters.map(|joint| joint.map(|value| value as f32));
    if excess(solver).is_some_and(|excess| excess > near(optimum)) && Limits::consistent(&single) {
        let values = background.model.base.project(&parameters).map(|value| value as f32);
        solver.replace(&background.device, &single, &values);
    }
}

/// Cost up to which a search has found this optimum, chi-square units.
fn near(optimum: f64) -> f64 {
    optimum + ARRIVED + SHARE_OF_COST * optimum.max(0.0)
}

/// Compares both searches with the optimum.
pub fn compare<const N: usize, const B: usize>(
    background: &Background<N, B>,
    solver: &Solver<f32, N, B>,
    iterations_to_half_chi2: Option<u32>,
) -> ConsistentReport {
    let (optimum, weighted) = optimum(background, solver);
    let cost = |parameters: &LegParameters<f32, N>| {
        weighted.excess(&background.model.base.project(&parameters.map(|joint| joint.map(f64::from))))
    };
    let found = solver.parameters();
    let excess = found.map(|_| weighted.excess(&solver.found().map(f64::from)) - optimum);
    let consistency = solver.consistency();
    let base = ConsistentSearchReport {
        iterations: solver.search().iterations(),
        evaluations: solver.search().evaluations(),
        steps: solver.completion().steps(),
        settled: excess.map(|excess| optimum + excess <= near(optimum)),
        excess_chi2: excess.into(),
        iterations_to_half_chi2: iterations_to_half_chi2.filter(|_| found.is_some()),
        consistent: Some(found.is_some_and(|found| Limits::consistent(&found))),
        parameters: named(background, found.as_ref()),
    };
    ConsistentReport {
        chosen: "base",
        optimum_over_least_squares: optimum.into(),
        result_over_least_squares: consistency.map(|found| found.excess).into(),
        degrees_of_freedom: consistency.map(|found| found.degrees_of_freedom),
        full: Some(full(background, solver, optimum, &cost)),
        base,
    }
}

/// Runs the swarm over whole legs.
fn full<const N: usize, const B: usize>(
    background: &Background<N, B>,
    solver: &Solver<f32, N, B>,
    optimum: f64,
    data_cost: &dyn Fn(&LegParameters<f32, N>) -> f64,
) -> ConsistentSearchReport {
    let problem = Problem::new(solver.record(), &background.device);
    let limits = solver.completion().limits();
    let mut cost = LegCost::new(limits);
    let values = problem.least_squares(Plan::OneTime).values;
    cost.fill(&background.device, &problem.whole(), &values, Effort::device(background.prior.is_some()).pull);

    let objective = FullObjective::new(limits, &cost);
    let mut report = ConsistentSearchReport { consistent: Some(true), ..ConsistentSearchReport::default() };
    let seed = solver.search().seed();
    let Ok(mut search) = FullSearch::<f32, DIMENSIONS>::new(&objective, BsoSettings::default(), seed) else {
        return report;
    };
    loop {
        let before = search.iterations();
        let mut ended = false;
        while search.iterations() == before && !ended {
            ended = search.advance(&objective, 1);
        }
        let Some(found) = search.parameters(&objective) else { break };
        report.consistent = report.consistent.map(|before| before && Limits::consistent(&found));
        let excess = data_cost(&found) - optimum;
        report.excess_chi2 = excess.into();
        if excess <= ARRIVED && report.iterations_to_half_chi2.is_none() {
            report.iterations_to_half_chi2 = Some(search.iterations());
        }
        if ended {
            report.parameters = named(background, Some(&found));
            break;
        }
    }
    (report.iterations, report.evaluations) = (search.iterations(), search.evaluations());
    report
}

/// Values by name; empty without a prior, because parameters without an effect on torque would be
/// arbitrary.
fn named<const N: usize, const B: usize>(
    background: &Background<N, B>,
    parameters: Option<&LegParameters<f32, N>>,
) -> BTreeMap<String, Number> {
    let Some(parameters) = parameters.filter(|_| background.prior.is_some()) else { return BTreeMap::new() };
    let value = |joint: usize, parameter: Parameter| {
        (background.name(joint, parameter), parameters[joint][parameter.index()].into())
    };
    (0..N).flat_map(|joint| Parameter::ALL.map(|parameter| value(joint, parameter))).collect()
}
