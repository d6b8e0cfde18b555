//! Copy of the identification results. The identification makes one when it reaches a verdict; the bus reads
//! it at its own priority.
//!
//! Why a copy: on a board the identification runs at the lowest priority while the bus reads, and the bus
//! must not wait for it.

use super::results::Results;
use crate::leg::{FoundBase, FoundFit, FoundParameter, PARAMETERS_PER_JOINT, Parameter, Verdict};

/// Motions of [`Results::fit`]: the training motion and three validation motions.
const MOTIONS: usize = 4;

/// Results for `N` joints with at most `B` base parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct ResultsCopy<const N: usize, const B: usize> {
    parameters: [[Option<FoundParameter>; PARAMETERS_PER_JOINT]; N],
    bases: [Option<FoundBase>; B],
    fits: [[Option<FoundFit>; N]; MOTIONS],
    verdict: Option<Verdict>,
    /// Iterations and evaluations of the search; updated also while the rest is unchanged.
    pub(crate) search: [u32; 2],
}

impl<const N: usize, const B: usize> ResultsCopy<N, B> {
    /// Empty results: before the first identification, or during one. A function and no constant, because a
    /// constant would place the whole value in flash.
    pub const fn nothing() -> Self {
        Self {
            parameters: [[None; PARAMETERS_PER_JOINT]; N],
            bases: [None; B],
            fits: [[None; N]; MOTIONS],
            verdict: None,
            search: [0; 2],
        }
    }

    /// Copies all results. The verdict is separate, because an identification may be cancelled before its
    /// results contain one.
    pub fn take<R: Results>(&mut self, results: &R, verdict: Option<Verdict>) {
        for (joint, parameters) in self.parameters.iter_mut().enumerate() {
            for (slot, parameter) in parameters.iter_mut().zip(Parameter::ALL) {
                *slot = results.parameter(joint, parameter);
            }
        }
        for (base, slot) in self.bases.iter_mut().enumerate() {
            *slot = results.base_parameter(base);
        }
        for (motion, fits) in self.fits.iter_mut().enumerate() {
            for (joint, slot) in fits.iter_mut().enumerate() {
                *slot = results.fit(motion, joint);
            }
        }
        (self.verdict, self.search) = (verdict, results.search());
    }

    /// Clears all results when another identification begins.
    pub fn forget(&mut self) {
        self.parameters = [[None; PARAMETERS_PER_JOINT]; N];
        self.bases = [None; B];
        self.fits = [[None; N]; MOTIONS];
        (self.verdict, self.search) = (None, [0; 2]);
    }
}

impl<const N: usize, const B: usize> Results for ResultsCopy<N, B> {
    fn parameter(&self, joint: usize, parameter: Parameter) -> Option<FoundParameter> {
        *self.parameters.get(joint)?.get(parameter.index())?
    }

    fn base_parameter(&self, base: usize) -> Option<FoundBase> {
        *self.bases.get(base)?
    }

    fn fit(&self, motion: usize, joint: usize) -> Option<FoundFit> {
        *self.fits.get(motion)?.get(joint)?
    }

    fn verdict(&self) -> Option<Verdict> {
        self.verdict
    }

    fn search(&self) -> [u32; 2] {
        self.search
    }
}
