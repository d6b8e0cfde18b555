//! One run of leg and wearer: the wearer moves, the drives do one thing, and truth is measured.

use hal_sim::mechanism::Mechanism;
use hal_sim::wearer::WearerTruth;
use hal_sim::wearer::description::WearerDescription;
use hal_sim::wearer::motion::IntendedMotion;
use hal_sim::wearer::muscles::Intention;
use hal_sim::world::{TICK_S, World};
use scarab::hal::LegDrives;
use scarab::leg::{AssistShares, ControlRequest, IdentifiedModel, Wearing};
use scarab_base::error::ToolError;

use super::stability::limb_alone;
use super::subject::Subject;
use crate::pair::Pair;

/// Time from the start of motion and session to the measurement: fade-in, start of the motion, and what
/// oscillators need to learn it, s.
pub(crate) const SETTLING_S: f64 = 8.0;
/// Duration of a measurement, s: whole cycles of gait and of leg extension.
pub(crate) const MEASURED_S: f64 = 10.0;
/// Ticks per point of a curve: 100 Hz.
const TICKS_PER_POINT: u64 = 40;
/// Ticks between two samples of the wearer's gravity torque.
const TICKS_PER_SAMPLE: u64 = 8;

/// What the drives do.
#[derive(Clone, Copy, Debug)]
pub enum Drives<'a> {
    /// Outputs off.
    Off,
    /// A session with these shares and models `empty` and `worn`.
    Assist(AssistShares, [&'a IdentifiedModel<2>; 2]),
    /// A session with the model `empty` alone.
    AssistEmpty(AssistShares, &'a IdentifiedModel<2>),
}

/// Truth of one run; pairs are hip and knee.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trial {
    /// Mean square of the interaction torque, (N m)^2.
    pub(crate) interaction: [f64; 2],
    /// Mean square of the muscles' torque, (N m)^2.
    pub(crate) muscle: [f64; 2],
    /// Share of the wearer's gravity torque that the muscles give: their projection on it.
    pub(crate) gravity_share: [f64; 2],
    /// Largest deviation of the wearer's angles from the intended ones, rad rms.
    pub(crate) deviation_rad: f64,
    /// Whether the session ended by itself.
    pub(crate) has_ended: bool,
    /// Time (s) and interaction torque (N m) at 100 Hz.
    pub(crate) curve: Vec<(f64, [f64; 2])>,
}

/// Leg and wearer with a running session.
pub(crate) struct Stage<'a, const B: usize> {
    subject: &'a Subject<B>,
    /// Leg and plant.
    pub(crate) pair: Pair<2, B>,
    is_assisted: bool,
}

impl<'a, const B: usize> Stage<'a, B> {
    /// Puts the exoskeleton on a wearer, who is limp, and begins what the drives do; `None` for the leg's
    /// initial posture (rad).
    ///
    /// # Errors
    /// The wearer does not fit, or the firmware refuses the session.
    pub(crate) fn begin(
        subject: &'a Subject<B>,
        wearer: &WearerDescription,
        drives: Drives<'_>,
        posture: Option<[f64; 2]>,
    ) -> Result<Self, ToolError> {
        let (leg, context) = (&subject.exoskeleton, &subject.context);
        let mut pair = Pair::new(leg, context, subject.seed)?;
        if let Some(posture) = posture {
            pair.world.move_to(&posture);
            pair.sample = LegDrives::sample(&mut pair.world);
        }
        pair.world.wear(wearer).map_err(|error| leg.error(error.to_string()))?;
        let session = match drives {
            Drives::Off => None,
            Drives::Assist(shares, [empty, worn]) => Some((shares, empty, Some(worn))),
            Drives::AssistEmpty(shares, empty) => Some((shares, empty, None)),
        };
        if let Some((shares, empty, worn)) = session {
            let is_set = pair.leg.set_model(Wearing::Empty, *empty)
                && worn.is_none_or(|worn| pair.leg.set_model(Wearing::Worn, *worn));
            if !is_set || !pair.enable(context.gravity) {
                return Err(leg.error("the drive refused to be enabled at the start").into());
            }
            if pair.tick(Some(ControlRequest::Assist(shares)), context.gravity).refused {
                return Err(leg.error(format!("the firmware refused the session {shares:?}")).into());
            }
        }
        let is_assisted = session.is_some();
        Ok(Self { subject, pair, is_assisted })
    }

    /// Lets the wearer intend something.
    ///
    /// # Errors
    /// The motion is not permitted.
    pub fn intend(&mut self, intention: Intention) -> Result<(), ToolError> {
        let exoskeleton = &self.subject.exoskeleton;
        self.pair.world.intend(intention).map_err(|error| exoskeleton.error(error.to_string()).into())
    }

    /// Runs one tick.
    pub(crate) fn tick(&mut self) {
        self.pair.tick(None, self.subject.context.gravity);
    }

    /// Runs for a time, s.
    pub fn run(&mut self, seconds: f64) {
        (0..(seconds / TICK_S) as u64).for_each(|_| self.tick());
    }

    /// Runs for a time, s. Returns the energy that the wearer receives besides the gravity energy of the
    /// limb: the largest rise since any instant, J.
    pub(crate) fn given(&mut self, limb: &LimbAlone, seconds: f64) -> f64 {
        let (mut least, mut largest) = (f64::INFINITY, 0.0_f64);
        for _ in 0..(seconds / TICK_S) as u64 {
            self.tick();
            let truth = self.wearer();
            let received: f64 = truth.cuffs.iter().map(|cuff| cuff.received).sum();
            let energy = received - limb.gravity_energy(&truth.position);
            least = least.min(energy);
            largest = largest.max(energy - least);
        }
        largest
    }

    /// True state of the wearer.
    ///
    /// # Panics
    /// Never: a stage has a wearer.
    pub fn wearer(&self) -> WearerTruth {
        self.pair.world.wearer_truth().expect("a stage has a wearer")
    }

    /// Whether a session was begun and no longer runs.
    pub(crate) fn has_ended(&self) -> bool {
        self.is_assisted && !self.pair.leg.control().activity().assists()
    }
}

/// The wearer's limb alone: its gravity torque and potential energy.
pub(crate) struct LimbAlone {
    world: World<2>,
    mechanism: Mechanism<2>,
    directions: [f64; 2],
    zeros: [f64; 2],
}

impl LimbAlone {
    /// Limb of a wearer of a subject's exoskeleton.
    ///
    /// # Errors
    /// The exoskeleton cannot be simulated.
    pub fn new<const B: usize>(subject: &Subject<B>, wearer: &WearerDescription) -> Result<Self, ToolError> {
        let description = subject.exoskeleton.description::<2>()?;
        let limb = limb_alone(&description, wearer);
        Ok(Self {
            world: World::new(&limb, 0),
            mechanism: Mechanism::new(&limb),
            directions: description.joints.map(|joint| joint.direction),
            zeros: description.joints.map(|joint| joint.zero_offset),
        })
    }

    /// Energy in gravity at anatomical angles (rad), J.
    fn gravity_energy(&self, position: &[f64; 2]) -> f64 {
        let angles = [0, 1].map(|joint| self.directions[joint] * position[joint] + self.zeros[joint]);
        self.mechanism.potential_energy(&angles)
    }
}

/// Runs a wearer through a motion and measures.
///
/// # Errors
/// The wearer does not fit, the motion is not permitted, or the firmware refuses the session.
pub fn trial<const B: usize>(
    subject: &Subject<B>,
    wearer: &WearerDescription,
    motion: IntendedMotion,
    drives: Drives<'_>,
) -> Result<Trial, ToolError> {
    let limb = LimbAlone::new(subject, wearer)?;
    let mut stage = Stage::begin(subject, wearer, drives, None)?;
    stage.intend(Intention::Follow(motion))?;
    stage.run(SETTLING_S);
    let mut found = Trial::default();
    let (mut projected, mut needed, mut deviation) = ([0.0; 2], [0.0; 2], [0.0_f64; 2]);
    let ticks = (MEASURED_S / TICK_S) as u64;
    for tick in 0..ticks {
        stage.tick();
        let truth = stage.wearer();
        let intended = truth.intended.map_or(truth.position, |intended| intended.position);
        for joint in 0..2 {
            found.interaction[joint] += truth.interaction_torque[joint].powi(2) / ticks as f64;
            found.muscle[joint] += truth.muscle_torque[joint].powi(2) / ticks as f64;
            deviation[joint] += (truth.position[joint] - intended[joint]).powi(2) / ticks as f64;
        }
        if tick.is_multiple_of(TICKS_PER_SAMPLE) {
            // Torque against gravity.
            let weight = limb.world.inverse_dynamics(&truth.position, &[0.0; 2], &[0.0; 2]);
            for joint in 0..2 {
                projected[joint] += truth.muscle_torque[joint] * weight[joint];
                needed[joint] += weight[joint] * weight[joint];
            }
        }
        if tick.is_multiple_of(TICKS_PER_POINT) {
            found.curve.push((tick as f64 * TICK_S, truth.interaction_torque));
        }
    }
    found.gravity_share = [0, 1].map(|joint| projected[joint] / needed[joint]);
    found.deviation_rad = deviation[0].max(deviation[1]).sqrt();
    found.has_ended = stage.has_ended();
    Ok(found)
}
