//! Stored model, and the check that it belongs to this leg.
//!
//! Parameters of another leg, other link lengths or another torque constant look plausible, but would push
//! the wearer wrongly. A stored model therefore carries the fingerprint of the leg it was identified on. Only
//! the check below turns it into an [`IdentifiedModel`], the type that the servo accepts.
//!
//! ```text
//! IdentifiedModel --LegConfiguration::keep----> StoredModel
//! StoredModel     --LegConfiguration::restore-> IdentifiedModel | RestoreError
//! IdentifiedModel --Control::adopt, at rest---> feedforward
//! ```
//!
//! Contents of the fingerprint: see [`crate::model::fingerprint`]. Limits: gravity is not included. The
//! equivalent parameters put every sum on one of its members, so they hold for gravity in the plane of the
//! identification, but not for a leg laid on its side.

use super::configuration::LegConfiguration;
use super::model::IdentifiedModel;
use crate::assist::Assured;
use crate::ident::Constant;
use crate::model::friction::Stribeck;
use crate::model::{Fingerprint, LegParameters};
use crate::real::is_finite;

/// An accepted model as plain data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredModel<const N: usize> {
    /// Fingerprint of the leg that was identified.
    pub fingerprint: Fingerprint,
    /// See [`IdentifiedModel::equivalent_parameters`].
    pub parameters: LegParameters<f32, N>,
    /// See `IdentifiedModel::stribeck`.
    pub stribeck: [Stribeck<f32>; N],
    /// See [`IdentifiedModel::constant`].
    pub constant: [Constant; N],
    /// See [`IdentifiedModel::assured`].
    pub assured: Assured<N>,
}

/// Reason why a stored model is rejected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestoreError {
    /// The model belongs to another leg: lengths, zero offset or torque constant differ.
    AnotherLeg {
        /// Fingerprint of the model.
        stored: Fingerprint,
        /// Fingerprint of this leg.
        own: Fingerprint,
    },
    /// A parameter of this joint is NaN or infinite.
    NotFinite {
        /// Index of the joint, from 0.
        joint: usize,
    },
    /// The Stribeck curve of this joint has a negative excess, no positive velocity, or a value that is not
    /// finite.
    Stribeck {
        /// Index of the joint, from 0.
        joint: usize,
    },
    /// A lower bound of this joint's friction is negative or not finite.
    FrictionBound {
        /// Index of the joint, from 0.
        joint: usize,
    },
    /// The certain share of the inertia is not from 0 to 1.
    InertiaShare,
}

impl<const N: usize, const B: usize> LegConfiguration<N, B> {
    /// Fingerprint of this leg, which a model must carry.
    pub fn fingerprint(&self) -> Fingerprint {
        Fingerprint::new(
            &self.model.chain,
            &self.joints.map(|joint| joint.scale.anatomy),
            &self.joints.map(|joint| {
                let constant = joint.scale.torque_per_ampere.0;
                if joint.scale.mirrored { -constant } else { constant }
            }),
        )
    }

    /// Converts a model identified with this configuration to plain data.
    pub fn to_stored(&self, model: &IdentifiedModel<N>) -> StoredModel<N> {
        StoredModel {
            fingerprint: self.fingerprint(),
            parameters: *model.equivalent_parameters(),
            stribeck: *model.stribeck(),
            constant: *model.constant(),
            assured: *model.assured(),
        }
    }

    /// Converts a stored model back if it belongs to this leg.
    ///
    /// # Errors
    /// See [`RestoreError`].
    pub fn restore(&self, stored: &StoredModel<N>) -> Result<IdentifiedModel<N>, RestoreError> {
        let own = self.fingerprint();
        if stored.fingerprint != own {
            return Err(RestoreError::AnotherLeg { stored: stored.fingerprint, own });
        }
        let broken = |joint: &[f32]| joint.iter().any(|value| !is_finite(*value));
        if let Some(joint) = stored.parameters.iter().position(|joint| broken(joint)) {
            return Err(RestoreError::NotFinite { joint });
        }
        let is_curve = |curve: &Stribeck<f32>| {
            is_finite(curve.excess)
                && curve.excess >= 0.0
                && is_finite(curve.velocity)
                && curve.velocity > 0.0
        };
        if let Some(joint) = stored.stribeck.iter().position(|curve| !is_curve(curve)) {
            return Err(RestoreError::Stribeck { joint });
        }
        let Assured { coulomb_nm, viscous, inertia_share } = &stored.assured;
        let is_bound = |(coulomb, viscous): (&f32, &f32)| {
            [coulomb, viscous].into_iter().all(|bound| is_finite(*bound) && *bound >= 0.0)
        };
        if let Some(joint) = coulomb_nm.iter().zip(viscous).position(|bounds| !is_bound(bounds)) {
            return Err(RestoreError::FrictionBound { joint });
        }
        // False for NaN too.
        if !(0.0..=1.0).contains(inertia_share) {
            return Err(RestoreError::InertiaShare);
        }
        let (chain, StoredModel { parameters, stribeck, constant, .. }) = (self.model.chain, *stored);
        let model = IdentifiedModel::from_parameters(chain, parameters, stribeck, constant);
        Ok(model.with_assured(stored.assured))
    }
}
