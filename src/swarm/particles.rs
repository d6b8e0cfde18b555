//! State shared by particle swarm and beetle swarm: positions, velocities, personal bests, and Eq. (19).
//!
//! Why one type: the beetle swarm inherits this from the particle swarm.
//!
//! Velocity with fresh random numbers r1, r2 in 0..1 (Eq. 19), limited to the velocity limit per coordinate:
//!   v = w v + c1 r1 (P_i - x) + c2 r2 (G - x)
//! The numbers are drawn for each coordinate, or once for a particle: then the pull points to P_i and G and
//! does not depend on the axes. In a narrow slanted valley other points are far too high.
//! Inertia weight (Eq. 20): w = w_max - (w_max - w_min) t / M
//!
//! Symbols: x position, v velocity, P_i personal best, G best of the personal bests, all in box coordinates
//! (0..1 per coordinate); w inertia weight, c1 and c2 individual and global learning factor; t iteration of
//! M.
//! Source: Kennedy, Eberhart (1995); the paper, Eqs (18)-(20). Cost: 8 D operations and 2 or 2 D random
//! numbers per particle; memory N (3 D + 2) scalars.

use crate::real::{Real, clamp};

use super::random::Random;
use super::rows::{clip_to_box, live, live_mut};

/// Range of the first velocities, uniform, plus or minus this share of the box.
const FIRST_VELOCITY: f64 = 0.1;

/// Inertia weight that falls linearly with the iteration (Eq. 20), then stays at its last value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InertiaWeight<T> {
    /// Weight at iteration 0.
    pub first: T,
    /// Weight from the last iteration on.
    pub last: T,
    /// Iteration at which `last` is reached.
    pub iterations: u32,
}

impl<T: Real> InertiaWeight<T> {
    /// One weight for all iterations; the paper's experiments use 0.8.
    pub fn constant(weight: T) -> Self {
        Self { first: weight, last: weight, iterations: 1 }
    }

    /// Weight at an iteration.
    pub fn at(&self, iteration: u32) -> T {
        if iteration >= self.iterations {
            return self.last;
        }
        let share: T = nalgebra::convert(iteration as f32 / self.iterations as f32);
        self.first - (self.first - self.last) * share
    }
}

/// Constants of Eq. (19) at one iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct VelocityRule<T> {
    pub(crate) inertia_weight: T,
    pub(crate) individual_learning: T,
    pub(crate) global_learning: T,
    /// Largest speed per coordinate, share of the box.
    pub(crate) limit: T,
    /// Whether every coordinate has its own random numbers.
    pub(crate) per_coordinate: bool,
}

/// N particles in box coordinates.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Particles<T, const N: usize, const D: usize> {
    dimension: usize,
    pub(crate) position: [[T; D]; N],
    pub(crate) velocity: [[T; D]; N],
    pub(crate) personal_best: [[T; D]; N],
    /// Value at `position`.
    pub(crate) value: [T; N],
    pub(crate) personal_best_value: [T; N],
}

impl<T: Real, const N: usize, const D: usize> Particles<T, N, D> {
    /// A swarm needs two particles, and the searches use indices limited to N - 1.
    const ENOUGH: () = assert!(N >= 2, "a swarm has at least two particles");

    /// All particles in one corner of the box, at rest, until [`Self::scatter`].
    pub fn new(dimension: usize) -> Self {
        const { Self::ENOUGH };
        Self {
            dimension,
            position: [[T::zero(); D]; N],
            velocity: [[T::zero(); D]; N],
            personal_best: [[T::zero(); D]; N],
            value: [T::LARGEST; N],
            personal_best_value: [T::LARGEST; N],
        }
    }

    /// Number of coordinates, 1..=D.
    pub(crate) fn dimension(&self) -> usize {
        self.dimension
    }

    /// Draws new positions uniform in the box and small uniform velocities; discards all values.
    pub(crate) fn scatter(&mut self, random: &mut Random) {
        for particle in 0..N {
            for entry in live_mut(&mut self.position[particle], self.dimension) {
                *entry = random.uniform();
            }
            for entry in live_mut(&mut self.velocity[particle], self.dimension) {
                *entry = random.signed::<T>() * T::from_double(FIRST_VELOCITY);
            }
            self.personal_best[particle] = self.position[particle];
        }
        self.value = [T::LARGEST; N];
        self.personal_best_value = [T::LARGEST; N];
    }

    /// Particle with the best personal best; the first of equals.
    pub(crate) fn leader(&self) -> usize {
        let mut leader = 0;
        for particle in 1..N {
            if self.personal_best_value[particle] < self.personal_best_value[leader.min(N - 1)] {
                leader = particle;
            }
        }
        leader
    }

    /// Applies Eq. (19) to one particle.
    pub(crate) fn steer(&mut self, particle: usize, rule: &VelocityRule<T>, random: &mut Random) {
        let (particle, leader) = (particle.min(N - 1), self.leader().min(N - 1));
        let position = live(&self.position[particle], self.dimension);
        let own = live(&self.personal_best[particle], self.dimension);
        let global = live(&self.personal_best[leader], self.dimension);
        let velocity = live_mut(&mut self.velocity[particle], self.dimension);
        let mut draw = || -> (T, T) { (random.uniform(), random.uniform()) };
        let common = (!rule.per_coordinate).then(&mut draw);
        for (((speed, &at), &own), &global) in velocity.iter_mut().zip(position).zip(own).zip(global) {
            let (first, second) = common.unwrap_or_else(&mut draw);
            let pull =
                rule.individual_learning * first * (own - at) + rule.global_learning * second * (global - at);
            *speed = clamp(rule.inertia_weight * *speed + pull, -rule.limit, rule.limit);
        }
    }

    /// Stores the value at the particle's position; true for a new personal best.
    pub(crate) fn record(&mut self, particle: usize, value: T) -> bool {
        let particle = particle.min(N - 1);
        self.value[particle] = value;
        let better = value < self.personal_best_value[particle];
        if better {
            self.personal_best_value[particle] = value;
            for (best, &at) in self.personal_best[particle].iter_mut().zip(&self.position[particle]) {
                *best = clip_to_box(at);
            }
        }
        better
    }

    /// Moves the particle back to its personal best, at rest.
    pub(crate) fn retreat(&mut self, particle: usize) {
        let particle = particle.min(N - 1);
        self.position[particle] = self.personal_best[particle];
        self.velocity[particle] = [T::zero(); D];
        self.value[particle] = self.personal_best_value[particle];
    }

    /// Sorts by personal best, the best first; equals keep their order.
    pub(crate) fn sort(&mut self) {
        for end in 1..N {
            for index in (0..end).rev() {
                if self.personal_best_value[index] <= self.personal_best_value[index + 1] {
                    break;
                }
                self.position.swap(index, index + 1);
                self.velocity.swap(index, index + 1);
                self.personal_best.swap(index, index + 1);
                self.value.swap(index, index + 1);
                self.personal_best_value.swap(index, index + 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inertia_weight_falls_linearly_to_its_last_value() {
        let weight = InertiaWeight { first: 0.9_f64, last: 0.4, iterations: 100 };
        assert_eq!(weight.at(0), 0.9);
        // Single-precision share of the iterations: 6e-8 of 0.5.
        assert!((weight.at(50) - 0.65).abs() < 1e-7);
        assert_eq!(weight.at(100), 0.4);
        assert_eq!(weight.at(u32::MAX), 0.4);
        assert_eq!(InertiaWeight { iterations: 0, ..weight }.at(0), 0.4);
    }

    #[test]
    fn sorting_keeps_each_particle_together_and_equals_in_order() {
        let mut particles = Particles::<f64, 5, 2>::new(2);
        for (particle, value) in [3.0, 1.0, 2.0, 1.0, 0.5].into_iter().enumerate() {
            particles.personal_best_value[particle] = value;
            particles.position[particle] = [particle as f64; 2];
            particles.velocity[particle] = [-(particle as f64); 2];
        }
        particles.sort();
        assert_eq!(particles.personal_best_value, [0.5, 1.0, 1.0, 2.0, 3.0]);
        assert_eq!(particles.position.map(|row| row[0]), [4.0, 1.0, 3.0, 2.0, 0.0]);
        assert_eq!(particles.velocity.map(|row| row[1]), [-4.0, -1.0, -3.0, -2.0, 0.0]);
        assert_eq!(particles.leader(), 0);
    }

    #[test]
    fn speed_never_exceeds_its_limit_and_unused_coordinates_stay_untouched() {
        let mut random = Random::new(5);
        let mut particles = Particles::<f64, 4, 6>::new(3);
        particles.scatter(&mut random);
        let rule = VelocityRule {
            inertia_weight: 0.8,
            individual_learning: 9.0,
            global_learning: 9.0,
            limit: 0.2,
            per_coordinate: true,
        };
        for round in 0..50 {
            for particle in 0..4 {
                particles.record(particle, f64::from(round * 7 % 5) - particle as f64);
                particles.steer(particle, &rule, &mut random);
                assert!(particles.velocity[particle].iter().all(|speed| speed.abs() <= 0.2));
                assert_eq!(particles.velocity[particle][3..], [0.0; 3]);
            }
        }
    }
}
