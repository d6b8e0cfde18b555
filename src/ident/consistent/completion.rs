//! Full parameters of every link from base values: in closed form where that is a leg, else by interior points.
//!
//! ```text
//! closed form allowed -> done (no step, base values untouched)
//! else: y inside, mu = F(y) / 50 -> Newton steps at mu -> mu / 10 -> ... -> last mu
//! ```
//!
//! Every place visited is strictly inside the allowed set, so that whatever is read at any time is a possible leg.
//!
//! Cost: 30 to 60 steps ([`super::interior`]) where the closed form is no leg. Memory, two joints: 4.0 kB.
//! Limits: at most [`LARGEST_STEPS`]. Where the data contradict every leg the prior's pull on hidden directions is
//! heard: that chi-square then comes out up to twice as large as its least value, which changes no verdict.

use super::super::bounds::LinkPrior;
use super::super::completion::complete_within;
use super::super::estimate::Stage;
use super::super::record::{Record, RowModel};
use super::super::selection::Selection;
use super::cost::LegCost;
use super::interior;
use super::limits::Limits;
use crate::model::LegParameters;
use crate::real::{self, Real};

/// Newton steps, all barriers together.
pub const LARGEST_STEPS: u32 = 150;
/// Steps at one barrier.
const STEPS_PER_BARRIER: u32 = 12;
/// Barriers of one joint, about: sets the first `mu`.
const BARRIERS_PER_JOINT: f64 = 21.0;

/// How closely to solve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort<T> {
    /// Chi-square units that a deviation by one standard deviation of the prior costs where torque is silent. The
    /// smaller, the less the prior is heard against the data where constraints bind.
    pub pull: T,
    /// Last `mu`, chi-square units: the cost ends within 21 N times that of the minimum.
    pub last_barrier: T,
}

impl<T: Real> Effort<T> {
    /// For single precision. A neutral leg in place of a prior is only there to make the answer unique.
    #[must_use]
    pub fn device(with_prior: bool) -> Self {
        Self { pull: T::of(if with_prior { 1e-3 } else { 1e-4 }), last_barrier: T::of(1e-5) }
    }

    /// For double precision, as a reference.
    #[must_use]
    pub fn reference() -> Self {
        Self { pull: T::of(1e-5), last_barrier: T::of(1e-8) }
    }
}

/// Where it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Base values are not known yet.
    Waiting,
    /// Interior points.
    Stepping,
    /// Found.
    Done,
}

/// A completion under way.
#[derive(Clone, Debug, PartialEq)]
pub struct Completion<T: Real, const N: usize> {
    limits: Limits<T, N>,
    cost: LegCost<T, N>,
    effort: Effort<T>,
    place: LegParameters<T, N>,
    barrier: T,
    steps: u32,
    steps_here: u32,
    phase: Phase,
    converged: bool,
}

impl<T: Real, const N: usize> Completion<T, N> {
    /// Nothing to complete yet.
    #[must_use]
    pub fn new<const B: usize>(
        model: &RowModel<T, N, B>,
        record: &Record<T, N, B>,
        prior: Option<&[LinkPrior<T>; N]>,
        effort: Effort<T>,
    ) -> Self {
        let limits = Limits::new(model, record, prior);
        let cost = LegCost::new(&limits);
        let place = cost.place(&limits.inside());
        let barrier = effort.last_barrier;
        Self {
            limits,
            cost,
            effort,
            place,
            barrier,
            steps: 0,
            steps_here: 0,
            phase: Phase::Waiting,
            converged: false,
        }
    }

    /// Holds what `selection` drops at zero, before it begins.
    pub fn hold<const B: usize>(&mut self, model: &RowModel<T, N, B>, selection: &Selection<T, N, B>) {
        self.limits.hold(model, selection);
        self.cost = LegCost::new(&self.limits);
        self.place = self.cost.place(&self.limits.inside());
    }

    /// Begins with base values that were found on `stage`; if no leg has them, the cost of others is counted from
    /// `centre`.
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
            self.place = self.cost.place(&closed);
            // Rounding of the scaling must not lead outside.
            if Limits::consistent(&self.parameters()) {
                (self.phase, self.converged) = (Phase::Done, true);
                return;
            }
        }
        self.place = self.cost.place(&self.limits.inside());
        let first = self.cost.excess(&self.place) / T::of(BARRIERS_PER_JOINT * N as f64);
        self.barrier = real::clamp(first, self.effort.last_barrier, T::of(1e9));
        self.phase = Phase::Stepping;
    }

    /// One Newton step; true when there is nothing left to do.
    pub fn step(&mut self) -> bool {
        if self.phase != Phase::Stepping {
            return self.phase == Phase::Done;
        }
        let step = interior::step(&self.cost, &self.limits, &mut self.place, self.barrier);
        self.steps += 1;
        self.steps_here += 1;
        if step.settled || self.steps_here >= STEPS_PER_BARRIER {
            if self.barrier <= self.effort.last_barrier {
                self.converged = step.settled && step.inside;
                self.phase = Phase::Done;
            }
            self.steps_here = 0;
            self.barrier = real::max(self.barrier * T::of(0.1), self.effort.last_barrier);
        }
        if self.steps >= LARGEST_STEPS {
            self.phase = Phase::Done;
        }
        self.phase == Phase::Done
    }

    /// Base values are there and the leg is found.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.phase == Phase::Done
    }

    /// It ended at the minimum, not because steps ran out or numbers overflowed.
    #[must_use]
    pub fn converged(&self) -> bool {
        self.converged
    }

    /// Whether base values were given.
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        self.phase == Phase::Waiting
    }

    /// Newton steps so far; none where the closed form is a leg.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Parameters of a possible leg at any time.
    #[must_use]
    pub fn parameters(&self) -> LegParameters<T, N> {
        self.cost.parameters(&self.place)
    }

    /// What is allowed.
    #[must_use]
    pub fn limits(&self) -> &Limits<T, N> {
        &self.limits
    }

    /// The cost that is minimised.
    #[must_use]
    pub fn cost(&self) -> &LegCost<T, N> {
        &self.cost
    }
}
