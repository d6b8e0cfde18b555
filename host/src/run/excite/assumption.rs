//! Leg assumed by a design before the leg has moved.
//!
//! The information of a motion is geometry, but its torque and noise depend on a leg that is not
//! yet measured. The design therefore states its assumption: the leg file's `prior`, or its `truth`
//! without a prior or on request. No other key of `truth` is used.

use crate::base::error::FileError;
use crate::formats::leg_file::LegFile;

/// Description of the leg that a design uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Assumption {
    /// Prior if present, else truth.
    #[default]
    Best,
    /// Parameters of the simulated leg.
    Truth,
}

/// Assumed leg, and the word for its origin.
///
/// Its `truth` is the assumption, so that it can be simulated; the wearer does not push. Stribeck
/// friction belongs to the simulated leg and is omitted.
///
/// # Errors
/// Not every joint has a prior or truth, or the requested one.
pub fn assumed(leg: &LegFile, assumption: Assumption) -> Result<(LegFile, &'static str), FileError> {
    let has = |joints: &dyn Fn(&crate::formats::leg_file::JointFile) -> bool| leg.joints.iter().all(joints);
    let prior = assumption == Assumption::Best && has(&|joint| joint.prior.is_some());
    if !prior && !has(&|joint| joint.truth.is_some()) {
        let missing = match assumption {
            Assumption::Best => "needs a `prior` for every joint: inertia and friction to compute the torque",
            Assumption::Truth => "needs a `truth` for every joint",
        };
        return Err(leg.error(missing));
    }
    let mut assumed = leg.clone();
    assumed.pushes = None;
    for joint in &mut assumed.joints {
        if prior {
            joint.truth = joint.prior;
            joint.stribeck = None;
        }
    }
    Ok((assumed, if prior { "prior" } else { "truth" }))
}
