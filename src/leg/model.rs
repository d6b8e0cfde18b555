//! Model of an accepted identification, used as the servo's feedforward.

use nalgebra::Vector3;

use super::assured::assured;
use crate::assist::{Assured, CompensationModel};
use crate::ident::{Constant, Estimate, RowModel};
use crate::model::friction::Stribeck;
use crate::model::{
    Chain, JointState, LegParameters, PARAMETERS_PER_JOINT, Parameter, Payload, rigid_body_torques,
};
use crate::real::abs;
use crate::servo::{TorqueModel, smoothed_sign};
use crate::units::RadianPerSecond;

/// Identified torque model. Each base value stands in its own column; the torque equals that of the full
/// parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdentifiedModel<const N: usize> {
    chain: Chain<f32, N>,
    parameters: LegParameters<f32, N>,
    stribeck: [Stribeck<f32>; N],
    constant: [Constant; N],
    assured: Assured<N>,
}

impl<const N: usize> IdentifiedModel<N> {
    /// Creates the model with these base parameters, of unknown uncertainty.
    pub fn new<const B: usize>(model: &RowModel<f32, N, B>, base_values: &[f32; B]) -> Self {
        let parameters = model.base.complete(base_values, &[[0.0; PARAMETERS_PER_JOINT]; N]);
        let constant = model.drive_choice.map(|choice| choice.meaning);
        let (chain, stribeck) = (model.chain, model.stribeck);
        Self { chain, parameters, stribeck, constant, assured: Assured::NOTHING }
    }

    /// Creates the model of an estimate, with its lower confidence bounds.
    pub fn from_estimate<const B: usize>(model: &RowModel<f32, N, B>, estimate: &Estimate<f32, B>) -> Self {
        Self { assured: assured(model, estimate), ..Self::new(model, &estimate.values) }
    }

    /// This model with other confidence bounds.
    pub fn with_assured(self, assured: Assured<N>) -> Self {
        Self { assured, ..self }
    }

    /// Lower confidence bounds of friction and inertia.
    pub fn assured(&self) -> &Assured<N> {
        &self.assured
    }

    /// Models of an empty leg and, where known, of the same leg worn, for the assistance; `gravity` in the
    /// base frame, m/s^2.
    pub fn compensation(&self, worn: Option<&Self>, gravity: [f32; 3]) -> CompensationModel<N> {
        let difference = |worn: &Self| {
            let mut wearer = worn.parameters;
            for (worn, empty) in wearer.iter_mut().flatten().zip(self.parameters.iter().flatten()) {
                *worn -= *empty;
            }
            wearer
        };
        CompensationModel {
            chain: self.chain,
            gravity,
            empty: self.parameters,
            wearer: worn.map(difference),
            offset_nm: core::array::from_fn(|joint| match self.constant[joint] {
                Constant::Offset => self.parameters[joint][Parameter::OFF.index()],
                Constant::Asymmetry => 0.0,
            }),
            assured: self.assured,
        }
    }

    /// Model of the leg with a known load; a negative mass removes one. The load need not be identified.
    pub fn with_load(&self, load: &Payload<f32>) -> Self {
        let mut loaded = *self;
        load.add_to(&mut loaded.parameters);
        loaded
    }

    /// Creates the model from equivalent parameters. The caller has checked that they belong to this chain.
    pub(super) fn from_parameters(
        chain: Chain<f32, N>,
        parameters: LegParameters<f32, N>,
        stribeck: [Stribeck<f32>; N],
        constant: [Constant; N],
    ) -> Self {
        Self { chain, parameters, stribeck, constant, assured: Assured::NOTHING }
    }

    /// Stribeck friction of each joint: a factor on its Coulomb friction.
    pub(crate) fn stribeck(&self) -> &[Stribeck<f32>; N] {
        &self.stribeck
    }

    /// Meaning of the constant part of each joint's torque.
    pub fn constant(&self) -> &[Constant; N] {
        &self.constant
    }

    /// Blend of two models: `share` (0..1) of the other's torque and the rest of this one's, since torque is
    /// linear in the parameters. Both must be models of one leg with equal curves and constants, like a model
    /// and its update.
    pub(crate) fn towards(&self, other: &Self, share: f32) -> Self {
        let mut mixed = *self;
        for (from, to) in mixed.parameters.iter_mut().flatten().zip(other.parameters.iter().flatten()) {
            *from += share * (*to - *from);
        }
        mixed
    }

    /// Parameters that give the leg's torque. They are not those of its links.
    pub fn equivalent_parameters(&self) -> &LegParameters<f32, N> {
        &self.parameters
    }
}

impl<const N: usize> TorqueModel<N> for IdentifiedModel<N> {
    fn torques(&self, q: &[f32; N], qd: &[f32; N], qdd: &[f32; N], gravity: [f32; 3]) -> [f32; N] {
        let state = JointState { q: *q, qd: *qd, qdd: *qdd };
        let mut torque = rigid_body_torques(&self.chain, &self.parameters, &state, &Vector3::from(gravity));
        for joint in 0..N {
            let of = |parameter: Parameter| self.parameters[joint][parameter.index()];
            let sign = smoothed_sign(RadianPerSecond(qd[joint]));
            // Friction acts only while the joint moves, an offset always.
            let constant = match self.constant[joint] {
                Constant::Offset => 1.0,
                Constant::Asymmetry => abs(sign),
            };
            torque[joint] += of(Parameter::IA) * qdd[joint]
                + of(Parameter::FC) * sign * self.stribeck[joint].factor(qd[joint])
                + of(Parameter::FV) * qd[joint]
                + of(Parameter::OFF) * constant;
        }
        torque
    }
}
