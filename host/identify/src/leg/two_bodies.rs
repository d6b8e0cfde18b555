//! A leg file with a wearer taken apart: the exoskeleton alone, and the wearer with a body of their own.
//!
//! Why: a leg file's links contain the wearer ([`SegmentsFile`](crate::formats::leg_file::SegmentsFile)).
//! What the drive does to the wearer is the torque between both, so both are needed apart.
//!
//! ```text
//! exoskeleton's link = link - segment of the wearer          truth: wearer_kg, prior: prior_wearer_kg
//! wearer's segment   = anthropometry (Winter) of wearer_kg with the link's lengths
//! ```
//!
//! Rotor inertia, friction and limits belong to the exoskeleton and stay. The wearer's segments are given in
//! the frames of the links, x down the segment and y forward, as [`crate::formats::anthropometry`] does.
//!
//! Cuffs sit below the middle of the segments, where straps of such exoskeletons are (an assumption), and
//! are padded ([`CuffDescription::padded`]).
//!
//! Known limits: hip and knee only; the prior of the exoskeleton keeps the designer's errors, which are few:
//! a designer knows the machine better than the wearer.

use hal_sim::wearer::description::{
    CuffDescription, Impedance, MuscleDescription, SegmentDescription, WearerDescription,
};
use scarab::model::is_physically_consistent;
use scarab_base::error::ToolError;

use crate::formats::anthropometry::{Segment, Wearer, joined};
use crate::formats::leg_file::{DEFAULT_LEG, LegFile, LinkParameters};
use crate::leg::link_body::{linked, without};

/// Distance of a cuff from the joint above, as a share of the segment's length.
const THIGH_CUFF: f64 = 0.65;
const SHANK_CUFF: f64 = 0.58;

/// Exoskeleton and wearer of a leg file.
#[derive(Clone, Debug, PartialEq)]
pub struct TwoBodies {
    /// Leg file of the exoskeleton without wearer.
    pub exoskeleton: LegFile,
    /// Wearer in the links of the leg file's truth.
    pub person: Wearer,
}

/// How strongly a wearer's muscles follow the intended motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MuscleTone {
    /// Relaxed walker, whose leg yields to the exoskeleton.
    Relaxed,
    /// Antagonists contracted.
    Firm,
    /// So stiff that the leg moves as intended whatever the exoskeleton does: no person, but a test rig that
    /// compares drives at one motion.
    Insisting,
}

/// Muscles of one joint of a test rig. The deviation from the intended motion is the interaction torque over
/// this impedance: 40 N m are at most 0.004 rad. They have no reflexes: such gains are unstable with a delay.
fn insisting(damping: f64) -> MuscleDescription {
    let impedance = Impedance { stiffness: 10_000.0, damping };
    let reflex = Impedance::default();
    MuscleDescription { torque_limit: 1000.0, intrinsic: impedance, reflex, resisting: impedance }
}

impl MuscleTone {
    /// Muscles of hip and knee.
    pub(crate) fn muscles(self) -> [MuscleDescription; 2] {
        match self {
            Self::Relaxed => [MuscleDescription::HIP, MuscleDescription::KNEE],
            Self::Firm => [MuscleDescription::FIRM_HIP, MuscleDescription::FIRM_KNEE],
            Self::Insisting => [800.0, 400.0].map(insisting),
        }
    }
}

impl TwoBodies {
    /// Takes a leg file apart.
    ///
    /// # Errors
    /// The leg is not a hip and a knee, does not state its wearer, cannot be simulated, or has a link that is
    /// no physically consistent body without the wearer.
    pub fn from_leg(leg: &LegFile) -> Result<Self, ToolError> {
        let segments = leg.segments.ok_or_else(|| {
            ToolError::input(format!(
                "{}: the leg file does not state which part of its links is the wearer's; add the key `segments` \
                 (docs/files.md), or use the leg {DEFAULT_LEG}",
                leg.name
            ))
        })?;
        if leg.joints.len() != 2 {
            return Err(ToolError::input(format!(
                "{}: a wearer with a body of their own needs a leg of 2 joints, hip and knee; this one has {}",
                leg.name,
                leg.joints.len()
            )));
        }
        let person = |mass: f64| segments.wearer(leg.link_length(0), mass);
        let mut exoskeleton = leg.clone();
        exoskeleton.name += " without wearer";
        exoskeleton.segments = None;
        for (number, joint) in exoskeleton.joints.iter_mut().enumerate() {
            if joint.truth.is_none() {
                return Err(ToolError::input(format!(
                    "{}: joint `{}` has no `truth`: the leg cannot be simulated",
                    leg.name, joint.name
                )));
            }
            for (key, link, mass) in [
                ("truth", &mut joint.truth, segments.wearer_kg),
                ("prior", &mut joint.prior, segments.prior_wearer_kg),
            ] {
                if let Some(link) = link {
                    *link = machine(link, &person(mass).links()[number]).ok_or_else(|| {
                        ToolError::input(format!(
                            "{}: joint `{}`: {key} without the segment of a wearer of {mass} kg is no physically \
                             consistent body; correct the masses in the leg file",
                            leg.name, joint.name
                        ))
                    })?;
                }
            }
        }
        Ok(Self { exoskeleton, person: person(segments.wearer_kg) })
    }

    /// The wearer for the simulated hardware.
    pub fn wearer(&self, tone: MuscleTone) -> WearerDescription {
        description(&self.person, tone)
    }
}

/// Link without the wearer's part.
fn machine(link: &LinkParameters, part: &[Segment]) -> Option<LinkParameters> {
    let body = without(link, part)?;
    is_physically_consistent(&body.to_parameters()).then(|| linked(link, &body))
}

/// A person for the simulated hardware: aligned joint axes, padded cuffs.
pub fn description(person: &Wearer, tone: MuscleTone) -> WearerDescription {
    let segments = person.links().map(|part| {
        let (mass, [along, forward, _], inertia) = joined(&part);
        SegmentDescription { mass, com: [along, forward], inertia_com: inertia[5] }
    });
    let cuffs = [
        CuffDescription::padded(THIGH_CUFF * person.thigh),
        CuffDescription::padded(SHANK_CUFF * person.shank),
    ];
    WearerDescription::aligned(segments, person.thigh, tone.muscles(), cuffs)
}

#[cfg(test)]
mod tests {
    use hal_sim::wearer::WearerTruth;
    use hal_sim::wearer::motion::{Gait, IntendedMotion, Strokes};
    use hal_sim::wearer::muscles::Intention;
    use hal_sim::world::World;

    use super::*;
    use crate::leg::posture::on_side;
    use crate::leg::x2;
    use scarab_base::stats::rms;

    fn default_leg() -> LegFile {
        LegFile::load(DEFAULT_LEG).expect("shipped")
    }

    fn world(leg: &LegFile) -> World<2> {
        World::new(&leg.description().expect("simulated"), 1)
    }

    #[test]
    fn exoskeleton_alone_has_the_parts_of_its_source() {
        let bodies = TwoBodies::from_leg(&default_leg()).expect("a worn leg");
        // M, HX, HY, ZZ of the parts in CORC's parameter file, about hip and knee.
        let expected = [
            [2.84, 0.70 * 0.0811 + 2.14 * 0.334_36, 0.0, 0.251_94],
            [2.36, 0.64 * 0.0908 + 0.47 * 0.3438 + 1.25 * 0.40, 1.25 * 0.088_34, 0.278_17],
        ];
        for (joint, expected) in bodies.exoskeleton.joints.iter().zip(expected) {
            for link in [joint.truth, joint.prior] {
                let sums = link.expect("both").sums();
                for (sum, expected) in sums.iter().zip(expected) {
                    // Six decimals of the file, times 10 kg.
                    assert!((sum - expected).abs() < 2e-5, "{sums:?} {expected}");
                }
            }
        }
        assert_eq!(bodies.person, Wearer { mass: 75.0, thigh: 0.39, shank: 0.40, foot: 0.27 });
    }

    #[test]
    fn exoskeleton_and_wearer_need_the_leg_files_torque() {
        let leg = default_leg();
        let bodies = TwoBodies::from_leg(&leg).expect("a worn leg");
        let wearer = bodies.wearer(MuscleTone::Relaxed);
        let mut again = bodies.exoskeleton.description::<2>().expect("simulated");
        for (joint, segment) in again.joints.iter_mut().zip([wearer.thigh, wearer.shank]) {
            let [x, y] = segment.com;
            joint.body = joint.body.with_point_mass(segment.mass, [x, y, 0.0]);
            joint.body.inertia_com[5] += segment.inertia_com;
        }
        let worlds = [world(&leg), World::new(&again, 1)];
        for (position, velocity, acceleration) in
            [([0.3, 0.8], [1.0, -2.0], [10.0, -20.0]), ([0.8, 1.5], [-1.5, 0.5], [-4.0, 30.0])]
        {
            let torques =
                worlds.each_ref().map(|world| world.inverse_dynamics(&position, &velocity, &acceleration));
            for joint in 0..2 {
                // Six decimals of the file, times 9.81 m/s^2 and 30 rad/s^2.
                assert!((torques[0][joint] - torques[1][joint]).abs() < 1e-3, "{torques:?}");
            }
        }
    }

    #[test]
    fn any_wearer_and_either_side_can_be_taken_apart_and_worn() {
        let mut legs: Vec<LegFile> = [45.0, 75.0, 110.0].map(x2::leg_file).into();
        legs.push(on_side(&default_leg(), crate::formats::leg_file::BodySide::Left).expect("parallel axes"));
        for leg in legs {
            let bodies = TwoBodies::from_leg(&leg).expect("a worn leg");
            let exoskeleton = &bodies.exoskeleton;
            assert_eq!(LegFile::parse(&exoskeleton.to_toml(), "alone").as_ref(), Ok(exoskeleton));
            for tone in [MuscleTone::Relaxed, MuscleTone::Firm, MuscleTone::Insisting] {
                world(exoskeleton).wear(&bodies.wearer(tone)).expect("a hip and a knee");
            }
        }
    }

    #[test]
    fn legs_that_cannot_be_taken_apart_are_refused_with_the_reason() {
        let reason = |change: fn(&mut LegFile)| {
            let mut leg = default_leg();
            change(&mut leg);
            TwoBodies::from_leg(&leg).expect_err("refused").to_string()
        };
        for (found, words) in [
            (reason(|leg| leg.segments = None), "add the key `segments`"),
            (reason(|leg| leg.joints[1].truth = None), "joint `knee` has no `truth`"),
            (reason(|leg| drop(leg.joints.pop())), "needs a leg of 2 joints, hip and knee; this one has 1"),
            (
                reason(|leg| leg.segments.as_mut().expect("stated").prior_wearer_kg = 98.0),
                "joint `hip`: prior without the segment of a wearer of 98 kg",
            ),
        ] {
            assert!(found.contains(words), "{found}");
        }
    }

    /// Root mean square deviation from the intended motion over that of the intended motion about its mean,
    /// with drives off, and the largest interaction torque, N m.
    fn deviation(motion: IntendedMotion) -> ([f64; 2], f64) {
        let bodies = TwoBodies::from_leg(&default_leg()).expect("a worn leg");
        let mut world = world(&bodies.exoskeleton);
        world.move_to(&[0.4, 0.5]);
        world.wear(&bodies.wearer(MuscleTone::Insisting)).expect("a hip and a knee");
        world.intend(Intention::Follow(motion)).expect("a valid motion");
        (0..8000).for_each(|_| world.advance());
        let path: Vec<WearerTruth> = (0..16_000)
            .map(|_| {
                world.advance();
                world.wearer_truth().expect("worn")
            })
            .collect();
        let shares = [0, 1].map(|joint| {
            let intended = |truth: &WearerTruth| truth.intended.expect("follows").position[joint];
            let mean = path.iter().map(intended).sum::<f64>() / path.len() as f64;
            let error = rms(path.iter().map(|truth| truth.position[joint] - intended(truth)));
            // A joint that stays is compared with a tenth of a radian.
            error / rms(path.iter().map(|truth| intended(truth) - mean)).max(0.1)
        });
        let largest = path.iter().flat_map(|truth| truth.interaction_torque).fold(0.0, |a, b| b.abs().max(a));
        (shares, largest)
    }

    #[test]
    fn an_insisting_wearer_moves_as_intended_whatever_the_exoskeleton_does() {
        // Smaller angles at higher cadences: the exoskeleton stays within its speed limit.
        let gait = |cadence: f64, scale: f64| {
            let gait = Gait { scale: [scale; 2], offset: [0.36, 0.4], ..Gait::at_cadence(cadence) };
            IntendedMotion::Gait(gait)
        };
        let kicking = Strokes { postures: [[0.5, 1.4], [0.5, 0.5]], durations: [0.6, 0.05, 0.9, 0.2] };
        for motion in [gait(0.5, 0.8), gait(0.8, 0.5), gait(1.2, 0.35), IntendedMotion::Strokes(kicking)] {
            let (shares, largest) = deviation(motion);
            println!("{shares:.4?} of the motion, largest interaction torque {largest:.1} N m");
            assert!(shares.iter().all(|share| *share < 0.025), "{motion:?}: {shares:?}");
            assert!((10.0..200.0).contains(&largest), "{largest}");
        }
    }
}
