//! Data about a leg besides its recordings: model, prior, truth.

use scarab::ident::{LinkPrior, RowModel};
use scarab::model::LegParameters;

use crate::leg::model_choice::TermSwitches;

/// Data about a leg besides its recordings.
#[derive(Clone, Debug)]
pub struct Background<const N: usize, const B: usize> {
    /// Name in the leg file.
    pub leg: String,
    /// Row model in double precision.
    pub model: RowModel<f64, N, B>,
    /// Row model of the device.
    pub device: RowModel<f32, N, B>,
    /// Number of estimated columns.
    pub columns: usize,
    /// Prior of the links.
    pub prior: Option<[LinkPrior<f64>; N]>,
    /// `none`, `file` or `wrong:P`.
    pub prior_name: String,
    /// Parameters of the simulated leg.
    pub truth: Option<LegParameters<f64, N>>,
    /// Model requested by the leg file, by joint.
    pub requested: Vec<TermSwitches>,
    /// Temperature of the drives, degrees Celsius, if known.
    pub temperature_c: Option<f64>,
    /// Stribeck curves of the simulated joints.
    pub stribeck_truth: [Option<StribeckTruth>; N],
}

/// Stribeck curve of a simulated joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StribeckTruth {
    /// Static friction above Coulomb friction, N m.
    pub(crate) surplus: f64,
    /// Speed of the decay, rad/s.
    pub(crate) speed: f64,
}
