//! Builds the report of a run from its outcome, and the outcome from a solver and its records.

use std::collections::BTreeMap;
use std::time::Duration;

use scarab::ident::{
    Choice, Estimate, Estimator, Factor, Problem, Record, SearchState, Selection, Solver, Status, Verdict,
    least_squares_in_box, prior_parameters, status,
};
use scarab::model::{PARAMETERS_PER_JOINT, Parameter, Standing};
use scarab_base::names::{estimator_name, parameter_name, plan_name, surplus_name};
use scarab_base::number::Number;
use scarab_base::precision::plain;

use crate::leg::background::Background;
use crate::report::disturbances::{OutliersReport, StribeckReport};
use crate::report::findings::FindingReport;
use crate::report::scale::ScaleReport;
use crate::report::trace::TraceReport;
use crate::report::{
    ACCEPTED, BaseReport, ConsistentReport, FitReport, LeastSquaresReport, ParameterReport, REFUSED,
    RunReport, SCHEMA, SwarmReport, TrackingReport,
};
use crate::run::consistent;

/// Recorded motion and, in simulation, its comparison with the noise-free torque.
#[derive(Clone, Debug)]
pub struct Motion<const N: usize, const B: usize> {
    /// `fourier`, `gait-6.5`, ...
    pub name: String,
    /// Filtered rows of the motion.
    pub record: Record<f32, N, B>,
    /// Comparison with the noise-free torque; simulated motions only.
    pub truth: Option<[TruthFit; N]>,
}

/// Comparison with the noise-free torque of one joint.
#[derive(Clone, Copy, Debug, Default)]
pub struct TruthFit {
    /// Root mean square error over mean absolute torque, percent; rows in which the joint sticks
    /// are excluded.
    pub percent_of_mean_abs: f64,
    /// Share of excluded rows.
    pub sticking_share: f64,
}

/// Further data for the report of a run.
#[derive(Clone, Debug, Default)]
pub struct Circumstances<const B: usize> {
    /// Seed of the simulated noise.
    pub seed: Option<u64>,
    /// Cramer-Rao bound of the base parameters.
    pub cramer_rao: Option<[f64; B]>,
    /// Cramer-Rao bound of each joint's Stribeck surplus.
    pub surplus_cramer_rao: Vec<Option<f64>>,
    /// Robust or plain.
    pub estimator: Estimator,
    /// First iteration with an excess of at most 0.5.
    pub iterations_to_half_chi2: Option<u32>,
    /// Every test of the verdict.
    pub findings: Vec<FindingReport>,
    /// Effect of the model on the servo.
    pub tracking: Vec<TrackingReport>,
    /// Kind of simulated drives.
    pub drive: Option<&'static str>,
    /// Simulated or recorded time, s.
    pub simulated_s: f64,
    /// Computing time.
    pub wall: Duration,
}

/// Outcome of an identification, from its solver or from the records of a board.
#[derive(Clone, Debug)]
pub struct Outcome<const N: usize, const B: usize> {
    /// `one-time` or `sequential`.
    pub plan: &'static str,
    /// Reasons for rejection.
    pub reasons: Vec<&'static str>,
    /// Every test of the verdict.
    pub findings: Vec<FindingReport>,
    /// Base parameters that the data determine.
    pub rank: usize,
    /// Condition number of the scaled weighted problem.
    pub condition: Number,
    /// Fourteen parameters of every joint.
    pub parameters: Vec<ParameterReport>,
    /// Values of the base parameters and their covariance.
    pub estimate: Estimate<f32, B>,
    /// Columns chosen by the data.
    pub selection: Selection<f32, N, B>,
    /// RMS torque of each joint on the motion identified from, N m.
    pub torque_rms: [f32; N],
    /// Stribeck friction of the joints that show it.
    pub stribeck: Vec<StribeckReport>,
    /// Rows and samples excluded from the motion identified from.
    pub outliers: OutliersReport,
    /// Residuals on the motion identified from.
    pub training: Vec<FitReport>,
    /// Residuals on unused motions.
    pub validation: Vec<FitReport>,
    /// Base parameters in closed form.
    pub least_squares: [Number; B],
    /// Static friction above Coulomb friction in closed form, for each of `stribeck`.
    pub least_squares_surplus: Vec<Number>,
    /// Cost in closed form.
    pub least_squares_cost: Number,
    /// Search by the swarm.
    pub bso: SwarmReport,
    /// Searches for a physically consistent leg.
    pub consistent: ConsistentReport,
    /// Further data of a board's trace.
    pub trace: Option<TraceReport>,
}

impl<const N: usize, const B: usize> Background<N, B> {
    /// Name of a base parameter: its carrier, with an `R` if others are regrouped into it.
    pub fn base_name(&self, base: usize) -> String {
        let Some((joint, parameter)) = self.model.base.independent(base) else { return String::new() };
        let others = self.terms(base).count() > 1;
        format!("{}{}", self.name(joint, parameter), if others { "R" } else { "" })
    }

    /// Sets the estimator. Plain least squares disables every choice left to the data.
    pub fn use_estimator(&mut self, estimator: Estimator) {
        let rule_out = |choice: &mut Choice| {
            if *choice == Choice::Auto && estimator == Estimator::Plain {
                *choice = Choice::Off;
            }
        };
        self.model.stribeck_choice.iter_mut().for_each(rule_out);
        self.device.stribeck_choice.iter_mut().for_each(rule_out);
    }

    fn terms(&self, base: usize) -> impl Iterator<Item = (usize, Parameter, f64)> + '_ {
        let terms = self.model.base.terms(base);
        (0..N).flat_map(move |joint| {
            Parameter::ALL
                .into_iter()
                .map(move |parameter| (joint, parameter, terms[joint][parameter.index()]))
                .filter(|(_, _, factor)| *factor != 0.0)
        })
    }

    /// Whether the parameter is not estimated and thus zero in the model. `dropped` marks base parameters
    /// held at zero.
    pub(crate) fn is_zero(&self, dropped: &[bool; B], joint: usize, parameter: Parameter) -> bool {
        self.model.base.standing(joint, parameter) == Standing::Off
            || self.device.drive(joint, parameter).is_some_and(|base| dropped[base])
    }

    fn unit(&self, base: usize) -> &'static str {
        self.model.base.independent(base).map_or("", |(_, parameter)| parameter.unit())
    }

    /// Constrained optimum of the swarm and both costs, in double precision and chi-square units.
    pub fn costs(&self, solver: &Solver<f32, N, B>) -> Costs<B> {
        let record = solver.record().convert::<f64>();
        let all = Problem::new(&record, &self.model).weighted();
        let bounds = scarab::ident::ParameterBox {
            low: solver.bounds().low.map(f64::from),
            high: solver.bounds().high.map(f64::from),
        };
        let rank = self.model.base.rank();
        let optimum = least_squares_in_box(&all, rank, &bounds);
        Costs { least_squares: all.residual(), above: all.excess(&optimum), factor: all }
    }

    /// Runs the swarm to its end.
    pub fn search(&self, solver: &mut Solver<f32, N, B>) -> Search {
        let optimum = self.costs(solver);
        let mut course = Search { excess: Vec::new(), to_half: None, floor: optimum.above };
        loop {
            let state = solver.advance(&self.device, SLICE);
            if !matches!(state, SearchState::Failed(_)) {
                let excess = optimum.factor.excess(&solver.search().values().map(f64::from)) - optimum.above;
                let iterations = solver.search().iterations();
                if course.excess.last().is_none_or(|(last, _)| *last != iterations) {
                    course.excess.push((iterations, excess));
                }
                if excess <= 0.5 && course.to_half.is_none() {
                    course.to_half = Some(iterations);
                }
            }
            if state != SearchState::Running {
                return course;
            }
        }
    }

    /// Report of a run from its solver.
    pub fn report(
        &self,
        solver: &Solver<f32, N, B>,
        verdict: Verdict,
        training: &[Motion<N, B>],
        validation: &[Motion<N, B>],
        circumstances: &Circumstances<B>,
    ) -> RunReport {
        let estimate = solver.estimate();
        let costs = self.costs(solver);
        let cost = costs.factor.excess(&solver.search().values().map(f64::from));
        let searched = solver.search().state() == SearchState::Done;
        let record = solver.record();
        let squares = solver.least_squares();
        let consistent = consistent::compare(self, solver, circumstances.iterations_to_half_chi2);
        let outcome = Outcome {
            plan: plan_name(solver.plan()),
            reasons: verdict.reasons().map(scarab::ident::Reason::name).collect(),
            findings: self.in_context(&circumstances.findings, &consistent),
            rank: squares.rank(),
            condition: solver.condition().into(),
            parameters: self.parameters(solver, &estimate),
            stribeck: self.stribeck(solver, &estimate.values),
            selection: record.selection,
            torque_rms: core::array::from_fn(|joint| record.torque[joint].root_mean_square),
            outliers: OutliersReport::from_record(record, estimator_name(circumstances.estimator)),
            training: fits(training, &estimate.values),
            validation: fits(validation, &estimate.values),
            least_squares: squares.values.map(Number::from),
            least_squares_surplus: self
                .stribeck(solver, &squares.values)
                .iter()
                .map(|found| found.surplus_nm)
                .collect(),
            least_squares_cost: costs.least_squares.into(),
            bso: SwarmReport {
                seed: solver.search().seed(),
                iterations: solver.search().iterations(),
                evaluations: solver.search().evaluations(),
                cost_over_least_squares: searched.then_some(cost / costs.least_squares).into(),
                excess_chi2: searched.then_some(cost - costs.above).into(),
                iterations_to_half_chi2: circumstances.iterations_to_half_chi2.filter(|_| searched),
            },
            consistent,
            trace: None,
            estimate,
        };
        self.run_report(outcome, circumstances)
    }

    /// Report of an outcome: all of its values with their names.
    pub fn run_report(&self, outcome: Outcome<N, B>, circumstances: &Circumstances<B>) -> RunReport {
        let (estimate, dropped) = (&outcome.estimate, &outcome.selection.dropped);
        let base = self.base_parameters(dropped, estimate, circumstances.cramer_rao.as_ref());
        let surpluses = self.surpluses(&outcome.stribeck, &circumstances.surplus_cramer_rao);
        let squares = self.kept(dropped).map(|base| (self.base_name(base), outcome.least_squares[base]));
        let joints = outcome.stribeck.iter().map(|found| surplus_name(found.joint - 1));
        let shows_stribeck = |joint| outcome.stribeck.iter().any(|found| found.joint == joint + 1);
        let sizes = core::array::from_fn(|joint| (shows_stribeck(joint), outcome.torque_rms[joint]));
        RunReport {
            schema: SCHEMA,
            leg: self.leg.clone(),
            seed: circumstances.seed,
            swarm_seed: outcome.bso.seed,
            prior: self.prior_name.clone(),
            plan: outcome.plan,
            verdict: if outcome.reasons.is_empty() { ACCEPTED } else { REFUSED },
            validated: !outcome.validation.is_empty(),
            reasons: outcome.reasons,
            findings: outcome.findings,
            rank: outcome.rank,
            columns: self.columns - outcome.selection.dropped_count(),
            condition: outcome.condition,
            parameters: outcome.parameters,
            base_parameters: base.into_iter().chain(surpluses).collect(),
            additional_torque: Vec::new(),
            model_choice: self.model_choice(&outcome.selection, &sizes),
            asymmetric_coulomb: self.directions(dropped, estimate),
            temperature_c: self.temperature_c.into(),
            outliers: outcome.outliers,
            training: outcome.training,
            validation: outcome.validation,
            least_squares: LeastSquaresReport {
                base_parameters: squares.chain(joints.zip(outcome.least_squares_surplus)).collect(),
                cost: outcome.least_squares_cost,
            },
            bso: outcome.bso,
            consistent: outcome.consistent,
            tracking: circumstances.tracking.clone(),
            scale: ScaleReport::default(),
            drive: circumstances.drive,
            simulated_s: circumstances.simulated_s,
            wall_s: circumstances.wall.as_secs_f64(),
            detail: self.detail(dropped, estimate),
            stribeck: outcome.stribeck,
            doubt: None,
            samples: None,
            read: None,
            compared: None,
            trace: outcome.trace,
        }
    }

    /// Completes the words of findings with facts that the verdict does not have: whether there is a prior,
    /// and whether the search for a physically consistent leg has converged.
    fn in_context(&self, findings: &[FindingReport], consistent: &ConsistentReport) -> Vec<FindingReport> {
        let mut findings = findings.to_vec();
        for finding in findings.iter_mut().filter(|finding| !finding.passed && finding.test == "prior_box") {
            if consistent.base.settled == Some(false) {
                finding.words = format!(
                    "the search for a physically consistent leg has not converged: it ended {} chi-square units above the optimum",
                    plain(consistent.base.excess_chi2)
                );
            } else if self.prior.is_none() {
                finding.words =
                    finding.words.replace("leg that the prior allows", "physically consistent leg");
            }
        }
        findings
    }

    fn stribeck(&self, solver: &Solver<f32, N, B>, values: &[f32; B]) -> Vec<StribeckReport> {
        let found = solver.record().stribeck.iter().enumerate();
        found.filter_map(|(joint, fit)| Some(StribeckReport::new(joint, fit.as_ref()?, values))).collect()
    }

    /// Static friction above Coulomb friction, for joints with a true or identified surplus.
    pub(crate) fn surpluses(&self, found: &[StribeckReport], cramer_rao: &[Option<f64>]) -> Vec<BaseReport> {
        let of = |joint: usize| {
            let found = found.iter().find(|found| found.joint == joint + 1);
            let truth = self.stribeck_truth[joint];
            (found.is_some() || truth.is_some()).then(|| BaseReport {
                name: surplus_name(joint),
                terms: [(surplus_name(joint), 1.0), (parameter_name(joint, Parameter::FC), -1.0)].into(),
                value: found.map_or(Number::UNKNOWN, |found| found.surplus_nm),
                unit: "N m",
                sigma: found.map_or(Number::UNKNOWN, |found| found.surplus_sigma_nm),
                sigma_from: "noise",
                sigma_noise: found.map_or(Number::UNKNOWN, |found| found.surplus_sigma_nm),
                sigma_misfit: Number::UNKNOWN,
                truth: match self.truth {
                    Some(_) => truth.map_or(0.0, |truth| truth.surplus).into(),
                    None => Number::UNKNOWN,
                },
                cramer_rao: cramer_rao.get(joint).copied().flatten().into(),
            })
        };
        (0..N).filter_map(of).collect()
    }

    /// Base parameters that are not held at zero.
    pub(crate) fn kept<'a>(&self, dropped: &'a [bool; B]) -> impl Iterator<Item = usize> + 'a {
        (0..self.model.base.rank()).filter(|&base| !dropped[base])
    }

    /// Reports of the base parameters.
    pub fn base_parameters(
        &self,
        dropped: &[bool; B],
        estimate: &Estimate<f32, B>,
        cramer_rao: Option<&[f64; B]>,
    ) -> Vec<BaseReport> {
        let truth = self.truth.as_ref().map(|truth| self.model.base.project(truth));
        self.kept(dropped)
            .map(|base| BaseReport {
                name: self.base_name(base),
                terms: self
                    .terms(base)
                    .map(|(joint, parameter, factor)| (self.name(joint, parameter), factor))
                    .collect::<BTreeMap<_, _>>(),
                value: estimate.determined[base].then_some(estimate.values[base]).into(),
                unit: self.unit(base),
                sigma: estimate.sigma(base).into(),
                sigma_from: "noise",
                sigma_noise: estimate.sigma(base).into(),
                sigma_misfit: Number::UNKNOWN,
                truth: truth.map(|truth| truth[base]).into(),
                cramer_rao: cramer_rao.filter(|_| estimate.determined[base]).map(|bound| bound[base]).into(),
            })
            .collect()
    }

    /// Other parameters of the same base parameters.
    pub fn grouped_with(&self, joint: usize, parameter: Parameter) -> Vec<String> {
        let carriers = self.model.base.carriers(joint, parameter);
        let others = carriers
            .flat_map(|base| self.terms(base))
            .filter(|&(other, symbol, _)| (other, symbol) != (joint, parameter));
        let mut names: Vec<String> = others.map(|(other, symbol, _)| self.name(other, symbol)).collect();
        names.sort();
        names.dedup();
        names
    }

    fn parameters(&self, solver: &Solver<f32, N, B>, estimate: &Estimate<f32, B>) -> Vec<ParameterReport> {
        let record = solver.record();
        let prior = self.prior.as_ref().map(prior_parameters);
        // Without a prior, values that torque does not determine would be arbitrary.
        let completed = prior.and_then(|_| solver.parameters());
        let mut reports = Vec::with_capacity(N * PARAMETERS_PER_JOINT);
        for joint in 0..N {
            for parameter in Parameter::ALL {
                let status = status(&self.device, record, estimate, joint, parameter);
                let carriers: Vec<usize> = self.model.base.carriers(joint, parameter).collect();
                let alone =
                    matches!(status, Status::Identified | Status::Weak).then(|| carriers.first().copied());
                let base = alone.flatten().filter(|&base| estimate.determined[base]);
                reports.push(ParameterReport {
                    name: self.name(joint, parameter),
                    joint: joint + 1,
                    value: match (base, &completed) {
                        _ if self.is_zero(&record.selection.dropped, joint, parameter) => 0.0.into(),
                        (Some(base), _) => estimate.values[base].into(),
                        (None, Some(parameters)) => parameters[joint][parameter.index()].into(),
                        (None, None) => Number::UNKNOWN,
                    },
                    unit: parameter.unit(),
                    sigma: base.and_then(|base| estimate.sigma(base)).into(),
                    status: status.name(),
                    grouped_with: self.grouped_with(joint, parameter),
                    truth: self.truth.map(|truth| truth[joint][parameter.index()]).into(),
                    prior: prior.map(|prior| prior[joint][parameter.index()]).into(),
                });
            }
        }
        reports
    }
}

/// Evaluations between two updates of the search.
const SLICE: u32 = 20;

/// Course of the search, in chi-square units.
#[derive(Clone, Debug)]
pub struct Search {
    /// Iterations and excess over the constrained optimum.
    pub(crate) excess: Vec<(u32, f64)>,
    /// First iteration with an excess of at most 0.5.
    pub to_half: Option<u32>,
    /// Excess of that optimum over least squares.
    pub(crate) floor: f64,
}

/// Costs in chi-square units.
#[derive(Clone, Debug)]
pub struct Costs<const B: usize> {
    /// Cost of least squares (J_LS).
    pub least_squares: f64,
    /// Rise of the cost to the optimum in the box (J_C - J_LS).
    pub above: f64,
    /// Rise of the cost for any parameters (J(p) - J_LS).
    pub factor: Factor<f64, B>,
}

fn fits<const N: usize, const B: usize>(motions: &[Motion<N, B>], values: &[f32; B]) -> Vec<FitReport> {
    let mut reports = Vec::new();
    for motion in motions {
        for joint in 0..N {
            let error = motion.record.torque_error(joint, values).map(f64::from);
            let size = motion.record.torque[joint];
            let percent = |of: f32| Number::from(error.map(|error| 100.0 * error / f64::from(of)));
            let truth = motion.truth.map(|truth| truth[joint]);
            reports.push(FitReport {
                joint: joint + 1,
                motion: motion.name.clone(),
                rms_nm: error.into(),
                percent_of_mean_abs: percent(size.mean_absolute),
                percent_of_rms: percent(size.root_mean_square),
                percent_of_mean_abs_vs_truth: truth.map(|truth| truth.percent_of_mean_abs).into(),
                sticking_share: truth.map(|truth| truth.sticking_share).into(),
                disturbed_share: motion.record.outliers.disturbed_share[joint].into(),
                disturbed_longest_s: motion.record.outliers.longest_s[joint].into(),
                replaced: motion.record.outliers.replaced[joint],
            });
        }
    }
    reports
}
