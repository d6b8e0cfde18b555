//! The leg of unit tests: the one that images are built for by default.

use super::{IdentifiedModel, LegConfiguration};

include!("../../hal-sim/legs/x2-wearer-75kg.rs");

/// Base parameters of two parallel axes.
pub(crate) const BASE: usize = 13;

/// Configuration of [`LEG`].
pub(crate) fn configuration() -> LegConfiguration<2, BASE> {
    LEG.configuration().expect("a leg that is shipped")
}

/// A model of the leg without any torque.
pub(crate) fn model() -> IdentifiedModel<2> {
    IdentifiedModel::new(&configuration().model, &[0.0; BASE])
}
