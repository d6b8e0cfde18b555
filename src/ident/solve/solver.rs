//! One identification from a training record to a physically consistent leg: closed form, swarm, completion.
//!
//! The leg advances it in slices at the lowest priority; the host's replay of recordings runs the same value
//! to its end. The swarm searches the base values in the box that the prior allows. The completion turns them
//! into a physically consistent leg (`consistent`), whose base values are the result. The covariance
//! is that of the least-squares problem, whose optimum is the swarm's reference.

use core::mem::MaybeUninit;

use super::bounds::{LinkPrior, search_box};
use super::consistent::{Completion, Effort};
use super::constrained::ParameterBox;
use super::estimate::{Estimate, Plan, Problem, noise};
use super::scale::widen;
use super::search::{SearchState, SwarmSearch};
use super::selection;
use crate::ident::record::motion_record::Record;
use crate::ident::record::row_model::RowModel;
use crate::ident::record::row_model::no_stribeck;
use crate::ident::record::stretch::Stretches;
use crate::in_place::{fill, made};
use crate::model::friction::Stribeck;
use crate::model::{LegParameters, Parameter};
use crate::real::{self, Real};
use crate::swarm::BsoSettings;

/// Evaluations of the search that take as long as one step of the completion.
const EVALUATIONS_PER_STEP: u32 = 32;
/// Evaluations that take as long as one step of the selection.
const EVALUATIONS_PER_CHOICE: u32 = 12;

/// Loss of fit of the physically consistent leg against least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency<T> {
    /// Cost of the data alone above least squares, chi-square units, without the prior's pull.
    pub excess: T,
    /// Number of base parameters: the upper limit for chi-square, as if a constraint held every one of them.
    pub degrees_of_freedom: usize,
}

/// Least squares and swarm on one record. `judge::judgement` judges the result.
#[derive(Clone, Debug, PartialEq)]
pub struct Solver<T: Real, const N: usize, const B: usize> {
    record: Record<T, N, B>,
    plan: Plan,
    least_squares: Estimate<T, B>,
    condition: Option<T>,
    search: SwarmSearch<T, B>,
    bounds: ParameterBox<T, B>,
    completion: Completion<T, N>,
    /// Base values and cost of the completed leg, once available.
    completed: Option<([T; B], Consistency<T>)>,
    /// Values to judge instead of the result.
    given: Option<[T; B]>,
}

impl<T: Real, const N: usize, const B: usize> Solver<T, N, B> {
    /// Solves in closed form and prepares the swarm. Where columns may be dropped, [`Self::advance`] solves
    /// again after the selection.
    pub fn new(
        model: &RowModel<T, N, B>,
        record: Record<T, N, B>,
        plan: Plan,
        prior: Option<&[LinkPrior<T>; N]>,
        swarm_seed: u64,
    ) -> Self {
        made(|slot| Self::new_in(slot, model, record, plan, prior, swarm_seed))
    }

    /// Builds a solver in place, see [`Self::new`]: by value it would take a third of the device's stack.
    pub(crate) fn new_in<'a>(
        slot: &'a mut MaybeUninit<Self>,
        model: &RowModel<T, N, B>,
        mut record: Record<T, N, B>,
        plan: Plan,
        prior: Option<&[LinkPrior<T>; N]>,
        swarm_seed: u64,
    ) -> &'a mut Self {
        record.selection.is_made |= selection::candidates(model).next().is_none();
        let problem = Problem::new(&record, model);
        let whole = problem.whole();
        let least_squares = problem.least_squares(plan);
        let bounds = search_box(model, &record, prior);
        let condition = whole.condition();
        let completion = Completion::new(model, &record, prior, Effort::device(prior.is_some()));
        fill!(slot, {
            plan: plan,
            least_squares: least_squares,
            condition: condition,
            bounds: bounds,
            completion: completion,
            completed: None,
            given: None,
            record: record.clone(),
        }, {
            search: |search| SwarmSearch::new_in(
                search, &problem, plan, &bounds, BsoSettings::default(), swarm_seed,
            ),
        })
    }

    /// Searches with other settings; before the first [`Self::advance`].
    #[cfg(test)]
    pub(crate) fn with_settings(mut self, settings: BsoSettings<T>) -> Self {
        self.search.settings = settings;
        self
    }

    /// True when the selection of columns has ended, or no column may be dropped.
    pub fn is_selected(&self) -> bool {
        self.record.selection.is_made
    }

    /// Solves again without the columns that were dropped.
    #[inline(never)]
    fn restart(&mut self, model: &RowModel<T, N, B>) {
        self.completion.hold(model, &self.record.selection);
        let problem = Problem::new(&self.record, model);
        self.least_squares = problem.least_squares(self.plan);
        self.condition = problem.whole().condition();
        self.search.restart(&problem);
    }

    /// Spends up to `evaluations` of the cost: first on the selection of columns, then on the search, then on
    /// completion steps of equal cost. Any slicing gives the same result.
    #[inline(never)]
    pub fn advance(&mut self, model: &RowModel<T, N, B>, evaluations: u32) -> SearchState {
        let mut evaluations = evaluations;
        while !self.record.selection.is_made {
            if evaluations == 0 {
                return SearchState::Running;
            }
            evaluations = evaluations.saturating_sub(EVALUATIONS_PER_CHOICE);
            if selection::step(model, &mut self.record) && self.record.selection.dropped_count() > 0 {
                self.restart(model);
                return SearchState::Running;
            }
        }
        let problem = Problem::new(&self.record, model);
        let before = self.search.evaluations();
        let state = self.search.advance(&problem, evaluations);
        if state != SearchState::Done || self.completed.is_some() {
            return state;
        }
        if self.completion.is_waiting() {
            self.completion.start(model, &problem.whole(), &self.search.values(), &self.centre());
        }
        let mut left = evaluations.saturating_sub(self.search.evaluations().saturating_sub(before));
        while left > 0 && !self.completion.step() {
            left = left.saturating_sub(EVALUATIONS_PER_STEP);
        }
        if !self.completion.is_done() {
            return SearchState::Running;
        }
        self.close(model, &model.base.project(&self.completion.parameters()));
        state
    }

    /// Whether least squares lies in the box of the search.
    fn is_inside(&self) -> bool {
        let (low, high) = (&self.bounds.low, &self.bounds.high);
        let mut free =
            self.least_squares.values.iter().zip(low).zip(high).zip(&self.least_squares.determined);
        free.all(|(((value, low), high), determined)| !determined || (low..=high).contains(&value))
    }

    /// Base values from which the cost of constraints is counted: the swarm's, unless its box limits them.
    /// The box is wider than the allowed set, so its edges mean nothing; least squares itself then serves.
    fn centre(&self) -> [T; B] {
        if self.is_inside() { self.search.values() } else { self.least_squares.values }
    }

    /// Cost of the search's end above least squares, chi-square units; zero where the box keeps it away from
    /// least squares, whose values then count. `None` until the result is complete.
    pub(crate) fn search_excess(&self) -> Option<T> {
        self.completed.as_ref()?;
        Some(if self.is_inside() { self.search.excess() } else { T::zero() })
    }

    /// Takes a consistent leg that was found elsewhere, with its base values, as the result.
    pub fn replace(&mut self, model: &RowModel<T, N, B>, parameters: &LegParameters<T, N>, values: &[T; B]) {
        self.completion.replace(parameters);
        self.close(model, values);
    }

    #[inline(never)]
    fn close(&mut self, model: &RowModel<T, N, B>, projected: &[T; B]) {
        let mut values = self.search.values();
        for ((value, projected), &determined) in
            values.iter_mut().zip(projected).zip(&self.least_squares.determined)
        {
            if determined {
                *value = *projected;
            }
        }
        let whole = Problem::new(&self.record, model).whole();
        let cost = |values: &[T; B]| {
            let mut compact = [T::zero(); B];
            for (slot, &column) in compact.iter_mut().zip(whole.columns()) {
                *slot = values[column];
            }
            whole.factor().excess(&compact)
        };
        let excess = cost(&values) - cost(&self.least_squares.values);
        self.completed = Some((values, Consistency { excess, degrees_of_freedom: whole.columns().len() }));
    }

    /// Record of the motion identified from.
    pub fn record(&self) -> &Record<T, N, B> {
        &self.record
    }

    /// Plan: one-time or sequential.
    pub fn plan(&self) -> Plan {
        self.plan
    }

    /// Closed-form estimate.
    pub fn least_squares(&self) -> &Estimate<T, B> {
        &self.least_squares
    }

    /// Adds the effect of one more uncertain number to the covariance. `moved` is the closed form for that
    /// number one standard deviation larger.
    pub fn widen(&mut self, moved: &Estimate<T, B>) {
        widen(&mut self.least_squares, moved);
    }

    /// Swarm search.
    pub fn search(&self) -> &SwarmSearch<T, B> {
        &self.search
    }

    /// Search box of the swarm.
    pub fn bounds(&self) -> &ParameterBox<T, B> {
        &self.bounds
    }

    /// Condition number of the scaled weighted problem.
    pub fn condition(&self) -> Option<T> {
        self.condition
    }

    /// Judges these base values, for instance those of a stored model, in place of the result. Held-out
    /// motions are then tested against them.
    pub fn examine(&mut self, values: &[T; B]) {
        self.given = Some(*values);
    }

    /// Base values of the consistent leg; until it is complete, those of the swarm.
    pub fn found(&self) -> [T; B] {
        self.completed.as_ref().map_or_else(|| self.search.values(), |(values, _)| *values)
    }

    /// Base values to judge: the result, or those of [`Self::examine`].
    pub fn values(&self) -> [T; B] {
        self.given.unwrap_or_else(|| self.found())
    }

    /// Estimate to judge: [`Self::values`] with the covariance of the problem.
    pub fn estimate(&self) -> Estimate<T, B> {
        Estimate { values: self.values(), ..self.least_squares.clone() }
    }

    /// Stribeck friction of each joint for the judged base values, as a factor on its Coulomb friction.
    pub fn stribeck(&self, model: &RowModel<T, N, B>) -> [Stribeck<T>; N] {
        let values = self.values();
        let mut found = no_stribeck();
        for (joint, (slot, fit)) in found.iter_mut().zip(&self.record.stribeck).enumerate() {
            let coulomb = model.drive(joint, Parameter::FC).map_or(T::zero(), |base| values[base]);
            // Without Coulomb friction the factor is undefined; the verdict calls that unphysical.
            if let Some(fit) = fit
                && coulomb > T::zero()
            {
                let excess = real::max(fit.surplus(&values) / coulomb, T::zero());
                *slot = Stribeck { excess, velocity: fit.speed };
            }
        }
        found
    }

    /// Completion from base values to a physically consistent leg.
    pub fn completion(&self) -> &Completion<T, N> {
        &self.completion
    }

    /// All parameters of the consistent leg; `None` until search and completion have ended.
    pub fn parameters(&self) -> Option<LegParameters<T, N>> {
        self.completed.is_some().then(|| self.completion.parameters())
    }

    /// Loss of fit of the consistent leg against the plan's least squares, over all rows;
    /// `None` until it is complete.
    pub fn consistency(&self) -> Option<Consistency<T>> {
        self.completed.as_ref().map(|(_, consistency)| *consistency)
    }

    /// Shortens the disturbed stretches of the motion identified from, counted in whole blocks, to what a
    /// second pass over its rows found.
    pub fn time_disturbances(&mut self, stretches: &Stretches<T, N, B>) {
        let outliers = &mut self.record.outliers;
        for (longest, &found) in outliers.longest_s.iter_mut().zip(&stretches.longest_s) {
            *longest = real::min(*longest, found);
        }
        outliers.longest_common_s = real::min(outliers.longest_common_s, stretches.longest_common_s);
    }

    /// Limit of a row's torque error by noise, N m: six standard deviations plus a twentieth of the torque.
    pub fn unexpected(&self) -> [T; N] {
        let values = self.found();
        core::array::from_fn(|joint| {
            let size = self.record.torque[joint].root_mean_square;
            let error = self.record.torque_error(joint, &values).unwrap_or(size);
            T::from_double(6.0) * error + T::from_double(0.05) * size
        })
    }

    /// Standard deviation of one independent row of each joint in the motion identified from, N m.
    pub fn row_noise(&self) -> [T; N] {
        noise(&self.record)
    }
}
