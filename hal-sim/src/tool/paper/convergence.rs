//! How many iterations the beetle swarm needs on identification problems.
//!
//! Every run has a record of its own: one of several exciting motions, a noise of its own, the whole firmware up to the
//! moment at which the search would begin. Then the default swarm searches three sets of unknowns from a cold start, in
//! single precision as on the device: single parameters, base parameters, log-Cholesky coordinates.
//!
//! ```text
//! reached where   J / J_opt - 1 <= 1e-3,    J = J_LS + (J(p) - J_LS), chi-square units of the data alone
//! ```
//!
//! | row | unknowns | box | J_opt, in double precision |
//! | --- | --- | --- | --- |
//! | raw | every parameter that torque sees | what the prior allows each | active set over the single parameters |
//! | base | base parameters | sums of that | active set |
//! | log-Cholesky | 10 of every link, logarithms of IA, FC, FV, and OFF | section 7 of the identification | barriers of 1e-8 |
//!
//! `chain` and `leg` have links and friction, as the paper's equation (6); `whole` adds what a real drive has, a rotor and an
//! offset for each joint. `leg-28` is the whole leg in log-Cholesky coordinates.
//!
//! J and J_opt are computed in double precision whatever the swarm sees. Single parameters have flat directions: a
//! millionth of a chi-square unit for each range of the box makes their optimum unique and is not counted.
//!
//! Limits: 1e-3 of J_LS is some tenths of a chi-square unit at these durations and would be another number at others.

use rayon::prelude::*;
use scarab::ident::{
    Effort, Factor, FullObjective, FullSearch, LegCost, Limits, ParameterBox, Plan, Problem, Record,
    SearchState, Solver, least_squares_in_box,
};
use scarab::model::{LegParameters, PARAMETERS_PER_JOINT};
use scarab::motion::Periodic;
use scarab::swarm::{Bso, BsoSettings, Objective};
use scarab::units::Second;
use serde::Serialize;
use serde_json::Map;

use super::chain::{LEG, median, run_all};
use super::markdown::{Table, percent};
use super::raw_cost::RawCost;
use super::{PaperOptions, Section};
use crate::tool::consistent;
use crate::tool::error::ToolError;
use crate::tool::leg_file::{DEFAULT_LEG, LegFile, Switch};
use crate::tool::motions::{EXCITATION_CYCLES, most_informative};
use crate::tool::pair::{Context, Pair};
use crate::tool::report::Number;
use crate::tool::setup::SetupError;
use crate::tool::simulate::SimulationOptions;

/// Runs of each row unless asked for otherwise.
const RUNS: u64 = 100;
/// First seed of noise and swarm: far from all that anything was chosen with.
const FIRST_SEED: u64 = 7_000_001;
/// Exciting motions, each the best of some random ones.
const MOTIONS: u64 = 5;
const CANDIDATES: u64 = 40;
const MOTION_SEED: u64 = 3_000_000;
const PERIOD: Second = Second(10.0);
/// Reached where J is above J_opt by less than this share of it.
const SHARE: f64 = 1e-3;
/// No search takes longer.
const MOST_ITERATIONS: u32 = 400;
/// The longest exciting motion with its way there, s.
const LONGEST_RUN_S: f64 = 120.0;
/// Room for all parameters of three joints.
const DIMENSIONS: usize = 42;

/// One set of unknowns of one leg, over all runs.
#[derive(Clone, Debug, Serialize)]
pub struct ConvergenceRow {
    /// `chain-raw`, `leg-whole-base`, ...
    pub problem: String,
    /// Unknowns.
    pub dimension: usize,
    /// Runs.
    pub runs: u64,
    /// Reached, 0..1.
    pub success_rate: f64,
    /// Over all runs, failures as infinite; null where that is infinite.
    pub iterations_median: Number,
    /// Likewise.
    pub iterations_p95: Number,
    /// Likewise.
    pub evaluations_median: Number,
    /// What was set out to be reached in 95 % of the runs.
    pub goal_iterations_p95: u32,
}

/// All rows.
#[derive(Clone, Debug, Serialize)]
pub struct ConvergenceReport {
    /// Exciting motions.
    pub motions: u64,
    /// J / J_opt - 1.
    pub tolerance: f64,
    /// Of the swarm.
    pub precision: &'static str,
    /// Leg by leg.
    pub rows: Vec<ConvergenceRow>,
}

/// Runs everything and tells it.
pub fn section(options: &PaperOptions) -> Result<Section, ToolError> {
    let report = report(options.seeds.unwrap_or(RUNS))?;
    let mut json = Map::new();
    json.insert("convergence".into(), super::to_json(&report)?);
    Ok(Section { name: "convergence", markdown: words(&report), figures: Vec::new(), json })
}

/// The runs and what they say.
pub fn report(runs: u64) -> Result<ConvergenceReport, ToolError> {
    let (chain, leg) = (LegFile::load(LEG)?, LegFile::load(DEFAULT_LEG)?);
    let plain = [("raw", 75), ("base", 75), ("log-cholesky", 75)];
    let mut rows = leg_rows::<3, 28>(&links_and_friction(&chain), "chain", plain, runs)?;
    rows.extend(leg_rows::<2, 13>(&links_and_friction(&leg), "leg", plain, runs)?);
    let whole = [("whole-raw", 75), ("whole-base", 75), ("28", 125)];
    rows.extend(leg_rows::<2, 13>(&leg, "leg", whole, runs)?);
    let whole = [("whole-raw", 75), ("whole-base", 75), ("whole-log-cholesky", 75)];
    rows.extend(leg_rows::<3, 28>(&chain, "chain", whole, runs)?);
    Ok(ConvergenceReport { motions: MOTIONS, tolerance: SHARE, precision: "f32", rows })
}

/// Where a search got to.
#[derive(Clone, Copy, Debug, Default)]
struct Trial {
    dimension: usize,
    reached: Option<(u32, u32)>,
}

/// The leg without rotors and offsets, in the plant and in what is estimated: what the paper has.
fn links_and_friction(leg: &LegFile) -> LegFile {
    let mut leg = leg.clone();
    for joint in &mut leg.joints {
        (joint.rotor, joint.offset) = (Switch::Off, Switch::Off);
        for link in [&mut joint.truth, &mut joint.prior].into_iter().flatten() {
            (link.rotor_inertia, link.offset) = (0.0, 0.0);
        }
    }
    leg
}

/// Three sets of unknowns, each with its name and what 95 % of the runs are to reach.
fn leg_rows<const N: usize, const B: usize>(
    leg: &LegFile,
    name: &str,
    unknowns: [(&str, u32); 3],
    runs: u64,
) -> Result<Vec<ConvergenceRow>, ToolError> {
    let motions = motions::<N, B>(leg)?;
    let seeds: Vec<_> = (FIRST_SEED..FIRST_SEED + runs).collect();
    let trials = run_all(&format!("convergence, {name}"), &seeds, |&seed| {
        let motion = motions[(seed % MOTIONS) as usize];
        let (context, record) = recorded::<N, B>(leg, seed, motion)?;
        let bench = Bench::new(&context, record, seed)?;
        Ok([bench.raw(), bench.base(), bench.whole_legs()])
    })?;
    let row = |index: usize| {
        let all = || trials.iter().map(|trials| trials[index]);
        let infinite = |of: fn((u32, u32)) -> u32| -> Vec<f64> {
            all().map(|trial| trial.reached.map_or(f64::INFINITY, |reached| f64::from(of(reached)))).collect()
        };
        ConvergenceRow {
            problem: format!("{name}-{}", unknowns[index].0),
            dimension: all().map(|trial| trial.dimension).max().unwrap_or(0),
            runs,
            success_rate: all().filter(|trial| trial.reached.is_some()).count() as f64 / runs as f64,
            iterations_median: median(infinite(|(iterations, _)| iterations)).into(),
            iterations_p95: ninety_five(infinite(|(iterations, _)| iterations)).into(),
            evaluations_median: median(infinite(|(_, evaluations)| evaluations)).into(),
            goal_iterations_p95: unknowns[index].1,
        }
    };
    Ok((0..3).map(row).collect())
}

/// What 95 of 100 do not exceed.
fn ninety_five(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(((0.95 * values.len() as f64).ceil() as usize).saturating_sub(1)).copied()
}

fn motions<const N: usize, const B: usize>(leg: &LegFile) -> Result<Vec<Periodic<N>>, ToolError> {
    let context = Context::<N, B>::new(leg, &SimulationOptions::of_seed(FIRST_SEED))?;
    let limits = context.configuration.envelope();
    let best = |index: u64| {
        let seed = MOTION_SEED + 1000 * index;
        most_informative(&context.background.model, &limits, PERIOD, EXCITATION_CYCLES, seed, CANDIDATES)
            .ok_or_else(|| SetupError::new(leg, "no exciting motion fits the limits").into())
    };
    (0..MOTIONS).into_par_iter().map(best).collect()
}

/// The leg driven along a motion: what the search would begin with.
fn recorded<const N: usize, const B: usize>(
    leg: &LegFile,
    seed: u64,
    motion: Periodic<N>,
) -> Result<(Context<N, B>, Record<f32, N, B>), ToolError> {
    let mut context = Context::<N, B>::new(leg, &SimulationOptions::of_seed(seed))?;
    (context.motions.excitation, context.configuration.excitation) = (motion, motion);
    let mut pair = Pair::new(leg, &context, seed)?;
    pair.evaluations = 0;
    pair.enable(context.gravity);
    let record = pair
        .recorded(context.gravity, LONGEST_RUN_S)
        .ok_or_else(|| SetupError::new(leg, format!("seed {seed}: the exciting motion was not completed")))?;
    Ok((context, record))
}

/// One record with what its searches are measured by.
struct Bench<'a, const N: usize, const B: usize> {
    context: &'a Context<N, B>,
    solver: Box<Solver<f32, N, B>>,
    /// J(p) - J_LS in double precision.
    exact: Factor<f64, B>,
    least_squares: f64,
    seed: u64,
}

impl<'a, const N: usize, const B: usize> Bench<'a, N, B> {
    fn new(context: &'a Context<N, B>, record: Record<f32, N, B>, seed: u64) -> Result<Self, ToolError> {
        let prior = context.configuration.prior.as_ref();
        let model = &context.background.device;
        let solver = Box::new(Solver::new(model, record, Plan::OneTime, prior, seed));
        if prior.is_none() {
            return Err(ToolError::input(format!("{}: has no prior to search in", context.background.leg)));
        }
        let costs = context.background.costs(&solver);
        Ok(Self { context, solver, exact: costs.factor, least_squares: costs.least_squares, seed })
    }

    /// Whether base values are near enough to an optimum that lies `above` least squares.
    fn is_reached(&self, values: &[f32; B], above: f64) -> bool {
        let excess = self.exact.excess(&values.map(f64::from));
        excess - above <= SHARE * (self.least_squares + above)
    }

    /// The device's own search.
    fn base(&self) -> Trial {
        let above = self.context.background.costs(&self.solver).above;
        let model = &self.context.background.device;
        let mut solver = self.solver.clone();
        let mut trial = Trial { dimension: self.context.background.model.base.rank(), reached: None };
        let mut seen = 0;
        loop {
            let state = solver.advance(model, 1);
            let search = solver.search();
            let ended = state != SearchState::Running || solver.search().state() != SearchState::Running;
            if search.iterations() > seen || ended {
                seen = search.iterations();
                if self.is_reached(&search.values(), above) {
                    trial.reached = Some((seen, search.evaluations()));
                    return trial;
                }
            }
            if ended || seen >= MOST_ITERATIONS {
                return trial;
            }
        }
    }

    /// Every parameter that torque sees, each in its own range.
    fn raw(&self) -> Trial {
        let model = &self.context.background.device;
        let Some(prior) = self.context.configuration.prior.as_ref() else { return Trial::default() };
        let problem = Problem::new(self.solver.record(), model);
        let objective = RawCost::new(model, problem.whole(), prior);
        let above = self.raw_optimum(&objective);
        let trial = Trial { dimension: objective.dimension(), reached: None };
        let Ok(mut swarm) = Bso::<f32, 20, DIMENSIONS>::new(&objective, BsoSettings::default(), self.seed)
        else {
            return trial;
        };
        while swarm.iterations() < MOST_ITERATIONS {
            let before = swarm.iterations();
            while swarm.iterations() == before {
                if swarm.advance(&objective, 1) == 0 {
                    return trial;
                }
            }
            let values = swarm.best().map(|best| objective.base(best.position));
            if values.is_some_and(|values| self.is_reached(&values, above)) {
                return Trial { reached: Some((swarm.iterations(), swarm.evaluations())), ..trial };
            }
        }
        trial
    }

    /// J_opt - J_LS of the single parameters in their box.
    fn raw_optimum(&self, objective: &RawCost<'_, N, B>) -> f64 {
        const PULL: f64 = 1e-6;
        let base = &self.context.background.model.base;
        let mut factor = Factor::<f64, DIMENSIONS>::new();
        for (row, &right) in self.exact.triangle().iter().zip(self.exact.right()).take(base.rank()) {
            let mut raw = [0.0; DIMENSIONS];
            for (slot, &(joint, index)) in raw.iter_mut().zip(objective.places()) {
                let terms = (0..base.rank()).map(|base_index| base.terms(base_index)[joint][index]);
                *slot = row.iter().zip(terms).map(|(element, term)| element * term).sum();
            }
            factor.insert(&raw, right);
        }
        let mut bounds = ParameterBox { low: [0.0; DIMENSIONS], high: [0.0; DIMENSIONS] };
        for place in 0..objective.dimension() {
            let (low, high) = objective.bounds(place);
            (bounds.low[place], bounds.high[place]) = (f64::from(low), f64::from(high));
            let width = bounds.high[place] - bounds.low[place];
            let mut row = [0.0; DIMENSIONS];
            row[place] = PULL.sqrt() / width;
            factor.insert(&row, row[place] * 0.5 * (bounds.low[place] + bounds.high[place]));
        }
        let optimum = least_squares_in_box(&factor, objective.dimension(), &bounds);
        let mut parameters = [[0.0; PARAMETERS_PER_JOINT]; N];
        for (&(joint, index), &value) in objective.places().iter().zip(&optimum) {
            parameters[joint][index] = value;
        }
        self.exact.excess(&base.project(&parameters))
    }

    /// The swarm over log-Cholesky coordinates.
    fn whole_legs(&self) -> Trial {
        let background = &self.context.background;
        let (above, _) = consistent::optimum(background, &self.solver);
        let model = &background.device;
        let limits = Limits::new(model, self.solver.record(), self.context.configuration.prior.as_ref());
        let problem = Problem::new(self.solver.record(), model);
        let values = problem.least_squares(Plan::OneTime).values;
        let mut cost = LegCost::new(&limits);
        cost.fill(model, &problem.whole(), &values, Effort::device(true).pull);
        let objective = FullObjective::new(&limits, &cost);
        let trial = Trial { dimension: objective.dimension(), reached: None };
        let settings = BsoSettings::default();
        let Ok(mut search) = FullSearch::<f32, DIMENSIONS>::new(&objective, settings, self.seed) else {
            return trial;
        };
        loop {
            let before = search.iterations();
            let mut ended = false;
            while search.iterations() == before && !ended {
                ended = search.advance(&objective, 1);
            }
            let found: Option<LegParameters<f32, N>> = search.parameters(&objective);
            if found.is_some_and(|found| self.is_reached(&model.base.project(&found), above)) {
                return Trial { reached: Some((search.iterations(), search.evaluations())), ..trial };
            }
            if ended {
                return trial;
            }
        }
    }
}

fn words(report: &ConvergenceReport) -> String {
    let mut table = Table::new(&[
        "problem",
        "unknowns",
        "reached, % of runs",
        "iterations, median",
        "95 %",
        "goal",
        "evaluations, median",
    ]);
    let count = |value: Number| value.known().map_or("-".to_owned(), |value| format!("{value:.0}"));
    for row in &report.rows {
        table.row([
            row.problem.clone(),
            row.dimension.to_string(),
            percent(Some(100.0 * row.success_rate)),
            count(row.iterations_median),
            count(row.iterations_p95),
            row.goal_iterations_p95.to_string(),
            count(row.evaluations_median),
        ]);
    }
    let runs = report.rows.first().map_or(0, |row| row.runs);
    format!(
        "Default beetle swarm, cold start, {} precision, {runs} runs of each row over {} exciting motions, each with noise of \
         its own; iterations to J / J_opt - 1 <= {:.0e}, failures counted as endless.\n\n{table}",
        "single", report.motions, report.tolerance
    )
}
