//! Beetle swarm on the identification cost: a plan's stages searched one after the other, in slices.
//!
//! On this quadratic cost least squares is exact and instant. The search runs on the same factor, in the
//! prior's box, from a cold start, and is reported beside it. Cost of one evaluation: `B^2 / 2`
//! multiplications.

use core::mem::MaybeUninit;

use super::constrained::ParameterBox;
use super::estimate::{Plan, Problem, Stage};
use crate::in_place::{Slot, empty_slot, fill};
use crate::real::{self, Real};
use crate::swarm::{Bso, BsoSettings, Objective, Search, SwarmError};

/// Beetles in the swarm (paper, 4.1).
pub(crate) const BEETLES: usize = 20;
/// Most iterations of a stage.
pub(crate) const LARGEST_ITERATIONS: u32 = 300;
/// A stage ends when the best cost fell by less than [`SMALLEST_GAIN`] in this many iterations.
pub(super) const PATIENCE: u32 = 15;
/// Iterations in place of [`PATIENCE`] above [`LARGEST_EXCESS`]: the verdict would refuse the result, unless
/// least squares lies outside the box.
const LONG_PATIENCE: u32 = 45;
/// Largest cost above least squares at which a search may end, chi-square units: half a standard deviation of
/// one parameter.
pub(crate) const LARGEST_EXCESS: f64 = 0.25;
/// Smallest progress in chi-square units; a tenth of a standard deviation of one parameter is 0.01.
const SMALLEST_GAIN: f64 = 1e-3;

/// Rule that ends a search without progress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Patience<T> {
    value: T,
    iteration: u32,
}

impl<T: Real> Patience<T> {
    /// Patience before the first iteration.
    pub(crate) const NEW: Self = Self { value: T::LARGEST, iteration: 0 };

    /// Whether a search ends with this best cost after these iterations; `patience`: iterations without
    /// progress.
    pub(crate) fn ends(&mut self, value: T, iterations: u32, patience: u32) -> bool {
        if value < self.value - T::from_double(SMALLEST_GAIN) {
            *self = Self { value, iteration: iterations };
        }
        iterations >= LARGEST_ITERATIONS || iterations >= self.iteration + patience
    }
}

/// Cost of one stage in its box.
struct StageCost<'a, T, const B: usize> {
    stage: &'a Stage<T, B>,
    bounds: &'a ParameterBox<T, B>,
}

impl<T: Real, const B: usize> Objective<T> for StageCost<'_, T, B> {
    fn dimension(&self) -> usize {
        self.stage.columns().len()
    }
    fn bounds(&self, coordinate: usize) -> (T, T) {
        let base = self.stage.columns().get(coordinate).copied().unwrap_or(0);
        (self.bounds.low[base], self.bounds.high[base])
    }
    fn evaluate(&self, position: &[T]) -> T {
        self.stage.factor().excess(position)
    }
}

/// Progress of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchState {
    /// More evaluations are needed.
    Running,
    /// All stages have ended.
    Done,
    /// The cost or its box is invalid for a search.
    Failed(SwarmError),
}

/// A search over all stages of a plan; plain data, divided into slices by the budget of [`Self::advance`].
#[derive(Clone, Debug, PartialEq)]
pub struct SwarmSearch<T: Real, const B: usize> {
    plan: Plan,
    pub(super) settings: BsoSettings<T>,
    seed: u64,
    bounds: ParameterBox<T, B>,
    stage: Stage<T, B>,
    stage_index: usize,
    swarm: Slot<Bso<T, BEETLES, B>>,
    state: SearchState,
    values: [T; B],
    determined: [bool; B],
    iterations: u32,
    evaluations: u32,
    excess: T,
    patience: Patience<T>,
}

impl<T: Real, const B: usize> SwarmSearch<T, B> {
    /// Builds a cold search in place. The first [`Self::advance`] scatters the
    /// beetles uniformly over the box.
    pub(crate) fn new_in<'a, const N: usize>(
        slot: &'a mut MaybeUninit<Self>,
        problem: &Problem<'_, T, N, B>,
        plan: Plan,
        bounds: &ParameterBox<T, B>,
        settings: BsoSettings<T>,
        seed: u64,
    ) -> &'a mut Self {
        let (values, determined) = ([T::zero(); B], [false; B]);
        let stage = problem.stage(plan, 0, &values, &determined);
        fill!(slot, {
            plan: plan,
            settings: settings,
            seed: seed,
            bounds: *bounds,
            stage: stage,
            stage_index: 0,
            state: SearchState::Running,
            values: values,
            determined: determined,
            iterations: 0,
            evaluations: 0,
            excess: T::zero(),
            patience: Patience::NEW,
        }, { swarm: empty_slot })
    }

    /// Restarts cold, with the columns that remain.
    pub(crate) fn restart<const N: usize>(&mut self, problem: &Problem<'_, T, N, B>) {
        (self.values, self.determined) = ([T::zero(); B], [false; B]);
        self.stage = problem.stage(self.plan, 0, &self.values, &self.determined);
        self.swarm.clear();
        (self.stage_index, self.state) = (0, SearchState::Running);
        (self.iterations, self.evaluations, self.excess) = (0, 0, T::zero());
        self.patience = Patience::NEW;
    }

    /// Starts the first stage with open columns. The swarm is large, so it is
    /// built in its slot, not by `new`.
    #[inline(never)]
    fn start<const N: usize>(&mut self, problem: &Problem<'_, T, N, B>) {
        if self.stage.columns().is_empty() {
            self.next_stage(problem);
        } else {
            self.start_stage();
        }
    }

    #[inline(never)]
    fn start_stage(&mut self) {
        let cost = StageCost { stage: &self.stage, bounds: &self.bounds };
        // Each stage has its own random numbers.
        let seed = self.seed.wrapping_add(self.stage_index as u64);
        match Bso::new(&cost, self.settings, seed) {
            Ok(swarm) => self.swarm.fill(|slot| slot.write(swarm)),
            Err(error) => self.state = SearchState::Failed(error),
        }
        self.patience = Patience::NEW;
    }

    /// Spends up to `evaluations`; any slicing gives the same result.
    pub fn advance<const N: usize>(
        &mut self,
        problem: &Problem<'_, T, N, B>,
        evaluations: u32,
    ) -> SearchState {
        if self.swarm.is_empty() && self.state == SearchState::Running && evaluations > 0 {
            self.start(problem);
        }
        // One at a time: the rule that ends a stage needs whole iterations, wherever a slice ends.
        for _ in 0..evaluations {
            let (Some(swarm), SearchState::Running) = (self.swarm.as_mut(), self.state) else { break };
            let cost = StageCost { stage: &self.stage, bounds: &self.bounds };
            let before = swarm.iterations();
            if swarm.advance(&cost, 1) == 0 {
                self.state = SearchState::Failed(SwarmError::NoDimension);
                break;
            }
            self.evaluations = self.evaluations.saturating_add(1);
            let iterations = swarm.iterations();
            if iterations > before {
                self.iterations = self.iterations.saturating_add(1);
                let value = swarm.best().map_or(T::LARGEST, |best| best.value);
                let is_far = value > T::from_double(LARGEST_EXCESS);
                if self.patience.ends(value, iterations, if is_far { LONG_PATIENCE } else { PATIENCE }) {
                    self.close_stage(problem);
                }
            }
        }
        self.state
    }

    fn close_stage<const N: usize>(&mut self, problem: &Problem<'_, T, N, B>) {
        if let Some(best) = self.swarm.as_ref().and_then(Search::best) {
            for (&column, &value) in self.stage.columns().iter().zip(best.position) {
                self.values[column] = value;
                self.determined[column] = true;
            }
            self.excess = real::max(self.excess, best.value);
        }
        self.next_stage(problem);
    }

    /// Starts the next stage with open columns, or ends the search.
    fn next_stage<const N: usize>(&mut self, problem: &Problem<'_, T, N, B>) {
        self.swarm.clear();
        // A stage without determined columns has nothing to search.
        while self.swarm.is_empty() && self.state == SearchState::Running {
            self.stage_index += 1;
            if self.stage_index >= Problem::<T, N, B>::stages(self.plan) {
                self.state = SearchState::Done;
                return;
            }
            self.stage = problem.stage(self.plan, self.stage_index, &self.values, &self.determined);
            if !self.stage.columns().is_empty() {
                self.start_stage();
            }
        }
    }

    /// Current state of the search.
    pub fn state(&self) -> SearchState {
        self.state
    }

    /// Cost of the current stage's best above that stage's least-squares optimum, chi-square units.
    pub fn stage_excess(&self) -> Option<T> {
        self.swarm.as_ref().and_then(Search::best).map(|best| best.value)
    }

    /// Largest cost at which a stage ended above its least-squares optimum, chi-square units.
    pub(crate) fn excess(&self) -> T {
        self.excess
    }

    /// Base parameters found so far: closed stages, and the best of the open one.
    pub fn values(&self) -> [T; B] {
        let mut values = self.values;
        if let Some(best) = self.swarm.as_ref().and_then(Search::best) {
            for (&column, &value) in self.stage.columns().iter().zip(best.position) {
                values[column] = value;
            }
        }
        values
    }

    /// Iterations of all stages.
    pub fn iterations(&self) -> u32 {
        self.iterations
    }

    /// Evaluations of all stages.
    pub fn evaluations(&self) -> u32 {
        self.evaluations
    }

    /// Seed of the first stage.
    pub fn seed(&self) -> u64 {
        self.seed
    }
}
