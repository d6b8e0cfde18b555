//! Particle swarm search: the classical comparison, and the basis of the beetle swarm.
//!
//! Per iteration and particle: velocity by Eq. (19), then x = x + v (Eq. 18), clipped to the box. All
//! particles move before the personal bests follow. Velocities are limited to a fifth of the box per
//! coordinate (the paper requires a limit but gives no value).
//!
//! Source: Kennedy, Eberhart (1995); the paper, Eqs (18)-(20), constants of its section 4.1.
//! Cost: N evaluations and 10 N D operations per iteration; memory N (3 D + 3) + 3 D scalars.
//! Known limits: with these constants it rarely succeeds on Ackley's function in 30 dimensions.

use crate::real::Real;

use super::objective::{Objective, SwarmError, not_negative};
use super::particles::{InertiaWeight, Particles, VelocityRule};
use super::random::Random;
use super::rows::clip_to_box;
use super::search::{Best, Search, SearchProgress};

/// Constants of the particle swarm; the default is the paper's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PsoSettings<T> {
    /// w of Eqs (19), (20); default 0.8 throughout.
    pub inertia_weight: InertiaWeight<T>,
    /// c1, pull towards the particle's own best; default 1.4.
    pub individual_learning: T,
    /// c2, pull towards the swarm's best; default 1.4.
    pub global_learning: T,
    /// Largest speed per coordinate and iteration, share of the box; default 0.2.
    pub velocity_limit: T,
}

impl<T: Real> Default for PsoSettings<T> {
    fn default() -> Self {
        Self {
            inertia_weight: InertiaWeight::constant(T::from_double(0.8)),
            individual_learning: T::from_double(1.4),
            global_learning: T::from_double(1.4),
            velocity_limit: T::from_double(0.2),
        }
    }
}

/// Particle swarm of `N` particles with capacity for `D` coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Pso<T: Real, const N: usize, const D: usize> {
    settings: PsoSettings<T>,
    progress: SearchProgress<T, D>,
    random: Random,
    particles: Particles<T, N, D>,
    /// Values found by the moves of the current iteration.
    found: [T; N],
    /// Next particle to evaluate.
    next: usize,
    scattered: bool,
}

impl<T: Real, const N: usize, const D: usize> Pso<T, N, D> {
    /// Scatters a swarm over the objective's box; nothing is evaluated yet.
    pub fn new(
        objective: &impl Objective<T>,
        settings: PsoSettings<T>,
        seed: u64,
    ) -> Result<Self, SwarmError> {
        not_negative("inertia_weight", settings.inertia_weight.first)?;
        not_negative("inertia_weight", settings.inertia_weight.last)?;
        not_negative("individual_learning", settings.individual_learning)?;
        not_negative("global_learning", settings.global_learning)?;
        not_negative("velocity_limit", settings.velocity_limit)?;
        let progress = SearchProgress::open(objective)?;
        let mut random = Random::new(seed);
        let mut particles = Particles::new(progress.dimension());
        particles.scatter(&mut random);
        Ok(Self { settings, progress, random, particles, found: [T::zero(); N], next: 0, scattered: true })
    }

    fn step(&mut self, objective: &impl Objective<T>) {
        let particle = self.next.min(N - 1);
        if !self.scattered {
            let rule = VelocityRule {
                inertia_weight: self.settings.inertia_weight.at(self.progress.iterations()),
                individual_learning: self.settings.individual_learning,
                global_learning: self.settings.global_learning,
                limit: self.settings.velocity_limit,
                per_coordinate: true,
            };
            self.particles.steer(particle, &rule, &mut self.random);
            let velocity = &self.particles.velocity[particle];
            for (entry, &speed) in self.particles.position[particle].iter_mut().zip(velocity) {
                *entry = clip_to_box(*entry + speed);
            }
        }
        self.found[particle] = self.progress.evaluate(objective, &self.particles.position[particle]);
        self.next = particle + 1;
        if self.next == N {
            self.close_iteration();
        }
    }

    fn close_iteration(&mut self) {
        for particle in 0..N {
            self.particles.record(particle, self.found[particle]);
        }
        if !self.scattered {
            self.progress.close_iteration();
        }
        self.scattered = false;
        self.next = 0;
    }
}

impl<T: Real, const N: usize, const D: usize> Search<T> for Pso<T, N, D> {
    fn advance(&mut self, objective: &impl Objective<T>, evaluations: u32) -> u32 {
        if !self.progress.accepts(objective) {
            return 0;
        }
        for _ in 0..evaluations {
            self.step(objective);
        }
        evaluations
    }
    fn best(&self) -> Option<Best<'_, T>> {
        self.progress.best()
    }
    fn iterations(&self) -> u32 {
        self.progress.iterations()
    }
    fn evaluations(&self) -> u32 {
        self.progress.evaluations()
    }
}

#[cfg(test)]
mod tests {
    use super::super::functions::{TestFunction, TestProblem};
    use super::*;

    #[test]
    fn a_particle_moves_by_its_velocity_and_stops_at_the_wall() {
        let problem = TestProblem::new(TestFunction::Sphere, 3);
        let mut swarm = Pso::<f64, 6, 3>::new(&problem, PsoSettings::default(), 8).expect("a valid box");
        swarm.advance(&problem, 6);
        for _ in 0..30 {
            let before = swarm.particles.position;
            swarm.advance(&problem, 6);
            for (particle, row) in before.iter().enumerate() {
                for (coordinate, entry) in row.iter().enumerate() {
                    let moved = entry + swarm.particles.velocity[particle][coordinate];
                    assert_eq!(swarm.particles.position[particle][coordinate], moved.clamp(0.0, 1.0));
                }
            }
        }
        assert_eq!((swarm.iterations(), swarm.evaluations()), (30, 6 * 31));
    }
}
