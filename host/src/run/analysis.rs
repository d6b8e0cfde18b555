//! Builds the report of a run from a solver and its records.

use std::collections::BTreeMap;
use std::time::Duration;

use scarab::ident::{
    Choice, Estimate, Estimator, Factor, Problem, Record, SearchState, Solver, Status, Verdict,
    least_squares_in_box, prior_parameters, status,
};
use scarab::model::{PARAMETERS_PER_JOINT, Parameter, Standing};

use crate::base::names::{estimator_name, parameter_name, plan_name, surplus_name};
use crate::base::number::Number;
use crate::base::precision::plain;
use crate::leg::background::Background;
use crate::report::disturbances::{OutliersReport, StribeckReport};
use crate::report::findings::FindingReport;
use crate::report::scale::ScaleReport;
use crate::report::{
    BaseReport, ConsistentReport, FitReport, LeastSquaresReport, ParameterReport, RunReport, SCHEMA,
    SwarmReport, TrackingReport,
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

impl<const N: usize, const B: usize> Background<N, B> {
    /// Name of a base parameter: its carrier, with an `R` if others are regrouped into it.
    #[must_use]
    pub fn base_name(&self, base: usize) -> String {
        let Some((joint, parameter)) = self.model.base.independent(base) else { return String::new() };
        let others = self.terms(base).count() > 1;
        format!("{}{}", self.name(joint, parameter), if others { "R" } else { "" })
    }

    /// Sets the estimator. Plain least squares disables every choice left to the data.
    pub fn use_estimator(&mut self, estimator: Estimator) {
        let unasked = |choice: &mut Choice| {
            if *choice == Choice::Auto && estimator == Estimator::Plain {
                *choice = Choice::Off;
            }
        };
        self.model.stribeck_choice.iter_mut().for_each(unasked);
        self.device.stribeck_choice.iter_mut().for_each(unasked);
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

    /// Whether the parameter is not estimated and thus zero in the model; `dropped` are base
    /// parameters held at zero.
    pub fn is_zero(&self, dropped: &[bool; B], joint: usize, parameter: Parameter) -> bool {
        self.model.base.standing(joint, parameter) == Standing::Off
            || self.device.drive(joint, parameter).is_some_and(|base| dropped[base])
    }

    fn unit(&self, base: usize) -> &'static str {
        self.model.base.independent(base).map_or("", |(_, parameter)| parameter.unit())
    }

    /// Constrained optimum of the swarm and both costs, in double precision and chi-square units.
    #[must_use]
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

    /// Builds the report of a run.
    #[must_use]
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
        let dropped = &solver.record().selection.dropped;
        let stribeck = self.stribeck(solver, &estimate.values);
        let consistent = consistent::compare(self, solver, circumstances.iterations_to_half_chi2);
        RunReport {
            schema: SCHEMA,
            leg: self.leg.clone(),
            seed: circumstances.seed,
            swarm_seed: solver.search().seed(),
            prior: self.prior_name.clone(),
            plan: plan_name(solver.plan()),
            verdict: if verdict.is_accepted() { "accepted" } else { "refused" },
            validated: !validation.is_empty(),
            reasons: verdict.reasons().map(scarab::ident::Reason::name).collect(),
            findings: self.in_context(&circumstances.findings, &consistent),
            rank: solver.least_squares().rank(),
            columns: self.columns - solver.record().selection.dropped_count(),
            condition: solver.condition().into(),
            parameters: self.parameters(solver, &estimate),
            base_parameters: self
                .base_parameters(dropped, &estimate, circumstances.cramer_rao.as_ref())
                .into_iter()
                .chain(self.surpluses(&stribeck, &circumstances.surplus_cramer_rao))
                .collect(),
            stribeck,
            model_choice: self.model_choice(
                &solver.record().selection,
                &core::array::from_fn(|joint| {
                    let record = solver.record();
                    (record.stribeck[joint].is_some(), record.torque[joint].root_mean_square)
                }),
            ),
            asymmetric_coulomb: self.directions(dropped, &estimate),
            temperature_c: self.temperature_c.into(),
            outliers: OutliersReport::of(solver.record(), estimator_name(circumstances.estimator)),
            training: fits(training, &estimate.values),
            validation: fits(validation, &estimate.values),
            least_squares: LeastSquaresReport {
                base_parameters: self
                    .kept(dropped)
                    .map(|base| (self.base_name(base), solver.least_squares().values[base].into()))
                    .chain(
                        self.stribeck(solver, &solver.least_squares().values)
                            .into_iter()
                            .map(|found| (surplus_name(found.joint - 1), found.surplus_nm)),
                    )
                    .collect(),
                cost: costs.least_squares.into(),
            },
            bso: SwarmReport {
                seed: solver.search().seed(),
                iterations: solver.search().iterations(),
                evaluations: solver.search().evaluations(),
                cost_over_least_squares: searched.then_some(cost / costs.least_squares).into(),
                excess_chi2: searched.then_some(cost - costs.above).into(),
                iterations_to_half_chi2: circumstances.iterations_to_half_chi2.filter(|_| searched),
            },
            consistent,
            tracking: circumstances.tracking.clone(),
            scale: ScaleReport::default(),
            drive: circumstances.drive,
            simulated_s: circumstances.simulated_s,
            wall_s: circumstances.wall.as_secs_f64(),
            detail: self.detail(dropped, &estimate),
            doubt: None,
            samples: None,
            compared: None,
            trace: None,
        }
    }

    /// Findings whose words count what the verdict does not know: whether there is a prior, and whether the
    /// search for a possible leg has arrived.
    fn in_context(&self, findings: &[FindingReport], consistent: &ConsistentReport) -> Vec<FindingReport> {
        let mut findings = findings.to_vec();
        for finding in findings.iter_mut().filter(|finding| !finding.passed && finding.test == "prior_box") {
            if consistent.base.settled == Some(false) {
                finding.words = format!(
                    "the search for a possible leg has not arrived: it ended {} chi-square units above the best one",
                    plain(consistent.base.excess_chi2)
                );
            } else if self.prior.is_none() {
                finding.words = finding.words.replace("leg that the prior allows", "possible leg");
            }
        }
        findings
    }

    fn stribeck(&self, solver: &Solver<f32, N, B>, values: &[f32; B]) -> Vec<StribeckReport> {
        let found = solver.record().stribeck.iter().enumerate();
        found.filter_map(|(joint, fit)| Some(StribeckReport::of(joint, fit.as_ref()?, values))).collect()
    }

    /// Static friction above Coulomb friction, for joints with a true or identified surplus.
    pub fn surpluses(&self, found: &[StribeckReport], cramer_rao: &[Option<f64>]) -> Vec<BaseReport> {
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
    pub fn kept<'a>(&self, dropped: &'a [bool; B]) -> impl Iterator<Item = usize> + 'a {
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
    #[must_use]
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

/// Costs in chi-square units.
#[derive(Clone, Debug)]
pub struct Costs<const B: usize> {
    /// J_LS.
    pub least_squares: f64,
    /// J_C - J_LS.
    pub above: f64,
    /// J(p) - J_LS for any parameters.
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
