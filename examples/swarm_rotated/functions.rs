//! Functions of an outside benchmark: rotated at random, with their minimum anywhere in the box.
//!
//! ```text
//! z = R (x - x_0),   c_i = i / (D - 1)
//! R: random rotation, or 1;   x_0: uniform in +-4 of the box +-5, in +-3 for Rosenbrock's function
//!
//! ellipsoid        sum 10^(6 c_i) z_i^2
//! discus           1e6 z_0^2 + sum_(i > 0) z_i^2
//! bent cigar       y_0^2 + 1e6 sum_(i > 0) y_i^2,   y = R p
//!                  p_i = z_i^(1 + c_i sqrt(z_i) / 2) if z_i > 0, else z_i
//! sharp ridge      y_0^2 + 100 sqrt(sum_(i > 0) y_i^2),   y = R p,   p_i = 10^(c_i / 2) z_i; or y = p
//! powers           sqrt(sum |z_i|^(2 + 4 c_i))
//! Rosenbrock       sum 100 (y_i^2 - y_(i+1))^2 + (y_i - 1)^2,   y = z + 1
//! Rastrigin        10 D + sum y_i^2 - 10 cos 2 pi y_i,   y = s z
//! Ackley           that of scarab::swarm, of 6.4 z
//! ```
//!
//! Source: Hansen et al., Real-Parameter Black-Box Optimization Benchmarking 2009: Noiseless Functions
//! Definitions; some of its transforms are left out.

use scarab::real::{Real, exp, ln, sqrt};
use scarab::swarm::{
    AdaptiveSettings, Bso, BsoSettings, Objective, Random, Search, SwarmError, TestFunction, TestProblem,
};

const EVALUATIONS_PER_DIMENSION: u32 = 2_000;
/// Half width of the box.
const HALF_WIDTH: f64 = 5.0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    Ellipsoid,
    Discus,
    BentCigar,
    SharpRidge,
    /// The sharp ridge along one of its axes.
    ScaledRidge,
    Powers,
    Rosenbrock,
    Rastrigin,
    Ackley,
}

/// One instance: factor * f(x) + constant.
#[derive(Clone)]
pub struct Instance {
    pub shape: Shape,
    pub rotation: Vec<Vec<f64>>,
    /// Scale s of Rastrigin's function: ripples are 1 / s apart.
    pub scale: f64,
    pub minimiser: Vec<f64>,
    pub factor: f64,
    pub constant: f64,
}

impl Instance {
    /// Instance of a seed; `is_rotated`: whether its axes are not those of the box.
    pub fn new(shape: Shape, dimension: usize, is_rotated: bool, seed: u64) -> Self {
        // The swarm of this seed draws other numbers.
        let mut random = Random::new(!seed);
        let reach = if shape == Shape::Rosenbrock { 3.0 } else { 4.0 };
        let minimiser = (0..dimension).map(|_| reach * random.signed::<f64>()).collect();
        let rotation = if is_rotated { rotation(dimension, &mut random) } else { identity(dimension) };
        Self { shape, rotation, scale: 1.0, minimiser, factor: 1.0, constant: 0.0 }
    }

    /// Evaluations until the swarm comes within `goal` of the minimum; `None` within 2,000 per dimension.
    pub fn evaluations<T: Real>(
        &self,
        settings: AdaptiveSettings<T>,
        goal: f64,
        seed: u64,
    ) -> Result<Option<u32>, SwarmError> {
        let mut swarm = Box::new(Bso::<T, 20, 30>::new(self, BsoSettings::Adaptive(settings), seed)?);
        let most = EVALUATIONS_PER_DIMENSION * self.minimiser.len() as u32;
        while swarm.evaluations() < most {
            swarm.advance(self, 1);
            if swarm.best().is_some_and(|best| best.value.to_double() - self.constant <= self.factor * goal) {
                return Ok(Some(swarm.evaluations()));
            }
        }
        Ok(None)
    }

    fn cost(&self, x: &[f64]) -> f64 {
        let moved: Vec<f64> = x.iter().zip(&self.minimiser).map(|(x, minimum)| x - minimum).collect();
        let z = product(&self.rotation, &moved);
        let last = (z.len().max(2) - 1) as f64;
        let indexed = || z.iter().enumerate().map(|(index, z)| (index as f64 / last, *z));
        let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
        match self.shape {
            Shape::Ellipsoid => indexed().map(|(share, z)| power(10.0, 6.0 * share) * z * z).sum(),
            Shape::Discus => 1e6 * z[0] * z[0] + squares(&z[1..]),
            Shape::BentCigar => {
                let bent = |(share, z): (f64, f64)| {
                    if z > 0.0 { power(z, 1.0 + 0.5 * share * sqrt(z)) } else { z }
                };
                let y = product(&self.rotation, &indexed().map(bent).collect::<Vec<f64>>());
                y[0] * y[0] + 1e6 * squares(&y[1..])
            }
            Shape::SharpRidge | Shape::ScaledRidge => {
                let p: Vec<f64> = indexed().map(|(share, z)| power(10.0, 0.5 * share) * z).collect();
                let y = if self.shape == Shape::SharpRidge { product(&self.rotation, &p) } else { p };
                y[0] * y[0] + 100.0 * sqrt(squares(&y[1..]))
            }
            Shape::Powers => sqrt(indexed().map(|(share, z)| power(z.abs(), 2.0 + 4.0 * share)).sum::<f64>()),
            Shape::Rosenbrock => of(TestFunction::Rosenbrock, z.iter().map(|z| z + 1.0)),
            Shape::Rastrigin => of(TestFunction::Rastrigin, z.iter().map(|z| self.scale * z)),
            Shape::Ackley => of(TestFunction::Ackley, z.iter().map(|z| 6.4 * z)),
        }
    }
}

impl<T: Real> Objective<T> for Instance {
    fn dimension(&self) -> usize {
        self.minimiser.len()
    }

    fn bounds(&self, _: usize) -> (T, T) {
        (T::from_double(-HALF_WIDTH), T::from_double(HALF_WIDTH))
    }

    fn evaluate(&self, position: &[T]) -> T {
        let position: Vec<f64> = position.iter().map(|x| x.to_double()).collect();
        T::from_double(self.factor * self.cost(&position) + self.constant)
    }
}

/// Evaluations of these runs in order that a share of the runs needs; "-" where fewer arrive.
pub fn quantile(arrived: &mut [u32], runs: u64, share: f64) -> String {
    arrived.sort_unstable();
    let rank = (share * runs as f64).ceil() as usize;
    arrived.get(rank.max(1) - 1).map_or_else(|| "-".to_owned(), u32::to_string)
}

/// A positive number, or 0, to a positive power.
fn power(base: f64, exponent: f64) -> f64 {
    exp(exponent * ln(base))
}

fn of(function: TestFunction, y: impl Iterator<Item = f64>) -> f64 {
    let y: Vec<f64> = y.collect();
    TestProblem::new(function, y.len()).evaluate(&y)
}

fn product(matrix: &[Vec<f64>], vector: &[f64]) -> Vec<f64> {
    matrix.iter().map(|row| row.iter().zip(vector).map(|(one, other)| one * other).sum()).collect()
}

fn identity(dimension: usize) -> Vec<Vec<f64>> {
    (0..dimension)
        .map(|row| (0..dimension).map(|column| f64::from(u8::from(row == column))).collect())
        .collect()
}

/// Random rotation by Gram and Schmidt's orthogonalisation of a matrix of random numbers.
fn rotation(dimension: usize, random: &mut Random) -> Vec<Vec<f64>> {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    while rows.len() < dimension {
        let mut row: Vec<f64> = (0..dimension).map(|_| random.bell::<f64>()).collect();
        for earlier in &rows {
            let along: f64 = row.iter().zip(earlier).map(|(one, other)| one * other).sum();
            row.iter_mut().zip(earlier).for_each(|(entry, earlier)| *entry -= along * earlier);
        }
        let length = sqrt(row.iter().map(|entry| entry * entry).sum::<f64>());
        if length > 1e-3 {
            rows.push(row.into_iter().map(|entry| entry / length).collect());
        }
    }
    rows
}
