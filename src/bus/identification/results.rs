//! What an identification found, as the objects tell it: whoever has the results answers, without knowing of objects.

use core::borrow::BorrowMut;

use crate::leg::{FoundBase, FoundFit, FoundParameter, Identification, MotionWindow, Parameter, Verdict};

/// Joints and parameters from 0, motions as `Identification::fit` counts them.
pub trait Results {
    /// One of a joint's fourteen parameters; nothing before anything was identified.
    fn parameter(&self, joint: usize, parameter: Parameter) -> Option<FoundParameter>;
    /// A base parameter.
    fn base_parameter(&self, base: usize) -> Option<FoundBase>;
    /// How well a joint's torque on a motion is explained.
    fn fit(&self, motion: usize, joint: usize) -> Option<FoundFit>;
    /// The last verdict.
    fn verdict(&self) -> Option<Verdict>;
    /// Iterations and evaluations of the search so far.
    fn search(&self) -> [u32; 2];
}

impl<const N: usize, const B: usize, const TAPS: usize, const PENDING: usize, W> Results
    for Identification<N, B, TAPS, PENDING, W>
where
    W: BorrowMut<MotionWindow<f32, N, B>>,
{
    fn parameter(&self, joint: usize, parameter: Parameter) -> Option<FoundParameter> {
        Self::parameter(self, &self.estimate()?, joint, parameter)
    }

    fn base_parameter(&self, base: usize) -> Option<FoundBase> {
        Self::base_parameter(self, &self.estimate()?, base)
    }

    fn fit(&self, motion: usize, joint: usize) -> Option<FoundFit> {
        Self::fit(self, &self.estimate()?, motion, joint)
    }

    fn verdict(&self) -> Option<Verdict> {
        Self::verdict(self)
    }

    fn search(&self) -> [u32; 2] {
        self.solver().map_or([0; 2], |solver| [solver.search().iterations(), solver.search().evaluations()])
    }
}
