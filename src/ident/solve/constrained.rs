//! Least squares within a box: the reference optimum for the swarm.
//!
//! ```text
//! minimise |R p - z|^2   subject to   low <= p <= high
//! ```
//!
//! Active-set method for bounded variables (Stark and Parker 1995). Parameters at a bound are held while the
//! rest are solved. The step to that solution is cut where it meets a bound. A held parameter is freed where
//! the gradient points inside. The cost is convex, so the optimum found is the global one.
//!
//! Cost: a few restricted factors of `B` columns. Bounded: at most `10 B` changes of the active set.

use crate::ident::record::factor::Factor;
use crate::real::{self, Real};

/// Bounds of up to `B` parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterBox<T, const B: usize> {
    /// Smallest values.
    pub low: [T; B],
    /// Largest values.
    pub high: [T; B],
}

/// Parameters in the box with the smallest `|R p - z|^2`, for the first `count` columns.
///
/// Parameters without information get the value nearest to zero in the box.
pub fn least_squares_in_box<T: Real, const B: usize>(
    factor: &Factor<T, B>,
    count: usize,
    bounds: &ParameterBox<T, B>,
) -> [T; B] {
    let count = count.min(B);
    let unbounded = factor.solve(count);
    let mut values = [T::zero(); B];
    let mut held = [false; B];
    for index in 0..count {
        values[index] = real::clamp(unbounded[index], bounds.low[index], bounds.high[index]);
        held[index] = values[index] != unbounded[index];
    }
    for _ in 0..10 * B {
        if !step_to_free_solution(factor, count, bounds, &mut values, &mut held)
            && !release_one(factor, count, bounds, &values, &mut held)
        {
            break;
        }
    }
    values
}

/// Moves the free parameters towards their optimum; true when a bound stopped them.
#[inline(never)]
fn step_to_free_solution<T: Real, const B: usize>(
    factor: &Factor<T, B>,
    count: usize,
    bounds: &ParameterBox<T, B>,
    values: &mut [T; B],
    held: &mut [bool; B],
) -> bool {
    let mut free = [0; B];
    let mut free_count = 0;
    for index in (0..count).filter(|&index| !held[index]) {
        free[free_count] = index;
        free_count += 1;
    }
    let free = free.get(..free_count).unwrap_or(&[]);
    let solution = factor.restricted(free, values, T::one()).solve(free_count);
    let mut share = T::one();
    let mut stopped = None;
    for (&index, &target) in free.iter().zip(&solution) {
        let bound = if target > bounds.high[index] {
            bounds.high[index]
        } else if target < bounds.low[index] {
            bounds.low[index]
        } else {
            continue;
        };
        let possible = (bound - values[index]) / (target - values[index]);
        if possible < share {
            share = real::max(possible, T::zero());
            stopped = Some((index, bound));
        }
    }
    for (&index, &target) in free.iter().zip(&solution) {
        let moved = values[index] + share * (target - values[index]);
        values[index] = real::clamp(moved, bounds.low[index], bounds.high[index]);
    }
    if let Some((index, bound)) = stopped {
        values[index] = bound;
        held[index] = true;
    }
    stopped.is_some()
}

/// Frees the held parameter that gains most by moving inside; false when none gains.
#[inline(never)]
fn release_one<T: Real, const B: usize>(
    factor: &Factor<T, B>,
    count: usize,
    bounds: &ParameterBox<T, B>,
    values: &[T; B],
    held: &mut [bool; B],
) -> bool {
    let gradient = gradient(factor, values);
    let mut best: Option<(usize, T)> = None;
    for index in (0..count).filter(|&index| held[index]) {
        let downhill = -gradient[index];
        let inside = (values[index] <= bounds.low[index] && downhill > T::zero())
            || (values[index] >= bounds.high[index] && downhill < T::zero());
        // Gain of moving this parameter alone: g^2 / |column|^2. Rounding stays below this share of the cost.
        let length = factor.column_length(index);
        let gain = if length > T::zero() { real::abs(downhill) / length } else { T::zero() };
        let least = T::EPSILON * T::from_double(100.0) * (T::one() + real::sqrt(factor.excess(values)));
        if inside && gain > least && best.is_none_or(|(_, most)| gain > most) {
            best = Some((index, gain));
        }
    }
    if let Some((index, _)) = best {
        held[index] = false;
    }
    best.is_some()
}

/// `R' (R p - z)`.
#[inline(never)]
fn gradient<T: Real, const B: usize>(factor: &Factor<T, B>, values: &[T; B]) -> [T; B] {
    let mut gradient = [T::zero(); B];
    for (row, &right) in factor.triangle().iter().zip(factor.right()) {
        let error = row.iter().zip(values).fold(-right, |sum, (&element, &value)| sum + element * value);
        for (slot, &element) in gradient.iter_mut().zip(row) {
            *slot += element * error;
        }
    }
    gradient
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRandom;

    #[test]
    fn no_feasible_point_is_better_than_the_constrained_optimum() {
        let mut random = TestRandom::new(11);
        let mut active = 0;
        for _ in 0..200 {
            let mut factor = Factor::<f64, 6>::new();
            for _ in 0..30 {
                let row = core::array::from_fn(|_| random.within(1.0));
                factor.insert(&row, 3.0 * random.within(1.0) + row[2]);
            }
            let bounds = ParameterBox {
                low: core::array::from_fn(|_| -0.5 + 0.4 * random.within(1.0)),
                high: core::array::from_fn(|_| 0.5 + 0.4 * random.within(1.0)),
            };
            let best = least_squares_in_box(&factor, 6, &bounds);
            let slope = gradient(&factor, &best);
            for index in 0..6 {
                let at_low = best[index] <= bounds.low[index];
                let at_high = best[index] >= bounds.high[index];
                active += usize::from(at_low || at_high);
                // Karush-Kuhn-Tucker: zero slope inside, outward downhill at a bound.
                assert!(best[index] >= bounds.low[index] && best[index] <= bounds.high[index]);
                let slope = slope[index];
                assert!(slope.abs() < 1e-9 || at_low && slope > 0.0 || at_high && slope < 0.0);
            }
        }
        assert!(active > 100, "the bounds must matter in this test: {active}");
    }
}
