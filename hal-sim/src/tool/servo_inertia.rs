//! The inertia that a servo's gains are made for.
//!
//! The loop of one joint moves what the mass matrix has on its diagonal while the others are held, and less while they follow:
//! 1 / (M^-1)_ii. With heavy rotors both are much the same. Without rotors the knee of the default leg moves 0.63 kg m2 by
//! the diagonal and a quarter of that by the inverse, and gains made for the first have no phase margin left.
//!
//! ```text
//! J_i = min( max over postures M_ii ,  min over postures 1 / (M^-1)_ii / 0.7 )
//! ```

use nalgebra::Matrix3;
use scarab::ident::prior_parameters;
use scarab::model::{AnatomicalJoint, Chain, LegParameters, mass_matrix};

use super::leg_file::LegFile;
use super::setup::{SetupError, links};

/// Postures of each joint between the ends of its range at which the coupling of the joints is looked at.
const POSTURES_PER_JOINT: usize = 5;
/// Least share of the inertia in the servo's gains that a joint may show: the phase margin is some 40 degrees there
/// (`servo::controller`).
const LEAST_INERTIA_SHARE: f64 = 0.7;

/// Least inertia that each joint shows while the others follow freely, kg m2, over postures within the ranges: the
/// reciprocal of the diagonal of the inverse mass matrix. Light rotors couple the joints; then it is a small part of the
/// diagonal of the matrix itself.
fn least_inertia<const N: usize>(
    leg: &LegFile,
    anatomy: &[AnatomicalJoint<f64>; N],
    chain: &Chain<f64, N>,
    parameters: &LegParameters<f64, N>,
) -> [f64; N] {
    let mut least = [f64::INFINITY; N];
    for posture in 0..POSTURES_PER_JOINT.pow(N as u32) {
        let q = core::array::from_fn(|joint| {
            let step = posture / POSTURES_PER_JOINT.pow(joint as u32) % POSTURES_PER_JOINT;
            let [low, high] = leg.joints[joint].range_deg;
            let share = step as f64 / (POSTURES_PER_JOINT - 1) as f64;
            anatomy[joint].angle_to_chain((low + share * (high - low)).to_radians())
        });
        // Legs have three joints at most; the rows of joints that are not there are those of the unit matrix.
        let mass = mass_matrix(chain, parameters, &q);
        let mut padded = Matrix3::identity();
        for row in 0..N.min(3) {
            for column in 0..N.min(3) {
                padded[(row, column)] = mass[(row, column)];
            }
        }
        if let Some(mobility) = padded.try_inverse() {
            for joint in 0..N.min(3) {
                least[joint] = least[joint].min(1.0 / mobility[(joint, joint)]);
            }
        }
    }
    least
}

/// Largest inertia each joint moves, kg m2, over postures of the whole circle.
#[must_use]
fn largest_inertia<const N: usize>(chain: &Chain<f64, N>, parameters: &LegParameters<f64, N>) -> [f64; N] {
    let mut largest = [0.0_f64; N];
    for step in 0..64 {
        let q = core::array::from_fn(|joint| {
            f64::from(step) * core::f64::consts::TAU / 64.0 * (joint + 1) as f64
        });
        let mass = mass_matrix(chain, parameters, &q);
        for joint in 0..N {
            largest[joint] = largest[joint].max(mass[(joint, joint)]);
        }
    }
    largest
}

/// What the servo's gains follow, after the leg file's prior, else its truth: the largest inertia of each joint, unless the
/// joints are coupled so strongly that the least would leave no phase margin.
pub fn servo_inertia<const N: usize>(
    leg: &LegFile,
    anatomy: &[AnatomicalJoint<f64>; N],
    chain: &Chain<f64, N>,
) -> Result<[f64; N], SetupError> {
    let links = links::<N>(leg, |joint| joint.prior.as_ref().or(joint.truth.as_ref()))
        .ok_or_else(|| SetupError::new(leg, "neither prior nor truth tells how heavy the leg is"))?;
    let parameters = prior_parameters(&links);
    let largest = largest_inertia(chain, &parameters);
    let least = least_inertia(leg, anatomy, chain, &parameters);
    Ok(core::array::from_fn(|joint| {
        let bound = least[joint] / LEAST_INERTIA_SHARE;
        if bound > 0.0 { largest[joint].min(bound) } else { largest[joint] }
    }))
}
