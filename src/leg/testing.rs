//! Leg of the unit tests: the default leg of the images.

use super::{IdentifiedModel, LegConfiguration};

pub(crate) use super::BASE;

include!("../../host/legs/x2-wearer-75kg.rs");

pub fn configuration() -> LegConfiguration<2, BASE> {
    LEG.configuration().expect("a leg that is shipped")
}

/// A model of the leg with zero torque.
pub fn model() -> IdentifiedModel<2> {
    IdentifiedModel::new(&configuration().model, &[0.0; BASE])
}
