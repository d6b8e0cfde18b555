//! Scale and load of an identification: torque constants by a known mass, and a known load.
//!
//! An identification determines one leg in its present state. A second one with a known mass determines the
//! torque constants (`scarab::ident::solve::scale`). A known load is subtracted from the records.
//!
//! Without a mass, results stay relative to the assumed torque constants, and the report says so.

use scarab::ident::ConstantRatio;
use scarab::model::Payload;

use crate::leg::background::Background;
use crate::report::scale::{MassReport, ScaleReport, TorqueConstantReport};

/// Results of a known mass and a known load.
#[derive(Clone, Debug)]
pub struct Scale<const N: usize, const B: usize> {
    /// Mass of the second run.
    pub payload: Option<Payload<f64>>,
    /// Assumed over true torque constant, if the mass determines it.
    pub ratios: [Option<ConstantRatio<f32>>; N],
    /// Known load in both runs.
    pub load: Option<Payload<f64>>,
    /// Base parameters of that load; zero without one.
    pub load_base: [f32; B],
}

impl<const N: usize, const B: usize> Scale<N, B> {
    /// Ratios of assumed over true constants; `None` unless the mass determined all of them accurately and
    /// without contradiction.
    pub fn trusted(&self) -> Option<[ConstantRatio<f32>; N]> {
        let all: Option<Vec<_>> = self
            .ratios
            .iter()
            .map(|ratio| ratio.filter(|found| found.is_determined() && found.is_consistent()))
            .collect();
        all?.try_into().ok()
    }
}

/// Base parameters of a mass.
pub fn base_of<const N: usize, const B: usize>(
    background: &Background<N, B>,
    mass: &Payload<f64>,
) -> [f32; B] {
    background.model.base.project(&mass.parameters::<N>()).map(|value| value as f32)
}

/// Base values of the leg with its load, from those of the leg alone.
pub fn loaded<const N: usize, const B: usize>(scale: Option<&Scale<N, B>>, values: &[f32; B]) -> [f32; B] {
    let load = scale.map_or([0.0; B], |scale| scale.load_base);
    core::array::from_fn(|base| values[base] + load[base])
}

impl ScaleReport {
    /// Results with the torque constants `used`, N m/A.
    pub fn new<const N: usize, const B: usize>(scale: &Scale<N, B>, used: &[f64; N]) -> Self {
        let of = |joint: usize, ratio: &Option<ConstantRatio<f32>>| {
            let used = used[joint];
            let (found, sigma) =
                ratio.map_or((f64::NAN, 0.0), |ratio| (f64::from(ratio.ratio), f64::from(ratio.sigma)));
            TorqueConstantReport {
                joint: joint + 1,
                used: used.into(),
                identified: (used / found).into(),
                sigma: (used * sigma / (found * found)).into(),
                consistent: ratio.map(|ratio| ratio.is_consistent()),
                determined: ratio.is_some_and(|ratio| ratio.is_determined()),
            }
        };
        Self {
            scale: if scale.trusted().is_some() { "absolute" } else { "relative" },
            torque_constant: scale.ratios.iter().enumerate().map(|(joint, ratio)| of(joint, ratio)).collect(),
            payload: scale.payload.as_ref().map(MassReport::from),
            load: scale.load.as_ref().map(MassReport::from),
        }
    }
}
