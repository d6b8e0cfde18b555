//! What must not matter to the default beetle swarm: unit and zero of the cost, axes, place of the minimum.

#[path = "../../examples/swarm_rotated/functions.rs"]
#[allow(dead_code, reason = "the example also uses the other functions")]
mod functions;

use scarab::real::Real;
use scarab::swarm::{AdaptiveSettings, Bso, BsoSettings, Objective, Search};

use functions::{Instance, Shape};

const DIMENSION: usize = 6;
const RUNS: u64 = 200;
const SHAPES: [(Shape, f64); 3] =
    [(Shape::Ellipsoid, 1e-6), (Shape::Rosenbrock, 1e-6), (Shape::Rastrigin, 0.1)];

type Swarm<T> = Bso<T, 20, DIMENSION>;

/// Median evaluations to the goal, over random instances that a function changes.
fn median(shape: Shape, goal: f64, is_rotated: bool, change: impl Fn(&mut Instance)) -> u32 {
    let mut evaluations: Vec<u32> = (1..=RUNS)
        .map(|seed| {
            let mut cost = Instance::new(shape, DIMENSION, is_rotated, seed);
            change(&mut cost);
            let found = cost.evaluations(AdaptiveSettings::default(), goal, seed).expect("a valid box");
            found.unwrap_or(u32::MAX)
        })
        .collect();
    evaluations.sort_unstable();
    evaluations[evaluations.len() / 2]
}

/// Largest relative difference of two medians of 200 runs.
const SPREAD: f64 = 0.15;

/// An instance in single precision.
struct Single(Instance);

impl Objective<f32> for Single {
    fn dimension(&self) -> usize {
        self.0.dimension()
    }
    fn bounds(&self, coordinate: usize) -> (f32, f32) {
        let (low, high) = self.0.bounds(coordinate);
        (low as f32, high as f32)
    }
    fn evaluate(&self, position: &[f32]) -> f32 {
        // The factor is a power of two, and exact.
        let plain = Instance { factor: 1.0, ..self.0.clone() };
        let position: Vec<f64> = position.iter().copied().map(f64::from).collect();
        plain.evaluate(&position) as f32 * self.0.factor as f32
    }
}

fn places<T: Real>(cost: &impl Objective<T>) -> Vec<T> {
    let mut swarm = Swarm::<T>::new(cost, BsoSettings::default(), 7).expect("a valid box");
    swarm.advance(cost, 4_000);
    swarm.best().expect("a finite cost").position.to_vec()
}

#[test]
fn the_unit_of_the_cost_changes_no_bit_of_the_result() {
    for (shape, _) in SHAPES {
        let cost = Instance::new(shape, DIMENSION, true, 11);
        for factor in [1.0 / 1_048_576.0, 1_048_576.0] {
            let scaled = Instance { factor, ..cost.clone() };
            assert_eq!(places::<f64>(&scaled), places::<f64>(&cost), "{shape:?} {factor}");
            assert_eq!(places::<f32>(&Single(scaled)), places::<f32>(&Single(cost.clone())), "{shape:?}");
        }
    }
}

#[test]
fn constant_axes_and_place_of_the_minimum_do_not_matter() {
    for (shape, goal) in SHAPES {
        let plain = median(shape, goal, true, |_| ());
        let alike = |what: &str, is_rotated: bool, change: &dyn Fn(&mut Instance)| {
            let changed = median(shape, goal, is_rotated, change);
            let difference = f64::from(changed.abs_diff(plain)) / f64::from(plain);
            assert!(difference < SPREAD, "{shape:?}: {plain} evaluations, {what}: {changed}");
        };
        assert!(plain < u32::MAX, "{shape:?} is not solved");
        for constant in [1e3, -1e5] {
            alike("with a constant", true, &|cost| cost.constant = constant);
        }
        alike("mirrored", true, &|cost| {
            cost.rotation.iter_mut().for_each(|row| row[0] = -row[0]);
            cost.minimiser[0] = -cost.minimiser[0];
        });
        alike("permuted", true, &|cost| {
            cost.rotation.iter_mut().for_each(|row| row.rotate_left(1));
            cost.minimiser.rotate_left(1);
        });
        alike("near the middle", true, &|cost| cost.minimiser.iter_mut().for_each(|at| *at *= 0.25));
        alike("along the box", false, &|_| ());
    }
}
