//! Tests whether a body with these parameters can exist, as far as base parameters show.

use nalgebra::{SMatrix, Vector3};

use super::{Reason, Test, Thresholds, VerdictBuilder};
use crate::ident::record::choice::Constant;
use crate::ident::record::motion_record::Record;
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::completion::is_weak;
use crate::ident::solve::estimate::Estimate;
use crate::ident::solve::solver::Consistency;
use crate::model::{JointState, PARAMETERS_PER_JOINT, Parameter, mass_matrix, regressor};
use crate::real::{self, Real};

impl<T: Real> Thresholds<T> {
    /// Judges signs: no negative friction, rotor inertia, mass or kinetic energy
    /// beyond noise; all values finite.
    pub fn judge_physics<const N: usize, const B: usize>(
        &self,
        model: &RowModel<T, N, B>,
        record: &Record<T, N, B>,
        estimate: &Estimate<T, B>,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        let mut worst = [T::zero(); N];
        for base in 0..model.base.rank() {
            let Some((joint, parameter)) = model.base.independent(base) else { continue };
            let (value, sigma) = (estimate.values[base], estimate.sigma(base).unwrap_or(T::zero()));
            if !real::is_finite(value) {
                builder.at_most(
                    Reason::Unphysical,
                    Test::Finite,
                    Some(joint),
                    None,
                    real::abs(value),
                    T::LARGEST,
                );
            }
            if parameter.is_never_negative()
                && !is_weak(record, estimate, base)
                && sigma > T::zero()
                && let Some(worst) = worst.get_mut(joint)
            {
                *worst = real::max(*worst, -value / sigma);
            }
        }
        for (joint, worst) in worst.iter_mut().enumerate() {
            *worst = real::max(*worst, negative_direction_of_friction(model, estimate, joint));
        }
        let limit = self.largest_negative_sigmas;
        for (joint, &sigmas) in worst.iter().enumerate() {
            builder.at_most(Reason::Unphysical, Test::NegativeParameter, Some(joint), None, sigmas, limit);
        }
        let energy = self.negative_energy(model, estimate);
        builder.at_most(
            Reason::Unphysical,
            Test::NegativeEnergy,
            None,
            None,
            energy,
            self.largest_negative_sigmas,
        );
    }

    /// Judges the loss of fit of the physically consistent leg against least squares. Beyond the noise of its
    /// degrees of freedom, the data contradict every leg that the prior allows.
    pub(crate) fn judge_consistency(
        &self,
        consistency: &Consistency<T>,
        builder: &mut VerdictBuilder<'_, T>,
    ) {
        let limit = self.chance(T::from_double(consistency.degrees_of_freedom as f64));
        builder.at_most(Reason::Unphysical, Test::PriorBox, None, None, consistency.excess, limit);
    }

    /// Largest negative kinetic energy `v' M(q) v / 2` over postures all over the circle, in standard
    /// deviations; zero where it is never negative.
    fn negative_energy<const N: usize, const B: usize>(
        &self,
        model: &RowModel<T, N, B>,
        estimate: &Estimate<T, B>,
    ) -> T {
        let parameters = model.base.complete(&estimate.values, &[[T::zero(); PARAMETERS_PER_JOINT]; N]);
        (0..POSTURES).fold(T::zero(), |worst, index| {
            let q = posture(index);
            let mass = mass_matrix(&model.chain, &parameters, &q);
            let Some((direction, energy)) = negative_direction(&mass) else { return worst };
            let sigma = estimate.sigma_of(&energy_weights(model, q, &direction));
            real::max(worst, -energy / real::max(sigma, T::EPSILON))
        })
    }
}

/// Negative excess of Coulomb friction in its lower direction, in standard
/// deviations, for asymmetric friction.
fn negative_direction_of_friction<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    estimate: &Estimate<T, B>,
    joint: usize,
) -> T {
    let is_asymmetric = model.drive_choice[joint].meaning == Constant::Asymmetry;
    let (Some(level), Some(half), true) =
        (model.drive(joint, Parameter::FC), model.drive(joint, Parameter::OFF), is_asymmetric)
    else {
        return T::zero();
    };
    let mut weights = [T::zero(); B];
    (weights[level], weights[half]) = (T::one(), -real::sign(estimate.values[half]));
    let lower = estimate.values[level] - real::abs(estimate.values[half]);
    let sigma = estimate.sigma_of(&weights);
    if sigma > T::zero() { -lower / sigma } else { T::zero() }
}

const POSTURES: usize = 16;

/// Direction `v` with negative `v' M v`, and that value; `None` for a positive matrix.
///
/// With `M = L D L'` and a negative pivot `D_k`, `v = L^-T e_k` gives `v' M v = D_k`.
fn negative_direction<T: Real, const N: usize>(matrix: &SMatrix<T, N, N>) -> Option<([T; N], T)> {
    let mut lower = [[T::zero(); N]; N];
    let mut pivots = [T::zero(); N];
    for column in 0..N {
        let mut pivot = matrix[(column, column)];
        for inner in 0..column {
            pivot -= lower[column][inner] * lower[column][inner] * pivots[inner];
        }
        if !(pivot > T::zero()) {
            let mut direction = [T::zero(); N];
            direction[column] = T::one();
            for row in (0..column).rev() {
                for inner in row + 1..=column {
                    direction[row] -= lower[inner][row] * direction[inner];
                }
            }
            return Some((direction, pivot));
        }
        pivots[column] = pivot;
        for row in column + 1..N {
            let mut element = matrix[(row, column)];
            for inner in 0..column {
                element -= lower[row][inner] * lower[column][inner] * pivots[inner];
            }
            lower[row][column] = element / pivot;
        }
    }
    None
}

/// Low-discrepancy postures over the whole circle of every joint.
fn posture<T: Real, const N: usize>(index: usize) -> [T; N] {
    core::array::from_fn(|joint| {
        // Multiples of the golden ratio's powers in units of 2^-32 turns (Kronecker sequence).
        let step = [2_654_435_769_u32, 1_640_531_527, 1_013_904_243][joint % 3];
        let turn = (index as u32).wrapping_add(1).wrapping_mul(step) ^ (1 << 31);
        T::from_double(f64::from(turn.cast_signed()))
            * T::from_double(core::f64::consts::PI / 2_147_483_648.0)
    })
}

/// Weights of the base parameters in twice the kinetic energy at speed `direction`.
fn energy_weights<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    q: [T; N],
    direction: &[T; N],
) -> [T; B] {
    let moving = JointState { q, qd: [T::zero(); N], qdd: *direction };
    let rows = regressor(&model.chain, &moving, &Vector3::zeros());
    let mut weights = [T::zero(); B];
    for (row, &share) in rows.iter().zip(direction) {
        let mut selected = [T::zero(); B];
        model.base.select(row, &mut selected);
        for (base, (weight, &element)) in weights.iter_mut().zip(&selected).enumerate() {
            let at_rest = !matches!(model.base.independent(base), Some((_, Parameter::OFF)));
            if at_rest {
                *weight += share * element;
            }
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use super::super::Evidence;
    use super::*;
    use crate::ident::record::factor::Factor;
    use crate::ident::record::motion_record::TorqueSize;
    use crate::ident::solve::testing::{ALL, B as BASE, planar};

    /// Number of sigma by which joint 0's friction is negative, with these values and a sigma of 0.1 each.
    fn negative(level: f32, half: f32, meaning: Constant) -> f32 {
        let mut model = planar::<f32, 2>(0.45, &ALL);
        model.drive_choice[0].meaning = meaning;
        let torque = [TorqueSize { mean_absolute: 10.0, root_mean_square: 10.0, speed: 1.0 }; 2];
        let plain = Record::plain([Factor::new(), Factor::new()], torque, 100);
        let record = Record::<f32, 2, BASE> { noise: [0.1; 2], ..plain };
        let mut estimate = Estimate::<f32, BASE>::nothing();
        estimate.determined = [true; BASE];
        (0..BASE).for_each(|base| estimate.covariance[base][base] = 0.01);
        let index = |parameter| model.drive(0, parameter).expect("a base parameter");
        estimate.values[index(Parameter::FC)] = level;
        estimate.values[index(Parameter::OFF)] = half;
        let mut seen = 0.0;
        let mut note = |evidence: &Evidence<f32>| {
            if (evidence.test, evidence.joint) == (Test::NegativeParameter, Some(0)) {
                seen = evidence.value;
            }
        };
        Thresholds::default().judge_physics(&model, &record, &estimate, &mut VerdictBuilder::new(&mut note));
        seen
    }

    #[test]
    fn negative_friction_is_judged_in_its_sigma_and_in_each_direction() {
        assert!((negative(-1.0, 0.0, Constant::Offset) - 10.0).abs() < 1e-3);
        assert_eq!(negative(1.0, 1.5, Constant::Offset), 0.0);
        // Half the difference between both directions: the lower one is -0.5, with sigma 0.1 sqrt(2).
        for half in [1.5, -1.5] {
            assert!((negative(1.0, half, Constant::Asymmetry) - 3.5355).abs() < 1e-3);
        }
        assert_eq!(negative(1.0, 0.5, Constant::Asymmetry), 0.0);
    }

    #[test]
    fn a_negative_direction_has_the_reported_energy_and_a_positive_matrix_none() {
        // L D L' with ones on the diagonal of L: the first pivot that is not positive is D's.
        let lower = SMatrix::<f64, 3, 3>::new(1.0, 0.0, 0.0, 0.5, 1.0, 0.0, -2.0, 3.0, 1.0);
        for (pivots, expected) in [
            ([2.0, 0.5, 4.0], None),
            ([2.0, 0.5, -0.25], Some(-0.25)),
            ([2.0, -0.5, 4.0], Some(-0.5)),
            ([-3.0, 0.5, 4.0], Some(-3.0)),
            ([2.0, 0.0, 4.0], Some(0.0)),
        ] {
            let matrix = lower * SMatrix::from_diagonal(&Vector3::from(pivots)) * lower.transpose();
            let found = negative_direction(&matrix);
            assert_eq!(found.map(|(_, energy)| energy), expected);
            if let Some((direction, energy)) = found {
                let direction = Vector3::from(direction);
                let own = direction.dot(&(matrix * direction));
                assert!((own - energy).abs() < 1e-12, "{own} {energy}");
                assert!(direction.norm() >= 1.0);
            }
        }
    }
}
