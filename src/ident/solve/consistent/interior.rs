//! One step of the interior-point method in square-root form: every constraint is a row of the factor.
//!
//! ```text
//! G(y) = F(y) + 2 mu phi(y),    phi = -sum ln det P_link - sum ln slack
//! step:  minimise  |A d - (b - A y)|^2 + mu (2 dphi . d + d2phi(d))
//! slack s with gradient g:      row sqrt(mu) g / s,          right sqrt(mu)
//! pseudo-inertia:               rows sqrt(mu) M_ii,          right sqrt(mu);      sqrt(2 mu) M_ij, right 0
//! ```
//!
//! Without normal equations single precision keeps its digits. `phi` is self-concordant (Nesterov and
//! Nemirovskii 1994): damped Newton steps converge from any point inside. At the minimum of `G` the cost is
//! at most `mu` times the number of barriers above the constrained minimum.
//!
//! Cost: 27 rows a joint into a factor of `14 N` columns, about 100,000 multiplications for two joints.

use super::cost::{LegCost, add_scaled, zeros};
use super::limits::{CONDITIONS, Limits};
use super::pseudo_inertia::Factored;
use crate::model::{LegParameters, PARAMETERS_PER_JOINT};
use crate::real::{self, Real};

/// Most halvings of a step until it stays inside and raises the merit by no more than rounding.
const HALVINGS: usize = 24;

/// `G` at `point`; `None` outside.
pub(super) fn merit<T: Real, const N: usize>(
    cost: &LegCost<T, N>,
    limits: &Limits<T, N>,
    point: &LegParameters<T, N>,
    barrier: T,
) -> Option<T> {
    let parameters = cost.parameters(point);
    if !Limits::consistent(&parameters) {
        return None;
    }
    let mut sum = T::zero();
    for (link, joint) in limits.links.iter().zip(&parameters) {
        sum -= Factored::new(joint)?.log_determinant;
        for condition in (0..CONDITIONS).filter_map(|index| link.condition(index)) {
            let slack = condition.slack(joint);
            if !(slack > T::zero()) {
                return None;
            }
            sum -= real::ln(slack);
        }
    }
    let merit = cost.excess(point) + T::from_double(2.0) * barrier * sum;
    real::is_finite(merit).then_some(merit)
}

pub(super) struct Step {
    /// `point` minimises `G`, within what matters or can be resolved.
    pub(crate) settled: bool,
    /// False where the start has no finite merit: outside, or overflow. Such a step is not a valid end.
    pub(crate) inside: bool,
}

/// Decrement, in units of the barrier, below which a point counts as the minimum. The cost is then within a
/// twentieth of `mu` of the minimum.
const SETTLED: f64 = 0.05;

/// Takes one damped Newton step from `point`, which must be inside.
#[inline(never)]
pub(super) fn step<T: Real, const N: usize>(
    cost: &LegCost<T, N>,
    limits: &Limits<T, N>,
    point: &mut LegParameters<T, N>,
    barrier: T,
) -> Step {
    let mut newton = cost.clone();
    newton.shift(point);
    insert_barriers(&mut newton, limits, point, barrier);
    let direction = newton.solve();
    let decrement = newton.right_squared() / barrier;
    let Some(before) = merit(cost, limits, point, barrier) else {
        return Step { settled: true, inside: false };
    };
    let largest = before + T::from_double(8.0) * T::EPSILON * real::abs(before);
    let mut share = T::one();
    for _ in 0..HALVINGS {
        let mut tried = *point;
        add_scaled(&mut tried, &direction, share);
        if merit(cost, limits, &tried, barrier).is_some_and(|after| after <= largest) {
            *point = tried;
            return Step { settled: decrement < T::from_double(SETTLED), inside: true };
        }
        share *= T::from_double(0.5);
    }
    // Rounding hides any further decrease.
    Step { settled: true, inside: true }
}

fn insert_barriers<T: Real, const N: usize>(
    newton: &mut LegCost<T, N>,
    limits: &Limits<T, N>,
    point: &LegParameters<T, N>,
    barrier: T,
) {
    let parameters = newton.parameters(point);
    let scale = *newton.scale();
    let weight = real::sqrt(barrier);
    for (number, (link, joint)) in limits.links.iter().zip(&parameters).enumerate() {
        let Some(scale) = scale.get(number) else { continue };
        let mut insert = |entries: [T; PARAMETERS_PER_JOINT], right: T| {
            let mut row = zeros(T::zero());
            if let Some(slot) = row.get_mut(number) {
                *slot = entries;
            }
            newton.insert(&mut row, right);
        };
        for condition in (0..CONDITIONS).filter_map(|index| link.condition(index)) {
            let slack = condition.slack(joint);
            let mut entries = condition.gradient;
            for (entry, &scale) in entries.iter_mut().zip(scale) {
                *entry *= weight * scale / slack;
            }
            insert(entries, weight);
        }
        let Some(body) = Factored::new(joint) else { continue };
        for (index, row) in body.rows(scale).iter().enumerate() {
            let mut entries = [T::zero(); PARAMETERS_PER_JOINT];
            for (entry, &element) in entries.iter_mut().zip(row) {
                *entry = weight * element;
            }
            insert(entries, if index < 4 { weight } else { T::zero() });
        }
    }
}
