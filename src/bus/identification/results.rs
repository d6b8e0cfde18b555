//! Identification results as the objects present them. The provider of the results does not depend on the
//! objects.

use core::borrow::BorrowMut;

use crate::leg::{FoundBase, FoundFit, FoundParameter, Identification, MotionWindow, Parameter, Verdict};

/// Identification results. Joints and parameters count from 0; motions as in `Identification::fit`.
pub trait Results {
    /// Returns one of a joint's fourteen parameters; `None` before the first result.
    fn parameter(&self, joint: usize, parameter: Parameter) -> Option<FoundParameter>;
    /// Returns a base parameter.
    fn base_parameter(&self, base: usize) -> Option<FoundBase>;
    /// Returns the quality of fit of a joint's torque for a motion.
    fn fit(&self, motion: usize, joint: usize) -> Option<FoundFit>;
    /// Returns the last verdict.
    fn verdict(&self) -> Option<Verdict>;
    /// Returns the iterations and evaluations of the search so far.
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
