//! A model that was kept, and the leg it is offered to.
//!
//! Parameters identified on another leg, with other lengths or with another torque constant look like any others and
//! push a person wrongly. A kept model therefore comes with the fingerprint of the leg it was found on, and becomes an
//! [`IdentifiedModel`], the only thing the servo takes, by no other way than past that check.
//!
//! ```text
//! IdentifiedModel --LegConfiguration::keep--> StoredModel --LegConfiguration::restore--> IdentifiedModel | RestoreError
//!                                                                    Control::adopt, at rest <--+
//! ```
//!
//! What the fingerprint covers stands in [`crate::model::fingerprint`]; gravity is not in it. The equivalent parameters
//! put every sum on one of its members, so they hold for gravity in the plane they were found in, not for a leg laid on
//! its side.

use super::configuration::LegConfiguration;
use super::model::IdentifiedModel;
use crate::ident::Constant;
use crate::model::friction::Stribeck;
use crate::model::{Fingerprint, LegParameters};
use crate::real::is_finite;

/// An accepted model as plain data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredModel<const N: usize> {
    /// Of the leg it was found on.
    pub fingerprint: Fingerprint,
    /// See [`IdentifiedModel::equivalent_parameters`].
    pub parameters: LegParameters<f32, N>,
    /// See [`IdentifiedModel::stribeck`].
    pub stribeck: [Stribeck<f32>; N],
    /// See [`IdentifiedModel::constant`].
    pub constant: [Constant; N],
}

/// Why a stored model is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestoreError {
    /// It was found on another leg, with other lengths, another zero or another torque constant.
    AnotherLeg {
        /// Of the model.
        stored: Fingerprint,
        /// Of this leg.
        own: Fingerprint,
    },
    /// A parameter of this joint (from 0) is NaN or infinite.
    NotFinite {
        /// Counted from 0.
        joint: usize,
    },
    /// The Stribeck curve of this joint has a negative excess, no speed, or a number that is not finite.
    Stribeck {
        /// Counted from 0.
        joint: usize,
    },
}

impl<const N: usize, const B: usize> LegConfiguration<N, B> {
    /// What a model must have been identified with to be this leg's.
    #[must_use]
    pub fn fingerprint(&self) -> Fingerprint {
        Fingerprint::of(
            &self.model.chain,
            &self.joints.map(|joint| joint.scale.anatomy),
            &self.joints.map(|joint| {
                let constant = joint.scale.torque_per_ampere.0;
                if joint.scale.mirrored { -constant } else { constant }
            }),
        )
    }

    /// A model identified with this configuration, as plain data.
    #[must_use]
    pub fn keep(&self, model: &IdentifiedModel<N>) -> StoredModel<N> {
        StoredModel {
            fingerprint: self.fingerprint(),
            parameters: *model.equivalent_parameters(),
            stribeck: *model.stribeck(),
            constant: *model.constant(),
        }
    }

    /// The model, if it is this leg's.
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
        match stored.stribeck.iter().position(|curve| !is_curve(curve)) {
            Some(joint) => Err(RestoreError::Stribeck { joint }),
            None => Ok(IdentifiedModel::of_parameters(
                self.model.chain,
                stored.parameters,
                stored.stribeck,
                stored.constant,
            )),
        }
    }
}
