//! Beetle swarm over physically consistent legs, in log-Cholesky coordinates and logarithms.
//!
//! Every point of the box is physically consistent, so the swarm cannot leave the set. It minimises the cost
//! of [`super::Completion`] from a cold start, uniform in the box that the prior allows. The search exists
//! beside the completion to show what such a search costs.
//!
//! ```text
//! alpha        ln(mass) / 2           0.2 .. 5 of the prior's mass
//! d1 d2 d3     ln(extent)             0.05 .. 1.58 of the prior's radius of gyration k
//! s12 s23 s13  shear                  +- 1.58 k
//! t1 t2 t3     centre of mass         the prior's +- half the segment's length, without a prior +- 4 lengths
//! IA FC FV     logarithms             0.01 .. 1 of their largest values
//! OFF          linear
//! ```
//!
//! Every body includes a ball of the smallest extent: shear alone could make it thinner
//! than single precision resolves.
//!
//! Cost: an evaluation 1,200 multiplications and 11 exponentials (two joints). Memory: a `Bso` of 14 N
//! dimensions, 21.6 kB for two joints.

use super::cost::LegCost;
use super::limits::Limits;
use crate::ident::solve::search::{BEETLES, PATIENCE, Patience};
use crate::model::{INERTIAL_PARAMETERS, LegParameters, LogCholesky, PARAMETERS_PER_JOINT, Parameter};
use crate::real::{self, Real};
use crate::swarm::{Bso, BsoSettings, Objective, Search, SwarmError};

/// Extents over the prior's radius of gyration.
const EXTENTS: (f64, f64) = (0.05, 1.58);
/// Least mass over the largest, where no prior gives one.
const SMALLEST_MASS_SHARE: f64 = 1e-3;
/// Least rotor inertia and friction over the largest.
const SMALLEST_DRIVE_SHARE: f64 = 1e-2;

/// Cost of a leg in logarithmic coordinates, without drive parameters that are not estimated.
#[derive(Clone, Copy, Debug)]
pub struct FullObjective<'a, T: Real, const N: usize> {
    limits: &'a Limits<T, N>,
    cost: &'a LegCost<T, N>,
}

impl<'a, T: Real, const N: usize> FullObjective<'a, T, N> {
    /// Cost within the limits.
    pub fn new(limits: &'a Limits<T, N>, cost: &'a LegCost<T, N>) -> Self {
        Self { limits, cost }
    }

    /// Joint and parameter index of every coordinate.
    fn coordinates(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.limits.links.iter().enumerate().flat_map(|(joint, link)| {
            (0..PARAMETERS_PER_JOINT)
                .filter(move |&index| {
                    index < INERTIAL_PARAMETERS || link.estimated[index - INERTIAL_PARAMETERS]
                })
                .map(move |index| (joint, index))
        })
    }

    /// Leg at a position: always physically consistent.
    pub fn parameters(&self, position: &[T]) -> LegParameters<T, N> {
        let mut coordinates = *self.cost.origin();
        for ((joint, index), &value) in self.coordinates().zip(position) {
            let drive = index.checked_sub(INERTIAL_PARAMETERS);
            let logarithmic = drive.is_some_and(|drive| drive < 3);
            coordinates[joint][index] = if logarithmic { real::exp(value) } else { value };
        }
        for (joint, link) in coordinates.iter_mut().zip(&self.limits.links) {
            let mut body = LogCholesky(crate::model::inertia::inertial(joint)).parameters();
            let ball = T::from_double(EXTENTS.0) * link.gyration;
            for axis in [Parameter::XX, Parameter::YY, Parameter::ZZ] {
                body[axis.index()] += T::from_double(2.0) * body[Parameter::M.index()] * ball * ball;
            }
            for (slot, value) in joint.iter_mut().zip(body) {
                *slot = value;
            }
        }
        coordinates
    }
}

impl<T: Real, const N: usize> Objective<T> for FullObjective<'_, T, N> {
    fn dimension(&self) -> usize {
        self.coordinates().count()
    }

    fn bounds(&self, coordinate: usize) -> (T, T) {
        let Some((joint, index)) = self.coordinates().nth(coordinate) else { return (T::zero(), T::zero()) };
        let link = &self.limits.links[joint];
        let half = T::from_double(0.5);
        let size = T::from_double(EXTENTS.1) * link.gyration;
        match index {
            0 => {
                let low = real::max(link.mass.0, T::from_double(SMALLEST_MASS_SHARE) * link.mass.1);
                (half * real::ln(low), half * real::ln(link.mass.1))
            }
            1..=3 => (real::ln(T::from_double(EXTENTS.0) * link.gyration), real::ln(size)),
            4..=6 => (-size, size),
            7..=9 => {
                let centre = link.centre[index - 7];
                (centre - link.reach, centre + link.reach)
            }
            _ => {
                let (low, high) = link.drive[(index - INERTIAL_PARAMETERS).min(3)];
                if index < PARAMETERS_PER_JOINT - 1 {
                    (real::ln(T::from_double(SMALLEST_DRIVE_SHARE) * high), real::ln(high))
                } else {
                    (low, high)
                }
            }
        }
    }

    fn evaluate(&self, position: &[T]) -> T {
        self.cost.excess(&self.cost.scaled_point(&self.parameters(position)))
    }
}

/// A swarm of up to `D` coordinates in progress.
#[derive(Clone, Debug, PartialEq)]
pub struct FullSearch<T: Real, const D: usize> {
    swarm: Bso<T, BEETLES, D>,
    patience: Patience<T>,
    done: bool,
}

impl<T: Real, const D: usize> FullSearch<T, D> {
    /// Starts the search cold.
    ///
    /// # Errors
    /// [`SwarmError`] when the box is invalid or its dimension exceeds `D`.
    pub fn new<const N: usize>(
        objective: &FullObjective<'_, T, N>,
        settings: BsoSettings<T>,
        seed: u64,
    ) -> Result<Self, SwarmError> {
        let swarm = Bso::new(objective, settings, seed)?;
        Ok(Self { swarm, patience: Patience::NEW, done: false })
    }

    /// Spends up to `evaluations`; any slicing gives the same result. Returns true when the search has ended.
    pub fn advance<const N: usize>(&mut self, objective: &FullObjective<'_, T, N>, evaluations: u32) -> bool {
        for _ in 0..evaluations {
            if self.done {
                break;
            }
            let before = self.swarm.iterations();
            self.done = self.swarm.advance(objective, 1) == 0;
            let iterations = self.swarm.iterations();
            if iterations > before {
                let value = self.swarm.best().map_or(T::LARGEST, |best| best.value);
                self.done |= self.patience.ends(value, iterations, PATIENCE);
            }
        }
        self.done
    }

    /// The best leg so far; `None` before the first evaluation.
    pub fn parameters<const N: usize>(
        &self,
        objective: &FullObjective<'_, T, N>,
    ) -> Option<LegParameters<T, N>> {
        self.swarm.best().map(|best| objective.parameters(best.position))
    }

    /// Completed iterations.
    pub fn iterations(&self) -> u32 {
        self.swarm.iterations()
    }

    /// Evaluations so far.
    pub fn evaluations(&self) -> u32 {
        self.swarm.evaluations()
    }
}
