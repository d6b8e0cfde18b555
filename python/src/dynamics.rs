//! Torques and regressors of many states, on all cores.

use nalgebra::Vector3;
use rayon::prelude::*;
use scarab::model::{
    AnatomicalJoint, Chain, JointState, LegParameters, PARAMETERS_PER_JOINT, joint_torques, regressor,
};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::geometry::chain;
use scarab_identify::leg::states::Angles;

/// States below which one core is faster.
const LEAST_PARALLEL: usize = 256;

/// Angles, speeds and accelerations: rows of as many numbers as the leg has joints.
pub struct States {
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub qdd: Vec<f64>,
}

/// Leg prepared for its dynamics.
pub struct Dynamics<const N: usize> {
    chain: Chain<f64, N>,
    gravity: Vector3<f64>,
    to_chain: [AnatomicalJoint<f64>; N],
}

impl<const N: usize> Dynamics<N> {
    pub fn new(leg: &LegFile, angles: Angles) -> Result<Self, ToolError> {
        Ok(Self { chain: chain(leg)?, gravity: Vector3::from(leg.gravity), to_chain: angles.to_chain(leg)? })
    }

    /// State of one sample in the chain's angles.
    pub fn state(&self, states: &States, sample: usize) -> JointState<f64, N> {
        let at = |numbers: &[f64], joint: usize| numbers[sample * N + joint];
        JointState {
            q: core::array::from_fn(|joint| self.to_chain[joint].angle_to_chain(at(&states.q, joint))),
            qd: core::array::from_fn(|joint| self.to_chain[joint].to_chain(at(&states.qd, joint))),
            qdd: core::array::from_fn(|joint| self.to_chain[joint].to_chain(at(&states.qdd, joint))),
        }
    }

    /// Torque of a joint in the sign of the given angles.
    pub fn outside(&self, joint: usize, torque: f64) -> f64 {
        self.to_chain[joint].from_chain(torque)
    }

    /// Regressors: for each sample a row for each torque, with `columns` numbers for each link.
    pub fn regressors(&self, states: &States, columns: usize) -> Vec<f64> {
        let columns = columns.min(PARAMETERS_PER_JOINT);
        let samples = states.q.len() / N;
        let width = N * N * columns;
        let mut out = vec![0.0; samples * width];
        let fill = |(sample, out): (usize, &mut [f64])| {
            let rows = regressor(&self.chain, &self.state(states, sample), &self.gravity);
            for (joint, (row, out)) in rows.iter().zip(out.chunks_exact_mut(N * columns)).enumerate() {
                for (link, out) in row.iter().zip(out.chunks_exact_mut(columns)) {
                    for (element, out) in link.iter().zip(out) {
                        *out = self.outside(joint, *element);
                    }
                }
            }
        };
        each(&mut out, width, samples, fill);
        out
    }

    /// Torques of a leg with these parameters.
    pub fn torques(&self, states: &States, parameters: &LegParameters<f64, N>) -> Vec<f64> {
        let samples = states.q.len() / N;
        let mut out = vec![0.0; samples * N];
        let fill = |(sample, out): (usize, &mut [f64])| {
            let state = self.state(states, sample);
            let torques = joint_torques(&self.chain, parameters, &state, &self.gravity);
            for (joint, (out, torque)) in out.iter_mut().zip(torques).enumerate() {
                *out = self.outside(joint, torque);
            }
        };
        each(&mut out, N, samples, fill);
        out
    }
}

/// Fills the part of every sample.
fn each(out: &mut [f64], width: usize, samples: usize, fill: impl Fn((usize, &mut [f64])) + Sync + Send) {
    if samples < LEAST_PARALLEL {
        out.chunks_exact_mut(width).enumerate().for_each(fill);
    } else {
        out.par_chunks_exact_mut(width).enumerate().with_min_len(LEAST_PARALLEL).for_each(fill);
    }
}
