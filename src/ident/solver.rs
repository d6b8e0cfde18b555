//! One identification from a training record to a verdict: closed form, swarm, judgement.
//!
//! The leg advances it in slices at the lowest priority; the host's replay of recordings runs the same value to
//! its end. The result is the swarm's, in the box the prior allows; the covariance is that of the least-squares
//! problem, whose optimum the swarm is measured against.

use super::bounds::{LinkPrior, search_box};
use super::constrained::ParameterBox;
use super::estimate::{Estimate, Plan, Problem};
use super::record::{Record, RowModel};
use super::scale::widen;
use super::search::{SearchState, SwarmSearch};
use super::verdict::{Thresholds, Verdict};
use crate::real::Real;
use crate::swarm::BsoSettings;

/// Least squares and swarm on one record.
#[derive(Clone, Debug, PartialEq)]
pub struct Solver<T: Real, const N: usize, const B: usize> {
    record: Record<T, N, B>,
    plan: Plan,
    least_squares: Estimate<T, B>,
    condition: Option<T>,
    before_search: Verdict,
    search: SwarmSearch<T, B>,
    bounds: ParameterBox<T, B>,
}

impl<T: Real, const N: usize, const B: usize> Solver<T, N, B> {
    /// Solves in closed form and puts the swarm at its start.
    #[must_use]
    pub fn new(
        model: &RowModel<T, N, B>,
        record: Record<T, N, B>,
        plan: Plan,
        prior: Option<&[LinkPrior<T>; N]>,
        swarm_seed: u64,
        thresholds: &Thresholds<T>,
    ) -> Self {
        let problem = Problem::new(&record, model);
        let whole = problem.whole();
        let least_squares = problem.least_squares(plan);
        let bounds = search_box(model, &record, prior);
        let search = SwarmSearch::new(&problem, plan, bounds, BsoSettings::default(), swarm_seed);
        let before_search = {
            let rank = least_squares.rank();
            thresholds.judge_input(model, &record).and(thresholds.judge_excitation(model, &whole, rank))
        };
        let condition = whole.condition();
        Self { record, plan, least_squares, condition, before_search, search, bounds }
    }

    /// Spends up to `evaluations` of the cost on the search; any slicing gives the same result.
    pub fn advance(&mut self, model: &RowModel<T, N, B>, evaluations: u32) -> SearchState {
        let problem = Problem::new(&self.record, model);
        self.search.advance(&problem, evaluations)
    }

    /// The motion identified from.
    #[must_use]
    pub fn record(&self) -> &Record<T, N, B> {
        &self.record
    }

    /// One-time or sequential.
    #[must_use]
    pub fn plan(&self) -> Plan {
        self.plan
    }

    /// The closed form.
    #[must_use]
    pub fn least_squares(&self) -> &Estimate<T, B> {
        &self.least_squares
    }

    /// Adds to the covariance what one more uncertain number does to the result: `moved` is the closed form with that number
    /// one standard deviation larger.
    pub fn widen(&mut self, moved: &Estimate<T, B>) {
        widen(&mut self.least_squares, moved);
    }

    /// The swarm.
    #[must_use]
    pub fn search(&self) -> &SwarmSearch<T, B> {
        &self.search
    }

    /// Where the swarm searches.
    #[must_use]
    pub fn bounds(&self) -> &ParameterBox<T, B> {
        &self.bounds
    }

    /// Condition number of the scaled weighted problem.
    #[must_use]
    pub fn condition(&self) -> Option<T> {
        self.condition
    }

    /// The swarm's base parameters with the covariance of the problem.
    #[must_use]
    pub fn estimate(&self) -> Estimate<T, B> {
        Estimate { values: self.search.values(), ..self.least_squares.clone() }
    }

    /// Cost of the result above that of the plan's least squares, chi-square units of all rows together.
    fn excess(&self, model: &RowModel<T, N, B>) -> T {
        let whole = Problem::new(&self.record, model).whole();
        let cost = |values: &[T; B]| {
            let mut compact = [T::zero(); B];
            for (slot, &column) in compact.iter_mut().zip(whole.columns()) {
                *slot = values[column];
            }
            whole.factor().excess(&compact)
        };
        cost(&self.search.values()) - cost(&self.least_squares.values)
    }

    /// Accepted, or refused with all reasons that apply, given records of motions that were not used.
    #[must_use]
    pub fn judge<'a>(
        &self,
        model: &RowModel<T, N, B>,
        thresholds: &Thresholds<T>,
        unused: impl Iterator<Item = &'a Record<T, N, B>>,
    ) -> Verdict {
        let estimate = self.estimate();
        let input = match self.search.state() {
            SearchState::Done => Verdict::ACCEPTED,
            SearchState::Running | SearchState::Failed(_) => Verdict::refused(super::Reason::Input),
        };
        self.before_search
            .and(input)
            .and(thresholds.judge_physics(model, &self.record, &self.least_squares))
            .and(thresholds.judge_physics(model, &self.record, &estimate))
            .and(thresholds.judge_box(self.excess(model), model.base.rank()))
            .and(thresholds.judge_residual(&self.record, &estimate.values))
            .and(thresholds.judge_validation(&self.record, unused, &estimate.values))
    }
}
