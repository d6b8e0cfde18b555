//! Identification cost over single parameters, as searched by the paper's swarm: more unknowns than
//! torque determines.
//!
//! ```text
//! J(p) - J_LS = |R K p - z|^2     K: terms of the base parameters, R and z: factor of all weighted rows
//! ```
//!
//! The cost is flat along the null space of K, for example 15 of 36 directions of the chain's
//! inertias and frictions.

use scarab::ident::{LinkPrior, RowModel, Stage, parameter_box};
use scarab::model::{LegParameters, PARAMETERS_PER_JOINT, Parameter, Standing};
use scarab::swarm::Objective;

/// Joint and index of every parameter with an effect on torque.
fn seen<const N: usize, const B: usize>(model: &RowModel<f32, N, B>) -> Vec<(usize, usize)> {
    let all = (0..N).flat_map(|joint| Parameter::ALL.map(|parameter| (joint, parameter)));
    all.filter(|&(joint, parameter)| {
        !matches!(model.base.standing(joint, parameter), Standing::Unseen | Standing::Off)
    })
    .map(|(joint, parameter)| (joint, parameter.index()))
    .collect()
}

/// The device's cost over single parameters.
pub struct RawCost<'a, const N: usize, const B: usize> {
    model: &'a RowModel<f32, N, B>,
    stage: Stage<f32, B>,
    bounds: (LegParameters<f32, N>, LegParameters<f32, N>),
    coordinates: Vec<(usize, usize)>,
}

impl<'a, const N: usize, const B: usize> RawCost<'a, N, B> {
    /// Cost of `stage` within the ranges of `prior`.
    pub fn new(model: &'a RowModel<f32, N, B>, stage: Stage<f32, B>, prior: &[LinkPrior<f32>; N]) -> Self {
        Self { model, stage, bounds: parameter_box(model, prior), coordinates: seen(model) }
    }

    /// Joint and parameter index of every coordinate.
    pub fn coordinates(&self) -> &[(usize, usize)] {
        &self.coordinates
    }

    /// Base parameters at a position.
    pub fn base(&self, position: &[f32]) -> [f32; B] {
        let mut parameters = [[0.0; PARAMETERS_PER_JOINT]; N];
        for (&(joint, index), &value) in self.coordinates.iter().zip(position) {
            parameters[joint][index] = value;
        }
        self.model.base.project(&parameters)
    }
}

impl<const N: usize, const B: usize> Objective<f32> for RawCost<'_, N, B> {
    fn dimension(&self) -> usize {
        self.coordinates.len()
    }

    fn bounds(&self, coordinate: usize) -> (f32, f32) {
        let Some(&(joint, index)) = self.coordinates.get(coordinate) else { return (0.0, 0.0) };
        (self.bounds.0[joint][index], self.bounds.1[joint][index])
    }

    fn evaluate(&self, position: &[f32]) -> f32 {
        let values = self.base(position);
        let mut compact = [0.0; B];
        for (slot, &base) in compact.iter_mut().zip(self.stage.columns()) {
            *slot = values[base];
        }
        self.stage.factor().excess(&compact)
    }
}
