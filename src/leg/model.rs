//! The model that an accepted identification leaves behind, as the servo's feedforward uses it.

use nalgebra::Vector3;

use crate::ident::{Constant, RowModel};
use crate::model::friction::Stribeck;
use crate::model::{
    Chain, JointState, LegParameters, PARAMETERS_PER_JOINT, Parameter, Payload, rigid_body_torques,
};
use crate::real::abs;
use crate::servo::{TorqueModel, smoothed_sign};
use crate::units::RadianPerSecond;

/// Identified torque: each base value stands on its own column, which gives the same torque as all parameters would.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IdentifiedModel<const N: usize> {
    chain: Chain<f32, N>,
    parameters: LegParameters<f32, N>,
    stribeck: [Stribeck<f32>; N],
    constant: [Constant; N],
}

impl<const N: usize> IdentifiedModel<N> {
    /// The model with these base parameters.
    #[must_use]
    pub fn new<const B: usize>(model: &RowModel<f32, N, B>, base_values: &[f32; B]) -> Self {
        let parameters = model.base.complete(base_values, &[[0.0; PARAMETERS_PER_JOINT]; N]);
        let constant = model.drive_choice.map(|choice| choice.meaning);
        Self { chain: model.chain, parameters, stribeck: model.stribeck, constant }
    }

    /// The model of the same leg carrying a known load; a negative mass takes one off. The load need not be identified.
    #[must_use]
    pub fn with_load(&self, load: &Payload<f32>) -> Self {
        let mut loaded = *self;
        load.add_to(&mut loaded.parameters);
        loaded
    }

    /// The model with these equivalent parameters; whoever calls has checked that they are this chain's.
    pub(super) fn of_parameters(
        chain: Chain<f32, N>,
        parameters: LegParameters<f32, N>,
        stribeck: [Stribeck<f32>; N],
        constant: [Constant; N],
    ) -> Self {
        Self { chain, parameters, stribeck, constant }
    }

    /// Stribeck friction, a factor on the Coulomb friction of each joint.
    #[must_use]
    pub fn stribeck(&self) -> &[Stribeck<f32>; N] {
        &self.stribeck
    }

    /// What the constant part of each joint's torque is taken for.
    #[must_use]
    pub fn constant(&self) -> &[Constant; N] {
        &self.constant
    }

    /// The model that gives `share` (0..1) of the other's torque and the rest of this one's: torque is linear in the
    /// parameters. Both are models of one leg with the same curves and constants, as a model and its update are.
    #[must_use]
    pub fn towards(&self, other: &Self, share: f32) -> Self {
        let mut mixed = *self;
        for (from, to) in mixed.parameters.iter_mut().flatten().zip(other.parameters.iter().flatten()) {
            *from += share * (*to - *from);
        }
        mixed
    }

    /// Parameters with the same torque as the leg's; not those of its links.
    #[must_use]
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
            // Friction is there where the joint moves, an offset always.
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
