//! Learned metric of the adaptive beetle swarm: a matrix A with A A^T ~ H^-1 up to scale, and its inverse.
//!
//! Why: in a badly scaled cost a step that suits one direction is far too long or too short in another.
//! In metric coordinates, y = A^-1 u, the cost should be equally curved in all directions. The method
//! needs no covariance and no eigenproblem: every round stretches A along the directions in which
//! curvature was just measured.
//!
//! Stretch by al along a unit vector z of metric coordinates, exactly rank 1, likewise for the inverse:
//!   A = A + (al - 1) (A z) z^T,    A^-1 = A^-1 + z (1/al - 1) (z^T A^-1)
//! Several stretches along orthonormal z commute. They leave A z and A^-T z of the others unchanged, so both
//! are known since the frame was made.
//!
//! Source: own experiments; the idea is that of a variable metric (Davidon, 1959) fed by measured curvature.
//! Cost: 4 D^2 operations per stretch, 2 D^2 per product; memory 2 D^2 scalars.
//! Known limits: a stretch that is not finite would corrupt the metric permanently; the caller passes none.

use crate::real::{Real, dot};

use super::super::rows::{add_scaled, live, live_mut};

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Metric<T, const D: usize> {
    dimension: usize,
    /// Matrix A: metric to box coordinates.
    shape: [[T; D]; D],
    inverse: [[T; D]; D],
}

impl<T: Real, const D: usize> Metric<T, D> {
    /// Starts with box coordinates.
    pub(crate) fn identity(dimension: usize) -> Self {
        let mut metric = Self { dimension, shape: [[T::zero(); D]; D], inverse: [[T::zero(); D]; D] };
        metric.forget();
        metric
    }

    /// Resets to box coordinates.
    pub fn forget(&mut self) {
        self.scale(&[T::one(); D]);
    }

    /// Resets to box coordinates over these positive lengths.
    pub fn scale(&mut self, lengths: &[T; D]) {
        let rows = self.shape.iter_mut().zip(&mut self.inverse).zip(lengths);
        for (index, ((shape, inverse), &length)) in rows.enumerate() {
            (*shape, *inverse) = ([T::zero(); D], [T::zero(); D]);
            (shape[index], inverse[index]) = (length, T::one() / length);
        }
    }

    /// Product A z: a displacement in box coordinates.
    pub(crate) fn to_box(&self, z: &[T; D]) -> [T; D] {
        product(&self.shape, z, self.dimension)
    }

    /// Product A^-1 u: the metric coordinates of a point or displacement.
    pub(crate) fn to_metric(&self, u: &[T; D]) -> [T; D] {
        product(&self.inverse, u, self.dimension)
    }

    /// Product A^T g: converts a gradient from box to metric coordinates.
    pub(crate) fn gradient_to_metric(&self, g: &[T; D]) -> [T; D] {
        transposed_product(&self.shape, g, self.dimension)
    }

    /// Product A^-T g: converts a gradient from metric to box coordinates.
    pub(crate) fn gradient_to_box(&self, g: &[T; D]) -> [T; D] {
        transposed_product(&self.inverse, g, self.dimension)
    }

    /// Stretches by `factor` along the unit vector `z`, where `displacement` = A z and `covector` = A^-T z.
    pub(crate) fn stretch(&mut self, z: &[T; D], displacement: &[T; D], covector: &[T; D], factor: T) {
        let dimension = self.dimension;
        let (longer, shorter) = (factor - T::one(), T::one() / factor - T::one());
        let (z, covector) = (live(z, dimension), live(covector, dimension));
        let rows = self.shape.iter_mut().zip(&mut self.inverse);
        for (((shape, inverse), &moved), &along) in rows.zip(displacement).zip(z) {
            add_scaled(live_mut(shape, dimension), longer * moved, z);
            add_scaled(live_mut(inverse, dimension), shorter * along, covector);
        }
    }
}

fn product<T: Real, const D: usize>(matrix: &[[T; D]; D], vector: &[T; D], dimension: usize) -> [T; D] {
    let mut result = [T::zero(); D];
    let vector = live(vector, dimension);
    for (entry, row) in live_mut(&mut result, dimension).iter_mut().zip(matrix) {
        *entry = dot(live(row, dimension), vector);
    }
    result
}

fn transposed_product<T: Real, const D: usize>(
    matrix: &[[T; D]; D],
    vector: &[T; D],
    dimension: usize,
) -> [T; D] {
    let mut result = [T::zero(); D];
    for (&factor, row) in live(vector, dimension).iter().zip(matrix) {
        add_scaled(live_mut(&mut result, dimension), factor, live(row, dimension));
    }
    result
}

#[cfg(test)]
mod tests {
    use super::super::super::random::Random;
    use super::*;
    use crate::real::{abs, sqrt};

    const D: usize = 7;

    fn unit(random: &mut Random, dimension: usize) -> [f64; D] {
        let mut z = [0.0; D];
        for entry in &mut z[..dimension] {
            *entry = random.bell();
        }
        let length = sqrt(dot(&z, &z));
        z.map(|entry| entry / length)
    }

    #[test]
    fn inverse_follows_hundreds_of_stretches() {
        let mut random = Random::new(1);
        for dimension in [1, 4, D] {
            let mut metric = Metric::<f64, D>::identity(dimension);
            for round in 0..300 {
                let z = unit(&mut random, dimension);
                let factor = if round % 2 == 0 { 1.3 } else { 1.0 / 1.3 };
                metric.stretch(&z, &metric.to_box(&z), &metric.gradient_to_box(&z), factor);
            }
            let u = unit(&mut random, dimension);
            let back = metric.to_box(&metric.to_metric(&u));
            // 300 updates in double precision, condition number below 1e3.
            assert!(u.iter().zip(&back).all(|(a, b)| abs(a - b) < 1e-9), "{u:?} {back:?}");
        }
    }

    #[test]
    fn a_stretch_scales_its_own_direction_and_leaves_orthogonal_ones() {
        let mut random = Random::new(2);
        let mut metric = Metric::<f64, D>::identity(5);
        let z = unit(&mut random, 5);
        metric.stretch(&z, &z, &z, 3.0);
        let mut other = unit(&mut random, 5);
        let along = dot(&other, &z);
        add_scaled(&mut other, -along, &z);
        for (before, factor) in [(z, 3.0), (other, 1.0)] {
            let after = metric.to_box(&before);
            assert!(before.iter().zip(&after).all(|(a, b)| abs(factor * a - b) < 1e-14));
        }
    }

    #[test]
    fn transposed_products_are_the_adjoints() {
        let mut random = Random::new(3);
        let mut metric = Metric::<f64, D>::identity(6);
        for _ in 0..4 {
            let z = unit(&mut random, 6);
            metric.stretch(&z, &metric.to_box(&z), &metric.gradient_to_box(&z), 1.7);
        }
        let (z, g) = (unit(&mut random, 6), unit(&mut random, 6));
        assert!(abs(dot(&g, &metric.to_box(&z)) - dot(&metric.gradient_to_metric(&g), &z)) < 1e-14);
        assert!(abs(dot(&g, &metric.to_metric(&z)) - dot(&metric.gradient_to_box(&g), &z)) < 1e-14);
    }
}
