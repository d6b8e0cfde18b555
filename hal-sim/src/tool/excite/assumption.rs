//! What is taken for the leg before it has moved.
//!
//! Information of a motion is geometry, but how much torque it takes and what noise it will meet depend on a leg
//! nobody has measured yet. So the design works on an assumed leg, in the open: the leg file's `prior`, or its `truth`
//! where it has no prior or is asked for it. Nothing else of `truth` is looked at.

use crate::tool::leg_file::LegFile;
use crate::tool::setup::SetupError;

/// Which description of the leg a design believes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Assumption {
    /// The prior, else the truth.
    #[default]
    Best,
    /// What the simulated leg is made of.
    Truth,
}

/// The leg as it is assumed to be, with the word for what was assumed.
///
/// Its `truth` is the assumption, so that it can be simulated; the wearer does not push. Stribeck friction belongs to
/// the simulated leg and is left out of an assumed one.
///
/// # Errors
/// Where the leg file has neither for every joint, or not the one asked for.
pub fn assumed(leg: &LegFile, assumption: Assumption) -> Result<(LegFile, &'static str), SetupError> {
    let has = |joints: &dyn Fn(&crate::tool::leg_file::JointFile) -> bool| leg.joints.iter().all(joints);
    let prior = assumption == Assumption::Best && has(&|joint| joint.prior.is_some());
    if !prior && !has(&|joint| joint.truth.is_some()) {
        let missing = match assumption {
            Assumption::Best => {
                "needs a prior for every joint (inertia and friction to reckon the torque with)"
            }
            Assumption::Truth => "has no truth for every joint",
        };
        return Err(SetupError::new(leg, missing));
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
