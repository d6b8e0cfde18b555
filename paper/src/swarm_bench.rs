//! Compares the default swarm with the optimum on one record, for several sets of unknowns.
//!
//! The swarm uses the device's cost in single precision; its result is evaluated in double precision. See
//! [`super::convergence`] for the unknowns and the definition of reached.

use scarab::ident::{
    DECIMATION, Effort, Factor, FullObjective, FullSearch, LegCost, Limits, ParameterBox, Plan, Problem,
    Record, SearchState, Solver, least_squares_in_box,
};
use scarab::model::{LegParameters, PARAMETERS_PER_JOINT};
use scarab::swarm::{Bso, BsoSettings, Objective, Pso, PsoSettings, Search, SwarmError};
use scarab_base::error::ToolError;
use scarab_base::words::exact;
use scarab_identify::run::consistent;
use scarab_rig::pair::Context;
use serde::{Deserialize, Serialize};

use super::raw_cost::RawCost;
use super::seen_links::SeenLinks;

/// A search has reached the optimum if J exceeds J_opt by less than this share of it.
pub const SHARE: f64 = 1e-3;
/// Limit of a search: 400 iterations of the default swarm with 20 unknowns or more.
const MOST_EVALUATIONS: u32 = 24_000;
/// Capacity for all parameters of three joints.
const DIMENSIONS: usize = 42;

type Beetles = Bso<f32, 20, DIMENSIONS>;

/// Result of a search.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Number of unknowns.
    pub dimension: usize,
    /// Iterations and evaluations until reached, by the cost over the filtered rows and over the
    /// logged samples.
    pub reached: [Option<(u32, u32)>; 2],
    /// Least J - J_opt, chi-square units.
    #[serde(with = "exact")]
    pub lowest: f64,
}

impl Trial {
    fn new(dimension: usize) -> Self {
        Self { dimension, reached: [None; 2], lowest: f64::INFINITY }
    }
}

/// One record with the reference for its searches.
pub struct Bench<'a, const N: usize, const B: usize> {
    context: &'a Context<N, B>,
    solver: Box<Solver<f32, N, B>>,
    /// J(p) - J_LS in double precision.
    exact: Factor<f64, B>,
    /// J_LS over the filtered rows.
    least_squares: f64,
    /// J_LS over the logged samples: their number.
    samples: f64,
    seed: u64,
}

impl<'a, const N: usize, const B: usize> Bench<'a, N, B> {
    /// Prepares the record for searches.
    pub fn new(context: &'a Context<N, B>, record: Record<f32, N, B>, seed: u64) -> Result<Self, ToolError> {
        let prior = context.configuration.prior.as_ref();
        let model = &context.background.device;
        let solver = Box::new(Solver::new(model, record, Plan::OneTime, prior, seed));
        if prior.is_none() {
            return Err(ToolError::input(format!("{}: has no prior to search in", context.background.leg)));
        }
        let costs = context.background.costs(&solver);
        let samples = solver.record().rows.iter().map(|&rows| f64::from(rows) * DECIMATION as f64).sum();
        Ok(Self { context, solver, exact: costs.factor, least_squares: costs.least_squares, samples, seed })
    }

    /// Records base values found after the effort `spent`; the optimum is `above` least squares.
    /// Returns whether both goals are met.
    fn note(&self, trial: &mut Trial, values: &[f32; B], above: f64, spent: (u32, u32)) -> bool {
        let excess = self.exact.excess(&values.map(f64::from)) - above;
        trial.lowest = trial.lowest.min(excess);
        for (reached, floor) in trial.reached.iter_mut().zip([self.least_squares, self.samples]) {
            if excess <= SHARE * (floor + above) {
                *reached = reached.or(Some(spent));
            }
        }
        trial.reached.iter().all(Option::is_some)
    }

    /// Runs the device's own search.
    pub fn base(&self) -> Trial {
        let above = self.context.background.costs(&self.solver).above;
        let model = &self.context.background.device;
        let mut solver = self.solver.clone();
        let mut trial = Trial::new(self.context.background.model.base.rank());
        let mut seen = 0;
        loop {
            let state = solver.advance(model, 1);
            let search = solver.search();
            let ended = state != SearchState::Running || solver.search().state() != SearchState::Running;
            if search.iterations() > seen || ended {
                seen = search.iterations();
                if self.note(&mut trial, &search.values(), above, (seen, search.evaluations())) {
                    return trial;
                }
            }
            if ended || search.evaluations() >= MOST_EVALUATIONS {
                return trial;
            }
        }
    }

    /// Searches every parameter with an effect on torque, each in its own range: by the default swarm, by
    /// the paper's rules with (29) corrected, and by a particle swarm, which (29) is as printed.
    pub fn raw(&self) -> [Trial; 3] {
        let model = &self.context.background.device;
        let Some(prior) = self.context.configuration.prior.as_ref() else { return [Trial::new(0); 3] };
        let problem = Problem::new(self.solver.record(), model);
        let objective = RawCost::new(model, problem.whole(), prior);
        let above = self.raw_optimum(&objective);
        let values = |position: &[f32]| objective.base(position);
        let beetles = |settings| {
            self.searched(&objective, above, values, Beetles::new(&objective, settings, self.seed))
        };
        let particles = Pso::<f32, 20, DIMENSIONS>::new(&objective, PsoSettings::default(), self.seed);
        [
            beetles(BsoSettings::default()),
            beetles(BsoSettings::paper()),
            self.searched(&objective, above, values, particles),
        ]
    }

    /// Runs a search alone until the base values of its best reach the optimum.
    fn searched(
        &self,
        objective: &impl Objective<f32>,
        above: f64,
        values: impl Fn(&[f32]) -> [f32; B],
        swarm: Result<impl Search<f32>, SwarmError>,
    ) -> Trial {
        let mut trial = Trial::new(objective.dimension());
        let Ok(mut swarm) = swarm else { return trial };
        while swarm.evaluations() < MOST_EVALUATIONS {
            let before = swarm.iterations();
            while swarm.iterations() == before {
                if swarm.advance(objective, 1) == 0 {
                    return trial;
                }
            }
            let spent = (swarm.iterations(), swarm.evaluations());
            let values = swarm.best().map(|best| values(best.position));
            if values.is_some_and(|values| self.note(&mut trial, &values, above, spent)) {
                break;
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
            for (slot, &(joint, index)) in raw.iter_mut().zip(objective.coordinates()) {
                let terms = (0..base.rank()).map(|base_index| base.terms(base_index)[joint][index]);
                *slot = row.iter().zip(terms).map(|(element, term)| element * term).sum();
            }
            factor.insert(&raw, right);
        }
        let mut bounds = ParameterBox { low: [0.0; DIMENSIONS], high: [0.0; DIMENSIONS] };
        for coordinate in 0..objective.dimension() {
            let (low, high) = objective.bounds(coordinate);
            (bounds.low[coordinate], bounds.high[coordinate]) = (f64::from(low), f64::from(high));
            let width = bounds.high[coordinate] - bounds.low[coordinate];
            let mut row = [0.0; DIMENSIONS];
            row[coordinate] = PULL.sqrt() / width;
            factor.insert(&row, row[coordinate] * 0.5 * (bounds.low[coordinate] + bounds.high[coordinate]));
        }
        let optimum = least_squares_in_box(&factor, objective.dimension(), &bounds);
        let mut parameters = [[0.0; PARAMETERS_PER_JOINT]; N];
        for (&(joint, index), &value) in objective.coordinates().iter().zip(&optimum) {
            parameters[joint][index] = value;
        }
        self.exact.excess(&base.project(&parameters))
    }

    /// Searches log-Cholesky coordinates: all, and without those of links that affect torque by one number.
    pub fn whole_legs(&self) -> (Trial, Option<Trial>) {
        let background = &self.context.background;
        let (above, _) = consistent::optimum(background, &self.solver);
        let model = &background.device;
        let limits = Limits::new(model, self.solver.record(), self.context.configuration.prior.as_ref());
        let problem = Problem::new(self.solver.record(), model);
        let values = problem.least_squares(Plan::OneTime).values;
        let mut cost = LegCost::new(&limits);
        cost.fill(model, &problem.whole(), &values, Effort::device(true).pull);
        let objective = FullObjective::new(&limits, &cost);
        let seen = SeenLinks::new(&objective, &background.model.base).map(|seen| {
            let swarm = Beetles::new(&seen, BsoSettings::default(), self.seed);
            self.searched(&seen, above, |position| model.base.project(&seen.parameters(position)), swarm)
        });
        (self.whole_leg(&objective, above), seen)
    }

    fn whole_leg(&self, objective: &FullObjective<'_, f32, N>, above: f64) -> Trial {
        let model = &self.context.background.device;
        let mut trial = Trial::new(objective.dimension());
        let settings = BsoSettings::default();
        let Ok(mut search) = FullSearch::<f32, DIMENSIONS>::new(objective, settings, self.seed) else {
            return trial;
        };
        loop {
            let before = search.iterations();
            let mut ended = false;
            while search.iterations() == before && !ended {
                ended = search.advance(objective, 1);
            }
            let found: Option<LegParameters<f32, N>> = search.parameters(objective);
            let spent = (search.iterations(), search.evaluations());
            let all =
                found.is_some_and(|found| self.note(&mut trial, &model.base.project(&found), above, spent));
            if all || ended {
                return trial;
            }
        }
    }
}
