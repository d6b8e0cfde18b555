//! Leg assumed by a design before the leg has moved.
//!
//! The information of a motion is geometry, but its torque and noise depend on a leg that is not
//! yet measured. The design therefore states its assumption: the leg file's `prior`, or its `truth`
//! without a prior or on request. No other key of `truth` is used.
//!
//! A robot description states no rotor inertia, but every drive has one, and without it the position loop
//! of light links shakes. A design that fails without is repeated with a fifth of the moved inertia, and says
//! so.

use scarab::ident::prior_parameters;

use scarab_base::error::FileError;
use scarab_identify::formats::leg_file::{JointFile, LegFile};
use scarab_identify::leg::setup::{largest_inertia, links, row_model};

/// Rotor inertia that is assumed where none is stated, as a share of the largest inertia the joint moves.
const ROTOR_SHARE: f64 = 0.2;

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
    let has = |joints: &dyn Fn(&JointFile) -> bool| leg.joints.iter().all(joints);
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

/// Leg with a rotor inertia for every joint that states none, and a line about each; `None` if all state one.
pub fn with_rotors<const N: usize, const B: usize>(leg: &LegFile) -> Option<(LegFile, Vec<String>)> {
    let stated = |joint: &JointFile| joint.prior.or(joint.truth).is_none_or(|link| link.rotor_inertia > 0.0);
    if leg.joints.iter().all(stated) {
        return None;
    }
    let links = links::<N>(leg, |joint| joint.prior.as_ref().or(joint.truth.as_ref()))?;
    let inertia = largest_inertia(&row_model::<N, B>(leg).ok()?.chain, &prior_parameters(&links));
    let (mut assumed, mut lines) = (leg.clone(), Vec::new());
    for (joint, inertia) in assumed.joints.iter_mut().zip(inertia).filter(|(joint, _)| !stated(joint)) {
        let rotor = ROTOR_SHARE * inertia;
        for link in joint.prior.iter_mut().chain(&mut joint.truth).filter(|link| link.rotor_inertia == 0.0) {
            link.rotor_inertia = rotor;
        }
        lines.push(format!(
            "{}: no `rotor_inertia` is stated, and without one the simulated leg shakes: {rotor:.2e} kg m2 is assumed, a fifth of \
             the inertia that it moves; state it in `prior`",
            joint.name
        ));
    }
    Some((assumed, lines))
}
