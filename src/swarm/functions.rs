//! Test functions with a known minimum, over the boxes for which this module's figures hold.
//!
//! Why in the firmware: the tests judge every search on these functions in both precisions. Every figure of a
//! search depends on the box, so function and box are one value. Here i counts from 0 and c_i is the shift of
//! coordinate i.
//!
//! | function | value | box | minimum |
//! | --- | --- | --- | --- |
//! | sphere | sum x_i^2 | 100 | 0 |
//! | six-hump camel | (4 - 2.1 x^2 + x^4 / 3) x^2 + x y + (4 y^2 - 4) y^2 | 5 | -1.0316285 |
//! | Branin | (y - 5.1 / (4 pi^2) x^2 + 5 / pi x - 6)^2 + 10 (1 - 1 / (8 pi)) cos x + 10 | 5 | 0.3978874 |
//! | Ackley | 20 + e - 20 exp(-0.2 sqrt(mean x_i^2)) - exp(mean cos 2 pi x_i) | 32 | 0 |
//! | Ackley, shifted, rotated | see below | 32 | 0 |
//! | ellipsoid, shifted | 1e-4 sum 10^(k i / (n - 1)) (x_i - c_i)^2, k = 4 or 6 | 100 | 0 |
//! | Rosenbrock | sum 100 (x_(i+1) - x_i^2)^2 + (1 - x_i)^2 | 5 | 0 |
//! | Griewank, shifted by 123 | 1 + sum y_i^2 / 4000 - prod cos(y_i / sqrt(i + 1)) | 600 | 0 |
//! | Schwefel 1.2, shifted by 13 | sum_i (sum_(j <= i) y_j)^2 | 65 | 0 |
//! | Levy | see below | 10 | 0 |
//! | Rastrigin | 10 n + sum x_i^2 - 10 cos 2 pi x_i | 5 | 0 |
//!
//! ```text
//! ellipsoid, shifted         c_i = 60 - (29 i mod 31)
//! Ackley, shifted, rotated   Ackley's function of y - 2 w (w.y) / (w.w),   y = x - c,   w_i = sin(i + 1),
//!                            c_i = 11 + 7 ((37 i mod 11) / 11 - 1/2)
//! Levy, u = 1 + (x - 1) / 4  sin^2(pi u_0) + sum (u_i - 1)^2 (1 + 10 sin^2(pi u_i + 1))
//!                            + (u_last - 1)^2 (1 + sin^2(2 pi u_last))
//! ```
//!
//! The paper prints its f2, f3 and f4 differently (x^(4/3) for x^4 / 3, x and y exchanged and 5
//! for 5.1, without e). These forms exist as `...AsPrinted` to show the difference: minima
//! -941.37, 0.397887, -2.718282.
//!
//! Source: Table III of the paper; standard collections (Hansen et al., 2009). Cost: D to 30 D operations.

use core::f64::consts::{E, PI};

use crate::real::{Real, abs, exp, ln, sin_cos, sqrt};

use super::objective::Objective;

/// A function to be minimised; the module header has formula, box and minimum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TestFunction {
    /// Unimodal, isotropic.
    Sphere,
    /// Six minima, two of them global; two coordinates.
    SixHumpCamel,
    /// One global minimum in this box; two coordinates.
    Branin,
    /// Many ripples on a funnel.
    Ackley,
    /// Ackley's function away from the centre and not along the axes.
    ShiftedRotatedAckley,
    /// Unimodal, condition number 1e4.
    ShiftedEllipsoid,
    /// Unimodal, condition number 1e6.
    ShiftedSteepEllipsoid,
    /// A narrow curved valley.
    Rosenbrock,
    /// Fine ripples on a bowl.
    ShiftedGriewank,
    /// Unimodal, all coordinates coupled.
    ShiftedSchwefel,
    /// Ripples along every coordinate.
    Levy,
    /// A grid of 11^n deep minima.
    Rastrigin,
    /// The paper's f2 as printed; two coordinates.
    CamelAsPrinted,
    /// The paper's f3 as printed; two coordinates.
    BraninAsPrinted,
    /// The paper's f4 as printed.
    AckleyAsPrinted,
}

/// A test function over its box in a number of dimensions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TestProblem {
    function: TestFunction,
    dimension: usize,
}

impl TestProblem {
    /// The function in `dimension` coordinates (2 where the function is one of a plane).
    pub const fn new(function: TestFunction, dimension: usize) -> Self {
        use TestFunction::{Branin, BraninAsPrinted, CamelAsPrinted, SixHumpCamel};
        let planar = matches!(function, SixHumpCamel | Branin | CamelAsPrinted | BraninAsPrinted);
        Self { function, dimension: if planar { 2 } else { dimension } }
    }

    /// Half the box's width: each coordinate reaches from minus to plus this value.
    pub const fn half_width(&self) -> f64 {
        use TestFunction as F;
        match self.function {
            F::Sphere | F::ShiftedEllipsoid | F::ShiftedSteepEllipsoid => 100.0,
            F::Ackley | F::ShiftedRotatedAckley | F::AckleyAsPrinted => 32.0,
            F::ShiftedGriewank => 600.0,
            F::ShiftedSchwefel => 65.0,
            F::Levy => 10.0,
            _ => 5.0,
        }
    }

    /// Least value in the box.
    pub const fn minimum(&self) -> f64 {
        use TestFunction as F;
        match self.function {
            F::SixHumpCamel => -1.031_628_453_489_877,
            F::Branin | F::BraninAsPrinted => 0.397_887_357_729_738,
            F::CamelAsPrinted => -941.373_185_459_986,
            F::AckleyAsPrinted => -E,
            _ => 0.0,
        }
    }
}

impl<T: Real> Objective<T> for TestProblem {
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn bounds(&self, _coordinate: usize) -> (T, T) {
        (T::from_double(-self.half_width()), T::from_double(self.half_width()))
    }

    fn evaluate(&self, position: &[T]) -> T {
        match self.function {
            TestFunction::Sphere => position.iter().fold(T::zero(), |sum, &x| sum + x * x),
            TestFunction::SixHumpCamel => six_hump_camel(position),
            TestFunction::Branin => branin(position),
            TestFunction::Ackley => ackley(position.iter().copied()),
            TestFunction::ShiftedRotatedAckley => shifted_rotated_ackley(position),
            TestFunction::ShiftedEllipsoid => shifted_ellipsoid(position, 4.0),
            TestFunction::ShiftedSteepEllipsoid => shifted_ellipsoid(position, 6.0),
            TestFunction::Rosenbrock => rosenbrock(position),
            TestFunction::ShiftedGriewank => shifted_griewank(position),
            TestFunction::ShiftedSchwefel => shifted_schwefel(position),
            TestFunction::Levy => levy(position),
            TestFunction::Rastrigin => rastrigin(position),
            TestFunction::CamelAsPrinted => camel_as_printed(position),
            TestFunction::BraninAsPrinted => branin_as_printed(position),
            TestFunction::AckleyAsPrinted => ackley(position.iter().copied()) - T::from_double(E),
        }
    }
}

fn square<T: Real>(value: T) -> T {
    value * value
}

/// First two coordinates; zero for missing ones.
fn plane<T: Real>(position: &[T]) -> (T, T) {
    let coordinate = |index: usize| position.get(index).copied().unwrap_or(T::zero());
    (coordinate(0), coordinate(1))
}

fn six_hump_camel<T: Real>(position: &[T]) -> T {
    let (x, y) = plane(position);
    let (x2, y2) = (x * x, y * y);
    (T::from_double(4.0) - T::from_double(2.1) * x2 + x2 * x2 / T::from_double(3.0)) * x2
        + x * y
        + (T::from_double(4.0) * y2 - T::from_double(4.0)) * y2
}

fn camel_as_printed<T: Real>(position: &[T]) -> T {
    let (x, y) = plane(position);
    let (x2, y2) = (x * x, y * y);
    let power = if x2 > T::zero() { exp(T::from_double(4.0 / 3.0) * ln(abs(x))) } else { T::zero() };
    (T::from_double(4.0) - T::from_double(2.0) * x2 + power) * x2
        + x * y
        + (T::from_double(4.0) * y2 - T::from_double(4.0)) * y2
}

/// Branin's function with the coefficient of the parabola as an argument.
fn branin_with<T: Real>(x: T, y: T, coefficient: f64) -> T {
    let valley = y - T::from_double(coefficient / (4.0 * PI * PI)) * x * x + T::from_double(5.0 / PI) * x
        - T::from_double(6.0);
    valley * valley + T::from_double(10.0 * (1.0 - 1.0 / (8.0 * PI))) * sin_cos(x).1 + T::from_double(10.0)
}

fn branin<T: Real>(position: &[T]) -> T {
    let (x, y) = plane(position);
    branin_with(x, y, 5.1)
}

fn branin_as_printed<T: Real>(position: &[T]) -> T {
    let (x, y) = plane(position);
    branin_with(y, x, 5.0)
}

fn ackley<T: Real>(position: impl Iterator<Item = T>) -> T {
    let (mut squares, mut cosines, mut count) = (T::zero(), T::zero(), T::zero());
    for x in position {
        squares += x * x;
        cosines += sin_cos(T::from_double(2.0 * PI) * x).1;
        count += T::one();
    }
    T::from_double(20.0 + E)
        - T::from_double(20.0) * exp(T::from_double(-0.2) * sqrt(squares / count))
        - exp(cosines / count)
}

fn shifted_rotated_ackley<T: Real>(position: &[T]) -> T {
    let shifted = |(i, &x): (usize, &T)| {
        let centre = 11.0 + 7.0 * ((37 * i % 11) as f64 / 11.0 - 0.5);
        (sin_cos(T::from_double(i as f64 + 1.0)).0, x - T::from_double(centre))
    };
    let (along, length) = position
        .iter()
        .enumerate()
        .map(shifted)
        .fold((T::zero(), T::zero()), |(along, length), (w, y)| (along + w * y, length + w * w));
    let factor = (along + along) / length;
    ackley(position.iter().enumerate().map(shifted).map(|(w, y)| y - factor * w))
}

fn shifted_ellipsoid<T: Real>(position: &[T], decades: f64) -> T {
    let last = T::from_double(if position.len() > 1 { position.len() as f64 - 1.0 } else { 1.0 });
    let decades = T::from_double(decades * core::f64::consts::LN_10) / last;
    let sum = position.iter().enumerate().fold(T::zero(), |sum, (i, &x)| {
        let centre = 60.0 - (29 * i % 31) as f64;
        sum + exp(decades * T::from_double(i as f64)) * square(x - T::from_double(centre))
    });
    T::from_double(1e-4) * sum
}

fn rosenbrock<T: Real>(position: &[T]) -> T {
    position.iter().zip(position.iter().skip(1)).fold(T::zero(), |sum, (&x, &next)| {
        sum + T::from_double(100.0) * square(next - x * x) + square(T::one() - x)
    })
}

fn shifted_griewank<T: Real>(position: &[T]) -> T {
    let (sum, product) =
        position.iter().enumerate().fold((T::zero(), T::one()), |(sum, product), (i, &x)| {
            let y = x - T::from_double(123.0);
            (sum + y * y, product * sin_cos(y / sqrt(T::from_double(i as f64 + 1.0))).1)
        });
    T::one() + sum / T::from_double(4000.0) - product
}

fn shifted_schwefel<T: Real>(position: &[T]) -> T {
    let (total, _) = position.iter().fold((T::zero(), T::zero()), |(total, partial), &x| {
        let partial = partial + x - T::from_double(13.0);
        (total + partial * partial, partial)
    });
    total
}

fn levy<T: Real>(position: &[T]) -> T {
    let Some((&last, others)) = position.split_last() else { return T::zero() };
    let stretched = |x: T| T::one() + (x - T::one()) / T::from_double(4.0);
    let sine = |angle: T| sin_cos(angle).0;
    let first = stretched(others.first().copied().unwrap_or(last));
    let sum = others.iter().fold(square(sine(T::from_double(PI) * first)), |sum, &x| {
        let u = stretched(x);
        sum + square(u - T::one())
            * (T::one() + T::from_double(10.0) * square(sine(T::from_double(PI) * u + T::one())))
    });
    let u = stretched(last);
    sum + square(u - T::one()) * (T::one() + square(sine(T::from_double(2.0 * PI) * u)))
}

fn rastrigin<T: Real>(position: &[T]) -> T {
    position.iter().fold(T::zero(), |sum, &x| {
        sum + T::from_double(10.0) + x * x - T::from_double(10.0) * sin_cos(T::from_double(2.0 * PI) * x).1
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Position of the minimum, for `n` coordinates.
    fn minimiser(function: TestFunction, n: usize) -> Vec<f64> {
        use TestFunction as F;
        match function {
            F::SixHumpCamel => Vec::from([0.089_842_013_1, -0.712_656_403]),
            F::Branin => Vec::from([PI, 2.275]),
            F::BraninAsPrinted => Vec::from([2.25, PI]),
            F::CamelAsPrinted => Vec::from([-5.0, 0.916_952_924]),
            F::Rosenbrock | F::Levy => vec![1.0; n],
            F::ShiftedGriewank => vec![123.0; n],
            F::ShiftedSchwefel => vec![13.0; n],
            F::ShiftedEllipsoid | F::ShiftedSteepEllipsoid => {
                (0..n).map(|i| 60.0 - (29 * i % 31) as f64).collect()
            }
            F::ShiftedRotatedAckley => {
                (0..n).map(|i| 11.0 + 7.0 * ((37 * i % 11) as f64 / 11.0 - 0.5)).collect()
            }
            _ => vec![0.0; n],
        }
    }

    const ALL: [TestFunction; 15] = [
        TestFunction::Sphere,
        TestFunction::SixHumpCamel,
        TestFunction::Branin,
        TestFunction::Ackley,
        TestFunction::ShiftedRotatedAckley,
        TestFunction::ShiftedEllipsoid,
        TestFunction::ShiftedSteepEllipsoid,
        TestFunction::Rosenbrock,
        TestFunction::ShiftedGriewank,
        TestFunction::ShiftedSchwefel,
        TestFunction::Levy,
        TestFunction::Rastrigin,
        TestFunction::CamelAsPrinted,
        TestFunction::BraninAsPrinted,
        TestFunction::AckleyAsPrinted,
    ];

    #[test]
    fn every_function_takes_its_minimum_at_its_minimiser_inside_its_box() {
        for function in ALL {
            let problem = TestProblem::new(function, 10);
            let position = minimiser(function, Objective::<f64>::dimension(&problem));
            assert!(position.iter().all(|x| abs(*x) <= problem.half_width()));
            let value: f64 = problem.evaluate(&position);
            // Minimisers of the plane functions are given to 7 digits: the value follows to 1e-7.
            assert!(abs(value - problem.minimum()) < 1e-7, "{function:?}: {value}");
        }
    }

    #[test]
    fn no_point_of_a_fine_grid_lies_below_the_minimum() {
        for function in ALL {
            let problem = TestProblem::new(function, 2);
            let half = problem.half_width();
            for row in -200..=200 {
                for column in -200..=200 {
                    let point = [half * f64::from(row) / 200.0, half * f64::from(column) / 200.0];
                    let value: f64 = problem.evaluate(&point);
                    assert!(value >= problem.minimum() - 1e-9, "{function:?} {point:?}: {value}");
                }
            }
        }
    }

    #[test]
    fn the_rotation_keeps_lengths() {
        // A reflection: Ackley's first term depends on the length only. Two points equally far from the
        // centre differ in the cosines alone, by at most e - 1/e.
        let problem = TestProblem::new(TestFunction::ShiftedRotatedAckley, 30);
        let centre = minimiser(TestFunction::ShiftedRotatedAckley, 30);
        let plain = TestProblem::new(TestFunction::Ackley, 30);
        for axis in 0..30 {
            let mut point = centre.clone();
            point[axis] += 9.0;
            let mut origin = [0.0; 30];
            origin[axis] = 9.0;
            let difference: f64 = problem.evaluate(&point) - plain.evaluate(&origin);
            assert!((0.0..E - 1.0 / E).contains(&difference), "{difference}");
        }
    }

    #[test]
    fn single_precision_follows_double_precision() {
        for function in ALL {
            let problem = TestProblem::new(function, 10);
            let point: Vec<f64> = (0..10).map(|i| 0.5 + 0.25 * f64::from(i)).collect();
            let single: Vec<f32> = point.iter().map(|x| *x as f32).collect();
            let n = Objective::<f64>::dimension(&problem);
            let double: f64 = problem.evaluate(&point[..n]);
            let single: f32 = problem.evaluate(&single[..n]);
            // A few tens of single-precision roundings of the largest term.
            let scale = 1e-5 * (1.0 + abs(double));
            assert!(abs(f64::from(single) - double) < scale, "{function:?}: {single} {double}");
        }
    }
}
