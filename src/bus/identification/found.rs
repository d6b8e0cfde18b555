//! Results as a copy: whoever identifies makes one when a verdict is reached, and the bus answers from it at its own level.
//!
//! Why a copy: on a board the identification belongs to the lowest priority and is at work while the bus reads, and the bus must not wait
//! for it.

use super::results::Results;
use crate::leg::{FoundBase, FoundFit, FoundParameter, PARAMETERS_PER_JOINT, Parameter, Verdict};

/// Motions of [`Results::fit`]: the one identified from and three predicted.
const MOTIONS: usize = 4;

/// Results of `N` joints with at most `B` base parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Found<const N: usize, const B: usize> {
    parameters: [[Option<FoundParameter>; PARAMETERS_PER_JOINT]; N],
    bases: [Option<FoundBase>; B],
    fits: [[Option<FoundFit>; N]; MOTIONS],
    verdict: Option<Verdict>,
    /// Iterations and evaluations of the search, which go on while the rest stands.
    pub search: [u32; 2],
}

impl<const N: usize, const B: usize> Found<N, B> {
    /// Before the first identification, or while one is under way. No constant: of one the whole image would lie in flash.
    #[must_use]
    pub const fn nothing() -> Self {
        Self {
            parameters: [[None; PARAMETERS_PER_JOINT]; N],
            bases: [None; B],
            fits: [[None; N]; MOTIONS],
            verdict: None,
            search: [0; 2],
        }
    }

    /// Takes everything over; the verdict is given beside the results, which may have been broken off before they had one.
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

    /// Nothing is found any more: another identification begins.
    pub fn forget(&mut self) {
        self.parameters = [[None; PARAMETERS_PER_JOINT]; N];
        self.bases = [None; B];
        self.fits = [[None; N]; MOTIONS];
        (self.verdict, self.search) = (None, [0; 2]);
    }
}

impl<const N: usize, const B: usize> Results for Found<N, B> {
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
