//! Full parameters of every link from base values: closed form where consistent, else interior points.
//!
//! ```text
//! closed form allowed -> done (no step, base values untouched)
//! else: y inside, mu = F(y) / 50 -> Newton steps at mu -> mu / 10 -> ... -> last mu
//! ```
//!
//! Every iterate is strictly inside the allowed set, so a result read at any time is physically consistent.
//!
//! Cost: 30 to 60 steps ([`super::interior`]) where the closed form is
//! inconsistent. Memory, two joints: 4.0 kB.
//! Limits: at most [`LARGEST_STEPS`] steps. Where the data contradict every consistent leg, the
//! prior's pull on hidden directions has some effect. Chi-square then comes out up to twice its least
//! value, which changes no verdict.

use super::cost::LegCost;
use super::interior;
use super::limits::Limits;
use crate::ident::record::motion_record::Record;
use crate::ident::record::motion_record::Selection;
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::bounds::LinkPrior;
use crate::ident::solve::completion::complete_within;
use crate::ident::solve::estimate::Stage;
use crate::model::LegParameters;
use crate::real::{self, Real};

/// Newton steps, all barrier values together.
pub(crate) const LARGEST_STEPS: u32 = 150;
/// Newton steps at one barrier value.
const STEPS_PER_BARRIER: u32 = 12;
/// Approximate number of barrier terms of one joint: sets the first `mu`.
const BARRIERS_PER_JOINT: f64 = 21.0;

/// Accuracy of the solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort<T> {
    /// Cost in chi-square units of one prior standard deviation in a direction that torque does not show. A
    /// smaller value gives the prior less weight against the data where constraints bind.
    pub pull: T,
    /// Last `mu`, chi-square units: the final cost is within 21 N times this value of the minimum.
    pub(crate) last_barrier: T,
}

impl<T: Real> Effort<T> {
    /// Settings for single precision. Without a prior the pull to a neutral leg only makes the answer unique.
    pub fn device(with_prior: bool) -> Self {
        Self {
            pull: T::from_double(if with_prior { 1e-3 } else { 1e-4 }),
            last_barrier: T::from_double(1e-5),
        }
    }

    /// Settings for double precision, as a reference.
    pub fn reference() -> Self {
        Self { pull: T::from_double(1e-5), last_barrier: T::from_double(1e-8) }
    }
}

/// Progress of a completion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Base values are not known yet.
    Waiting,
    /// Interior-point steps are running.
    Stepping,
    /// Solution found, or out of steps.
    Done,
}

/// A completion in progress.
#[derive(Clone, Debug, PartialEq)]
pub struct Completion<T: Real, const N: usize> {
    limits: Limits<T, N>,
    cost: LegCost<T, N>,
    effort: Effort<T>,
    point: LegParameters<T, N>,
    barrier: T,
    steps: u32,
    steps_here: u32,
    phase: Phase,
    converged: bool,
}

impl<T: Real, const N: usize> Completion<T, N> {
    /// Prepares a completion; [`Self::start`] supplies the base values.
    pub fn new<const B: usize>(
        model: &RowModel<T, N, B>,
        record: &Record<T, N, B>,
        prior: Option<&[LinkPrior<T>; N]>,
        effort: Effort<T>,
    ) -> Self {
        let limits = Limits::new(model, record, prior);
        let cost = LegCost::new(&limits);
        let point = cost.scaled_point(&limits.inside());
        let barrier = effort.last_barrier;
        Self {
            limits,
            cost,
            effort,
            point,
            barrier,
            steps: 0,
            steps_here: 0,
            phase: Phase::Waiting,
            converged: false,
        }
    }

    /// Holds at zero what `selection` drops. Call it before [`Self::start`].
    pub(crate) fn hold<const B: usize>(&mut self, model: &RowModel<T, N, B>, selection: &Selection<T, N, B>) {
        self.limits.hold(model, selection);
        self.cost = LegCost::new(&self.limits);
        self.point = self.cost.scaled_point(&self.limits.inside());
    }

    /// Starts from the base values found on `stage`. If no consistent leg has these values, the cost of
    /// others is counted from `centre`.
    pub fn start<const B: usize>(
        &mut self,
        model: &RowModel<T, N, B>,
        stage: &Stage<T, B>,
        values: &[T; B],
        centre: &[T; B],
    ) {
        self.cost.fill(model, stage, centre, self.effort.pull);
        (self.steps, self.steps_here, self.converged) = (0, 0, false);
        let mut wanted = model.base.project(self.limits.origin());
        for &base in stage.columns() {
            if let (Some(slot), Some(&value)) = (wanted.get_mut(base), values.get(base)) {
                *slot = value;
            }
        }
        let closed = complete_within(model, &wanted, self.limits.origin(), self.limits.deviations());
        if let Some(closed) = closed.filter(|closed| self.limits.allow(closed)) {
            self.point = self.cost.scaled_point(&closed);
            // Rounding in the scaling must not lead outside.
            if Limits::consistent(&self.parameters()) {
                (self.phase, self.converged) = (Phase::Done, true);
                return;
            }
        }
        self.point = self.cost.scaled_point(&self.limits.inside());
        let first = self.cost.excess(&self.point) / T::from_double(BARRIERS_PER_JOINT * N as f64);
        self.barrier = real::clamp(first, self.effort.last_barrier, T::from_double(1e9));
        self.phase = Phase::Stepping;
    }

    /// Takes these parameters of a consistent leg as the result; [`Self::start`] came before.
    pub(crate) fn replace(&mut self, parameters: &LegParameters<T, N>) {
        self.point = self.cost.scaled_point(parameters);
        self.phase = Phase::Done;
    }

    /// Takes one Newton step; returns true when finished.
    pub fn step(&mut self) -> bool {
        if self.phase != Phase::Stepping {
            return self.phase == Phase::Done;
        }
        let step = interior::step(&self.cost, &self.limits, &mut self.point, self.barrier);
        self.steps += 1;
        self.steps_here += 1;
        if step.settled || self.steps_here >= STEPS_PER_BARRIER {
            if self.barrier <= self.effort.last_barrier {
                self.converged = step.settled && step.inside;
                self.phase = Phase::Done;
            }
            self.steps_here = 0;
            self.barrier = real::max(self.barrier * T::from_double(0.1), self.effort.last_barrier);
        }
        if self.steps >= LARGEST_STEPS {
            self.phase = Phase::Done;
        }
        self.phase == Phase::Done
    }

    /// True once base values were given and the completion has ended.
    pub(crate) fn is_done(&self) -> bool {
        self.phase == Phase::Done
    }

    /// True if the completion ended at the minimum, not for lack of steps or by overflow.
    #[cfg(test)]
    pub(crate) fn converged(&self) -> bool {
        self.converged
    }

    /// True while base values are missing.
    pub(crate) fn is_waiting(&self) -> bool {
        self.phase == Phase::Waiting
    }

    /// Newton steps so far; zero where the closed form is consistent.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Current parameters; physically consistent at any time.
    pub fn parameters(&self) -> LegParameters<T, N> {
        self.cost.parameters(&self.point)
    }

    /// Allowed set of the parameters.
    pub fn limits(&self) -> &Limits<T, N> {
        &self.limits
    }

    /// The cost that is minimised.
    #[cfg(test)]
    pub(crate) fn cost(&self) -> &LegCost<T, N> {
        &self.cost
    }
}
