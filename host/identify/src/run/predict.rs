//! `predict`: torque of given states from a stored model, with its uncertainty band.
//!
//! ```text
//! torque_i = y_i . values            y_i: columns of the base parameters' carriers in row i of the regressor
//! sigma_i  = sqrt(y_i' C y_i)        C: covariance of the base parameters
//! ```
//!
//! Springs and friction by load add their slope times their value, and their covariance with the base
//! parameters.
//!
//! Only identified values are used: the base set, not its split among grouped parameters. The prior
//! therefore has no influence on the torque. The band is that of the parameters; noise, stiction
//! and unmodelled effects come on top.
//!
//! | | columns |
//! | --- | --- |
//! | in | states of motion ([`crate::leg::states`]); `t_s` if present |
//! | out | `t_s` if present, else `k` from 0; per joint the columns below |
//! | torque and its sigma | `tau1_Nm`, `tau1_sigma_Nm` |
//! | bodies, gravity, rotor, spring | `tau1_rigid_Nm` |
//! | friction; offset | `tau1_friction_Nm`, `tau1_offset_Nm` |
//!
//! A difference of Coulomb friction between the directions (`FCA1`) counts as friction, an offset
//! does not. Torques have the sign of the given angles. At a speed of exactly 0 Coulomb friction is
//! undetermined and counts as 0. All states are read and computed before anything is written.

use std::path::Path;

use nalgebra::Vector3;
use scarab::model::{AnatomicalJoint, Chain, JointState, Parameter, regressor};
use scarab::real::{dot, sign};
use scarab_base::error::ToolError;

use crate::formats::leg_file::geometry::{anatomy, chain};
use crate::formats::model_file::ModelFile;
use crate::leg::states::{Angles, States};
use crate::report::additional_torque::AdditionalKind;

/// Torque of one joint, N m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Prediction {
    /// Torque of bodies, gravity, rotor and spring.
    pub rigid: f64,
    /// Coulomb, viscous and Stribeck friction, and friction by load.
    pub friction: f64,
    /// Constant torque.
    pub offset: f64,
    /// Standard deviation of the sum.
    pub sigma: f64,
}

impl Prediction {
    /// Sum of the parts, N m.
    pub fn total(&self) -> f64 {
        self.rigid + self.friction + self.offset
    }
}

/// Model prepared for predictions.
#[derive(Clone, Debug)]
pub struct Predictor<'a, const N: usize> {
    model: &'a ModelFile,
    chain: Chain<f64, N>,
    gravity: Vector3<f64>,
    anatomy: [AnatomicalJoint<f64>; N],
    /// Joint and parameter of each base parameter's carrier, and whether it acts only while its joint moves.
    carriers: Vec<(usize, Parameter, bool)>,
}

impl<'a, const N: usize> Predictor<'a, N> {
    /// Prepares a checked model of a leg of `N` joints.
    pub fn new(model: &'a ModelFile) -> Result<Self, ToolError> {
        let leg = model.leg.to_leg_file();
        let carriers = model.base_set.parameters.iter().filter_map(|base| {
            let (joint, parameter) = model.parameter(&base.carrier)?;
            Some((joint, parameter, ModelFile::is_asymmetry(&base.carrier)))
        });
        let (chain, gravity) = (chain(&leg)?, Vector3::from(leg.gravity));
        Ok(Self { model, chain, gravity, anatomy: anatomy(&leg)?, carriers: carriers.collect() })
    }

    /// Torques of a state in D-H angles.
    pub fn torques(&self, state: &JointState<f64, N>) -> [Prediction; N] {
        let set = &self.model.base_set;
        let rows = regressor(&self.chain, state, &self.gravity).map(|row| {
            let columns = self.carriers.iter().map(|(joint, parameter, moving_only)| {
                let moves = if *moving_only { sign(state.qd[*joint]).abs() } else { 1.0 };
                moves * row[*joint][parameter.index()]
            });
            columns.collect::<Vec<f64>>()
        });
        let mut torques = rows.each_ref().map(|columns| {
            let mut torque = Prediction::default();
            for ((element, base), (_, parameter, moving_only)) in
                columns.iter().zip(&set.parameters).zip(&self.carriers)
            {
                let part = match parameter {
                    Parameter::FC | Parameter::FV => &mut torque.friction,
                    Parameter::OFF if *moving_only => &mut torque.friction,
                    Parameter::OFF => &mut torque.offset,
                    _ => &mut torque.rigid,
                };
                *part += element * base.value;
            }
            let variance: f64 =
                set.covariance.iter().zip(columns).map(|(row, left)| left * dot(row, columns)).sum();
            torque.sigma = variance.max(0.0).sqrt();
            torque
        });
        for found in &set.stribeck {
            let Some(joint) = found.joint.checked_sub(1).filter(|joint| *joint < N) else { continue };
            let ratio = state.qd[joint] / found.speed_rad_s;
            let fallen = (-ratio * ratio).exp();
            torques[joint].friction += found.surplus_nm * sign(state.qd[joint]) * fallen;
            // Treated as independent of the base parameters. This overestimates the sigma, since
            // surplus and Coulomb friction compensate each other.
            let surplus =
                if state.qd[joint] == 0.0 { 0.0 } else { found.surplus_sigma_nm.unwrap_or(0.0) * fallen };
            let speed = found.surplus_nm * fallen * 2.0 * ratio * ratio / found.speed_rad_s
                * found.speed_sigma_rad_s.unwrap_or(0.0);
            torques[joint].sigma = torques[joint].sigma.hypot(surplus).hypot(speed);
        }
        let loads = torques.each_ref().map(|torque| torque.rigid);
        for added in &set.additional_torque {
            let Some(joint) = added.joint.checked_sub(1).filter(|joint| *joint < N) else { continue };
            let anatomy = &self.anatomy[joint];
            let [load, speed] = [loads[joint], state.qd[joint]].map(|value| anatomy.from_chain(value));
            let angle = anatomy.angle_from_chain(state.q[joint]);
            let slope = anatomy.to_chain(added.slope(load, angle, speed));
            let torque = &mut torques[joint];
            match added.kind {
                AdditionalKind::Spring => torque.rigid += slope * added.value,
                AdditionalKind::LoadFriction => torque.friction += slope * added.value,
            }
            let own = slope * added.sigma;
            let common = dot(&rows[joint], &added.shift);
            torque.sigma = (torque.sigma.powi(2) + own * (own + 2.0 * common)).max(0.0).sqrt();
        }
        torques
    }
}

/// Table for a model of any size, as CSV text.
pub fn table(model: &ModelFile, states: &Path, angles: Angles) -> Result<String, ToolError> {
    match model.leg.joints.len() {
        1 => table_of::<1>(model, states, angles),
        2 => table_of::<2>(model, states, angles),
        _ => table_of::<3>(model, states, angles),
    }
}

fn table_of<const N: usize>(model: &ModelFile, states: &Path, angles: Angles) -> Result<String, ToolError> {
    let predictor = Predictor::<N>::new(model)?;
    let to_chain = angles.to_chain::<N>(&model.leg.to_leg_file())?;
    let states = States::read(states, &to_chain)?;
    let timed = states.rows.first().is_some_and(|row| row.time.is_some());
    let mut out = String::from(if timed { "t_s" } else { "k" });
    for joint in 1..=N {
        for part in ["", "_sigma", "_rigid", "_friction", "_offset"] {
            out += &format!(",tau{joint}{part}_Nm");
        }
    }
    out.push('\n');
    for (k, row) in states.rows.iter().enumerate() {
        out += &row.time.clone().unwrap_or_else(|| k.to_string());
        for (torque, joint) in predictor.torques(&row.motion).iter().zip(&to_chain) {
            if !(torque.total().is_finite() && torque.sigma.is_finite()) {
                return Err(states.out_of_range(k).into());
            }
            let [total, rigid, friction, offset] =
                [torque.total(), torque.rigid, torque.friction, torque.offset]
                    .map(|part| joint.from_chain(part));
            for number in [total, torque.sigma, rigid, friction, offset] {
                // Adding 0 turns -0 into 0.
                out += &format!(",{:e}", number + 0.0);
            }
        }
        out.push('\n');
    }
    Ok(out)
}
