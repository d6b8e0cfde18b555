//! A leg that assists a walking wearer, as the base of a campaign's forks.
//!
//! The leg file's `assist` states the shares, and the start button begins the session. The models are the
//! true ones: the campaign tests what the drive does with a fault, not with a wrong model.

use hal_sim::wearer::description::WearerDescription;
use hal_sim::wearer::motion::IntendedMotion;
use hal_sim::wearer::muscles::Intention;
use scarab::leg::{IdentifiedModel, Wearing};
use scarab::model::planar::{BASE, JOINTS};

use crate::base::error::ToolError;
use crate::formats::leg_file::LegFile;
use crate::leg::two_bodies::{MuscleTone, TwoBodies};
use crate::rig::faulty_board::{PERIODS_PER_S, Rig};
use crate::rig::options::SimulationOptions;
use crate::rig::pair::Context;
use crate::run::assist::motions::{Exercise, hip_and_knee};
use crate::run::assist::subject::certain;

/// Periods of a session in which faults are injected: the fade-in, the oscillators' learning, and steady
/// walking.
pub const LENGTH: u64 = 20 * PERIODS_PER_S;
/// Strides per second of the wearer.
const CADENCE_HZ: f64 = 0.8;

/// Exoskeleton, its wearer, and the models of both.
pub struct Worn {
    /// Leg file of the exoskeleton alone.
    pub exoskeleton: LegFile,
    wearer: WearerDescription,
    motion: IntendedMotion,
    models: [IdentifiedModel<JOINTS>; 2],
}

impl Worn {
    /// Takes exoskeleton and wearer of a leg file apart; `None` for a leg that does not assist.
    pub fn of(leg: &LegFile, seed: u64) -> Result<Option<Self>, ToolError> {
        if leg.assist.is_none() {
            return Ok(None);
        }
        let bodies = TwoBodies::of(leg)?;
        let exoskeleton = LegFile { assist: leg.assist, ..bodies.exoskeleton.clone() };
        let model = |leg: &LegFile| -> Result<IdentifiedModel<JOINTS>, ToolError> {
            let context = Context::<JOINTS, BASE>::new(leg, &SimulationOptions::of_seed(seed))?;
            let truth = context.background.truth.as_ref().ok_or_else(|| leg.error("has no `truth`"))?;
            Ok(certain(&context, truth))
        };
        let joints = hip_and_knee(&exoskeleton).ok_or_else(|| leg.error("is no hip with a knee"))?;
        let motion = Exercise::Gait(CADENCE_HZ).intended(joints, seed);
        let models = [model(&exoskeleton)?, model(leg)?];
        let wearer = bodies.wearer(MuscleTone::Firm);
        Ok(Some(Self { exoskeleton, wearer, motion, models }))
    }

    /// Puts the leg on its wearer, who is limp, and gives the firmware both models.
    pub fn dress(&self, rig: &mut Rig<JOINTS, BASE>) -> Result<(), ToolError> {
        rig.world.wear(&self.wearer).map_err(|error| self.exoskeleton.error(error.to_string()))?;
        let [empty, worn] = self.models;
        if rig.leg.set_model(Wearing::Empty, empty) && rig.leg.set_model(Wearing::Worn, worn) {
            return Ok(());
        }
        Err(self.exoskeleton.error("the firmware refused the models").into())
    }

    /// Lets the wearer walk from now on.
    pub fn walk(&self, rig: &mut Rig<JOINTS, BASE>) -> Result<(), ToolError> {
        let intention = Intention::Follow(self.motion);
        rig.world.intend(intention).map_err(|error| self.exoskeleton.error(error.to_string()).into())
    }
}
