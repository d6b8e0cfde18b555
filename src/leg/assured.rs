//! Lower confidence bounds of friction and inertia, for the assistance.
//!
//! ```text
//! FC_low = max(FC - 2 sigma, 0),   FV_low likewise            of parameters that were measured alone
//! k      = min over 16 postures q and 4 directions u of  1 - 2 sigma(u' M u) / (u' M u),  at least 0
//! u' M u = sum_j u_j y_j(q, 0, u) p,    y_j regressor without gravity,    sigma^2 = y Cov y'
//! ```
//!
//! Compensating the share k of M gives in none of these postures and directions more inertia than the leg
//! has, with the confidence of 2 sigma. Directions: each joint alone and each pair together and against each
//! other. Postures: sixteen angles of every joint but the first, on which M does not depend.
//!
//! Cost: some 300,000 instructions for two joints, once for each accepted model.

use crate::assist::Assured;
use crate::ident::{Estimate, RowModel};
use crate::model::{JointState, Parameter, Standing, regressor};
use crate::real::{dot, max, min};
use nalgebra::Vector3;

/// Postures per turn.
const POSTURES: usize = 16;
/// Standard deviations below the estimate.
const SIGMAS: f32 = 2.0;

/// Bounds of an estimate; zero for a parameter that was not measured alone.
pub fn assured<const N: usize, const B: usize>(
    model: &RowModel<f32, N, B>,
    estimate: &Estimate<f32, B>,
) -> Assured<N> {
    let bound = |joint: usize, parameter: Parameter| match model.base.standing(joint, parameter) {
        Standing::Alone(base) => {
            let value = estimate.values.get(base).copied().unwrap_or(0.0);
            estimate.sigma(base).map_or(0.0, |sigma| max(value - SIGMAS * sigma, 0.0))
        }
        _ => 0.0,
    };
    Assured {
        coulomb_nm: core::array::from_fn(|joint| bound(joint, Parameter::FC)),
        viscous: core::array::from_fn(|joint| bound(joint, Parameter::FV)),
        inertia_share: inertia_share(model, estimate),
    }
}

fn inertia_share<const N: usize, const B: usize>(
    model: &RowModel<f32, N, B>,
    estimate: &Estimate<f32, B>,
) -> f32 {
    let mut share = 1.0;
    for posture in 0..POSTURES {
        let angle = core::f32::consts::TAU * posture as f32 / POSTURES as f32;
        for one in 0..N {
            for other in one..N {
                for sign in [1.0, -1.0] {
                    let mut direction = [0.0; N];
                    direction[one] = 1.0;
                    if other != one {
                        direction[other] = sign;
                    }
                    share = min(share, certain_share(model, estimate, angle, &direction));
                }
            }
        }
    }
    max(share, 0.0)
}

/// Certain share of the inertia in one posture and direction; zero without an inertia.
fn certain_share<const N: usize, const B: usize>(
    model: &RowModel<f32, N, B>,
    estimate: &Estimate<f32, B>,
    angle: f32,
    direction: &[f32; N],
) -> f32 {
    let state = JointState { q: [angle; N], qd: [0.0; N], qdd: *direction };
    let full = regressor(&model.chain, &state, &Vector3::new(0.0, 0.0, 0.0));
    let mut weights = [0.0; B];
    for joint in 0..N {
        let mut row = full[joint];
        for own in &mut row {
            // Friction and offset are no inertia.
            for parameter in [Parameter::FC, Parameter::FV, Parameter::OFF] {
                own[parameter.index()] = 0.0;
            }
        }
        let mut selected = [0.0; B];
        model.base.select(&row, &mut selected);
        for (weight, column) in weights.iter_mut().zip(selected) {
            *weight += direction[joint] * column;
        }
    }
    let inertia = dot(&weights, &estimate.values);
    if inertia > 0.0 { 1.0 - SIGMAS * estimate.sigma_of(&weights) / inertia } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leg::testing::{BASE, LEG, configuration};
    use crate::model::LegParameters;

    /// The leg's prior as base values.
    fn values() -> (RowModel<f32, 2, BASE>, LegParameters<f32, 2>, [f32; BASE]) {
        let configuration = configuration();
        let mut parameters = [[0.0; 14]; 2];
        for (joint, (link, description)) in
            parameters.iter_mut().zip(LEG.prior.expect("the shipped leg has a prior")).enumerate()
        {
            let prior = configuration.prior.as_ref().expect("a prior")[joint];
            link[..10].copy_from_slice(&prior.body.to_parameters());
            link[10..].copy_from_slice(&[
                description.rotor_inertia,
                description.coulomb_friction,
                description.viscous_friction,
                description.offset,
            ]);
        }
        let values = configuration.model.base.project(&parameters);
        (configuration.model, parameters, values)
    }

    /// Estimate whose values all err together by one relative error.
    fn estimate(values: [f32; BASE], relative: f32) -> Estimate<f32, BASE> {
        let covariance = values.map(|one| values.map(|other| relative * relative * one * other));
        Estimate { values, covariance, determined: [true; BASE] }
    }

    #[test]
    fn exact_values_are_wholly_certain() {
        let (model, parameters, values) = values();
        let assured = assured(&model, &estimate(values, 0.0));
        assert!((assured.inertia_share - 1.0).abs() < 1e-6);
        for joint in 0..2 {
            assert!((assured.coulomb_nm[joint] - parameters[joint][Parameter::FC.index()]).abs() < 1e-5);
            assert!((assured.viscous[joint] - parameters[joint][Parameter::FV.index()]).abs() < 1e-5);
        }
    }

    #[test]
    fn a_sigma_of_a_tenth_leaves_eight_tenths() {
        let (model, parameters, values) = values();
        let assured = assured(&model, &estimate(values, 0.1));
        for joint in 0..2 {
            let friction = parameters[joint][Parameter::FC.index()];
            assert!((assured.coulomb_nm[joint] - 0.8 * friction).abs() < 1e-4);
        }
        // In every posture and direction, since all values err by the same share.
        assert!((assured.inertia_share - 0.8).abs() < 1e-3, "{}", assured.inertia_share);
    }

    #[test]
    fn a_parameter_within_two_sigma_of_zero_is_not_compensated() {
        let (model, _, values) = values();
        let assured = assured(&model, &estimate(values, 0.6));
        assert_eq!((assured.coulomb_nm, assured.viscous), ([0.0; 2], [0.0; 2]));
    }
}
