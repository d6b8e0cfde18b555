//! A leg on a wearer who moves, with the models of both.
//!
//! The models are the true ones: what is tried is what drive and host do with a session of assistance, not
//! with a wrong model.

use hal_sim::wearer::description::WearerDescription;
use hal_sim::wearer::motion::IntendedMotion;
use hal_sim::wearer::muscles::Intention;
use scarab::leg::{Activity, Assured, IdentifiedModel, Wearing};
use scarab::model::{LegParameters, Parameter};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::leg::exercise::{Exercise, hip_and_knee};
use scarab_identify::leg::two_bodies::{MuscleTone, TwoBodies};

use crate::faulty_board::Rig;
use crate::options::SimulationOptions;
use crate::pair::Context;

/// Strides per second of a wearer who walks.
pub const CADENCE_HZ: f64 = 0.8;

/// Exoskeleton, its wearer, and the models of both.
pub struct Worn<const N: usize> {
    /// Leg file of the exoskeleton alone.
    pub(crate) exoskeleton: LegFile,
    wearer: WearerDescription,
    motion: IntendedMotion,
    models: [IdentifiedModel<N>; 2],
    is_moving: bool,
}

impl<const N: usize> Worn<N> {
    /// Takes exoskeleton and wearer of a leg file apart.
    ///
    /// # Errors
    /// The leg is not a hip and a knee, does not state its wearer, or cannot be simulated.
    pub fn new<const B: usize>(leg: &LegFile, exercise: Exercise, seed: u64) -> Result<Self, ToolError> {
        let bodies = TwoBodies::from_leg(leg)?;
        let exoskeleton = LegFile { assist: leg.assist, ..bodies.exoskeleton.clone() };
        let model = |leg: &LegFile| -> Result<IdentifiedModel<N>, ToolError> {
            let context = Context::<N, B>::new(leg, &SimulationOptions::with_seed(seed))?;
            let truth = context.background.truth.as_ref().ok_or_else(|| leg.error("has no `truth`"))?;
            Ok(certain(&context, truth))
        };
        let joints = hip_and_knee(&exoskeleton).ok_or_else(|| leg.error("is no hip with a knee"))?;
        let motion = exercise.intended(joints, seed);
        let models = [model(&exoskeleton)?, model(leg)?];
        let wearer = bodies.wearer(MuscleTone::Firm);
        Ok(Self { exoskeleton, wearer, motion, models, is_moving: false })
    }

    /// Puts the leg on its wearer, who is limp, and gives the firmware both models.
    ///
    /// # Errors
    /// The wearer does not fit the leg, or the firmware refuses the models.
    pub fn dress<const B: usize>(&self, rig: &mut Rig<N, B>) -> Result<(), ToolError> {
        rig.world.wear(&self.wearer).map_err(|error| self.exoskeleton.error(error.to_string()))?;
        let [empty, worn] = self.models;
        if rig.leg.set_model(Wearing::Empty, empty) && rig.leg.set_model(Wearing::Worn, worn) {
            return Ok(());
        }
        Err(self.exoskeleton.error("the firmware refused the models").into())
    }

    /// Lets the wearer move from now on.
    ///
    /// # Errors
    /// The motion is not permitted.
    pub(crate) fn walk<const B: usize>(&self, rig: &mut Rig<N, B>) -> Result<(), ToolError> {
        self.intend(rig, Intention::Follow(self.motion))
    }

    /// Lets the wearer move while the leg assists, and be limp otherwise: a session begins at rest.
    ///
    /// # Errors
    /// The motion is not permitted.
    pub(crate) fn accompany<const B: usize>(&mut self, rig: &mut Rig<N, B>) -> Result<(), ToolError> {
        let assists = matches!(rig.leg.control().activity(), Activity::Assist(_));
        if core::mem::replace(&mut self.is_moving, assists) == assists {
            return Ok(());
        }
        self.intend(rig, if assists { Intention::Follow(self.motion) } else { Intention::Limp })
    }

    fn intend<const B: usize>(&self, rig: &mut Rig<N, B>, intention: Intention) -> Result<(), ToolError> {
        rig.world.intend(intention).map_err(|error| self.exoskeleton.error(error.to_string()).into())
    }
}

/// Parameters in single precision.
pub(crate) fn single<const N: usize>(parameters: &LegParameters<f64, N>) -> LegParameters<f32, N> {
    parameters.map(|joint| joint.map(|value| value as f32))
}

/// Model of known parameters, which may be compensated wholly.
pub(crate) fn certain<const N: usize, const B: usize>(
    context: &Context<N, B>,
    parameters: &LegParameters<f64, N>,
) -> IdentifiedModel<N> {
    let parameters = single(parameters);
    let model = &context.configuration.model;
    let of = |parameter: Parameter| parameters.map(|joint| joint[parameter.index()]);
    let assured = Assured { coulomb_nm: of(Parameter::FC), viscous: of(Parameter::FV), inertia_share: 1.0 };
    IdentifiedModel::new(model, &model.base.project(&parameters)).with_assured(assured)
}
