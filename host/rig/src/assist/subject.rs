//! A leg with its wearer, and the models that the firmware identified of both.
//!
//! Two identifications on the simulated hardware: the exoskeleton alone (`empty`), and the exoskeleton on the
//! limp wearer (`worn`). Both have the sensors' noise of the worn leg: a sensor does not know who wears it.

use crate::report::assist::RefusedReport;
use hal_sim::wearer::description::WearerDescription;
use scarab::ident::{Estimate, prior_parameters};
use scarab::leg::{IdentifiedModel, Wearing};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::leg::two_bodies::{MuscleTone, TwoBodies};

use crate::identified::identify;
use crate::options::SimulationOptions;
use crate::pair::{Context, Pair};
use crate::worn::{certain, single};

/// Models of one body.
#[derive(Clone, Debug)]
pub struct Models<const B: usize> {
    /// Model that the firmware accepted, with its confidence bounds.
    pub identified: IdentifiedModel<2>,
    /// Its estimate.
    pub(crate) estimate: Estimate<f32, B>,
    /// Model with the true parameters, certain.
    pub(crate) truth: IdentifiedModel<2>,
    /// Model of the leg file's prior, taken as certain.
    pub(crate) prior: Option<IdentifiedModel<2>>,
    /// True base values.
    pub(crate) true_values: [f32; B],
}

/// Leg, wearer and models.
#[derive(Clone, Debug)]
pub struct Subject<const B: usize> {
    /// Seed of noise and search.
    pub(crate) seed: u64,
    /// Exoskeleton alone.
    pub exoskeleton: LegFile,
    /// Wearer and exoskeleton apart.
    pub bodies: TwoBodies,
    /// Data of the exoskeleton's runs.
    pub context: Context<2, B>,
    /// The exoskeleton alone.
    pub empty: Models<B>,
    /// The exoskeleton on its wearer; `None` if the firmware refused that result.
    pub(crate) worn: Option<Models<B>>,
    /// Refused results.
    pub(crate) refused: Vec<RefusedReport>,
}

/// Cuffs of a wearer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuffs {
    /// Stiffness across the segment, N/m.
    pub stiffness: f64,
    /// Damping across the segment, N s/m.
    pub damping: f64,
}

impl Cuffs {
    /// A wearer with these cuffs; stiffness and damping along the segment keep their ratio.
    pub fn on(&self, wearer: &WearerDescription) -> WearerDescription {
        let cuffs = wearer.cuffs.map(|mut cuff| {
            let stiffer = self.stiffness / cuff.across.stiffness;
            let damped = self.damping / cuff.across.damping;
            for spring in [&mut cuff.along, &mut cuff.across] {
                spring.stiffness *= stiffer;
                spring.damping *= damped;
            }
            cuff
        });
        WearerDescription { cuffs, ..*wearer }
    }
}

impl<const B: usize> Subject<B> {
    /// Identifies a leg file's exoskeleton alone and on its limp wearer. The inner `Err` is a refused result
    /// of the exoskeleton alone, without which nothing can be compensated.
    ///
    /// # Errors
    /// The leg has no wearer to be taken off, cannot be simulated, or its drive stops.
    pub fn identify(
        leg: &LegFile,
        cuffs: &Cuffs,
        seed: u64,
    ) -> Result<Result<Self, RefusedReport>, ToolError> {
        let bodies = TwoBodies::from_leg(leg)?;
        let options = SimulationOptions::with_seed(seed);
        let noise = Context::<2, B>::new(leg, &options)?.noise;
        let worn_leg = leg.clone().with_torque_noise(&noise);
        let exoskeleton = bodies.exoskeleton.clone().with_torque_noise(&noise);
        let context = Context::new(&exoskeleton, &options)?;
        let worn_context = Context::new(&worn_leg, &options)?;
        let limp = cuffs.on(&bodies.wearer(MuscleTone::Relaxed));
        let refused = |model, reasons| RefusedReport { seed, model, reasons };
        let empty = match models(&exoskeleton, &context, None, seed)? {
            Ok(models) => models,
            Err(reasons) => return Ok(Err(refused("empty", reasons))),
        };
        let worn = models(&exoskeleton, &worn_context, Some(&limp), seed)?;
        let (worn, refused) = match worn {
            Ok(models) => (Some(models), Vec::new()),
            Err(reasons) => (None, vec![refused("worn", reasons)]),
        };
        Ok(Ok(Self { seed, exoskeleton, bodies, context, empty, worn, refused }))
    }
}

impl<const B: usize> Subject<B> {
    /// Models of the exoskeleton on its wearer.
    ///
    /// # Errors
    /// The firmware refused that result.
    pub fn worn(&self) -> Result<&Models<B>, ToolError> {
        let missing = || self.exoskeleton.error("the identification with its wearer was refused").into();
        self.worn.as_ref().ok_or_else(missing)
    }
}

/// Identifies the exoskeleton, alone or on a limp wearer; `context` has the prior and the truth of the whole.
fn models<const B: usize>(
    exoskeleton: &LegFile,
    context: &Context<2, B>,
    wearer: Option<&WearerDescription>,
    seed: u64,
) -> Result<Result<Models<B>, Vec<&'static str>>, ToolError> {
    let mut pair = Pair::new(exoskeleton, context, seed)?;
    let wearing = match wearer {
        Some(_) => Wearing::Worn,
        None => Wearing::Empty,
    };
    if let Some(wearer) = wearer {
        pair.world.wear(wearer).map_err(|error| exoskeleton.error(error.to_string()))?;
    }
    pair.leg.set_wearing(Some(wearing));
    if let Err(reasons) = identify(exoskeleton, context, &mut pair)? {
        return Ok(Err(reasons));
    }
    let identified = pair.leg.control().model_of(wearing).copied();
    let estimate = pair.leg.identification().solver().map(|solver| solver.estimate());
    let (Some(identified), Some(estimate)) = (identified, estimate) else {
        return Err(exoskeleton.error("the accepted model was not stored").into());
    };
    let background = &context.background;
    let truth = background.truth.as_ref().ok_or_else(|| exoskeleton.error("has no `truth`"))?;
    let true_values = context.configuration.model.base.project(&single(truth));
    Ok(Ok(Models {
        identified,
        estimate,
        truth: certain(context, truth),
        prior: background.prior.as_ref().map(|prior| certain(context, &prior_parameters(prior))),
        true_values,
    }))
}
