//! Assumed leg with its limits, and everything that scores and simulates its motions.

use std::path::PathBuf;

use scarab::ident::Estimator;
use scarab::model::{PARAMETERS_PER_JOINT, Payload};
use scarab::motion::{ExcitationTable, Periodic};
use scarab::safety::Barrier;
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::Second;
use scarab_base::error::ToolError;
use scarab_identify::formats::excitation::{Excitation, LONGEST_S};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::leg::motions::random_excitation;
use scarab_identify::leg::words::leg_error;

use crate::excite::assumption::{Assumption, assumed};
use crate::excite::demand::demand;
use crate::excite::design::{BLEND_S, Candidate, DesignOptions};
use crate::excite::expectation::{Rehearsal, rehearse};
use crate::excite::score::Scorer;
use crate::options::SimulationOptions;
use crate::pair::{Context, Pair};

/// Options of `excite`.
#[derive(Clone, Debug)]
pub struct ExciteOptions {
    /// Duration, seed and effort of a design.
    pub design: DesignOptions,
    /// Motion to be checked instead of a design.
    pub given: Option<(PathBuf, Excitation)>,
    /// Replaces the noise of the leg file, percent.
    pub torque_noise_percent: Option<f64>,
    /// Known masses that the leg carries.
    pub carried: Vec<Payload<f64>>,
    /// Assumed error of each base parameter, percent.
    pub margin_percent: f64,
    /// Description of the leg to be assumed.
    pub assumption: Assumption,
}

/// Largest assumed error of the base parameters, percent.
const LARGEST_MARGIN_PERCENT: f64 = 200.0;
/// Fewest evaluations of a design.
pub const FEWEST_EVALUATIONS: u32 = 600;
/// Most evaluations of a design.
pub const MOST_EVALUATIONS: u32 = 10_000_000;

impl ExciteOptions {
    /// Options for the leg as its file states it, with its best description.
    pub(crate) fn plain(design: DesignOptions, margin_percent: f64) -> Self {
        let (given, torque_noise_percent, carried) = (None, None, Vec::new());
        Self { design, given, torque_noise_percent, carried, margin_percent, assumption: Assumption::Best }
    }

    /// Checks duration, margin and effort.
    ///
    /// # Errors
    /// Names the option and its limits.
    pub fn check(&self) -> Result<(), String> {
        let DesignOptions { duration_s, evaluations, .. } = self.design;
        if !(0.0..=LARGEST_MARGIN_PERCENT).contains(&self.margin_percent) {
            return Err(format!("--torque-margin: must be a percentage from 0 to {LARGEST_MARGIN_PERCENT}"));
        }
        if !(duration_s > 0.0 && duration_s <= LONGEST_S) {
            return Err(format!("--duration: must be above 0 and at most {LONGEST_S} s"));
        }
        if !(FEWEST_EVALUATIONS..=MOST_EVALUATIONS).contains(&evaluations) {
            return Err(format!("--evaluations: must be from {FEWEST_EVALUATIONS} to {MOST_EVALUATIONS}"));
        }
        Ok(())
    }
}

/// Reference of the torque noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NoiseOrigin {
    /// Percent of each joint's mean absolute torque on the default motion; zero if only N m are stated.
    pub(crate) percent: f64,
    /// Leg whose torque is meant: `truth` or `prior`.
    pub(crate) of: &'static str,
}

/// Everything needed to score and simulate motions of one leg.
#[derive(Clone, Debug)]
pub struct Bench<const N: usize, const B: usize> {
    /// Assumed leg.
    pub(crate) leg: LegFile,
    /// `prior` or `truth`.
    pub(crate) assumed: &'static str,
    /// Data from which firmware and plant are built.
    pub(crate) context: Context<N, B>,
    /// Scores a curve.
    pub(crate) scorer: Scorer<N, B>,
    /// Lower of torque limit and current limit, N m.
    pub(crate) torque_limit: [f64; N],
    /// Reference of the torque noise.
    pub(crate) noise: NoiseOrigin,
}

impl<const N: usize, const B: usize> Bench<N, B> {
    /// Prepares one leg.
    ///
    /// # Errors
    /// The leg file cannot be used.
    pub fn new(leg: &LegFile, options: &ExciteOptions) -> Result<Self, ToolError> {
        let file = leg;
        let (leg, word) = assumed(leg, options.assumption)?;
        let simulation = SimulationOptions {
            torque_noise_percent: options.torque_noise_percent,
            estimator: Estimator::Plain,
            ..SimulationOptions::with_seed(1)
        };
        // Noise is a property of the sensors, which already exist and can be measured at rest. The simulated
        // leg's noise is therefore used even if its torque is not.
        let simulated = file.joints.iter().all(|joint| joint.truth.is_some());
        let noise = Context::<N, B>::new(if simulated { file } else { &leg }, &simulation)?.noise;
        let percent = options.torque_noise_percent.unwrap_or(file.torque_noise_percent);
        let origin = NoiseOrigin { percent, of: if simulated { "truth" } else { word } };
        let leg = leg.with_torque_noise(&noise);
        let simulation = SimulationOptions { torque_noise_percent: None, ..simulation };
        let context = Context::<N, B>::new(&leg, &simulation)?;
        // Rejects a leg that the firmware does not accept before any search.
        Pair::new(&leg, &context, simulation.seed)?;
        let model = context.background.model.clone();
        let mut parameters = context.background.truth.unwrap_or([[0.0; PARAMETERS_PER_JOINT]; N]);
        options.carried.iter().for_each(|payload| payload.add_to(&mut parameters));
        let values = model.base.project(&parameters);
        let scorer = Scorer::new(
            model,
            values,
            leg.bandwidth_hz,
            // Weights of the joints; a motion that is only checked needs none.
            context.noise.map(|noise| if noise > 0.0 { noise } else { 1.0 }),
            options.margin_percent / 100.0,
            context.configuration.joints.map(|joint| Barrier::new(&joint.limits())),
        )
        .ok_or_else(|| {
            ToolError::input(format!("{}: bandwidth_hz does not fit the device's filter", leg.name))
        })?;
        let torque_limit = core::array::from_fn(|joint| leg.joints[joint].torque_cap());
        Ok(Self { leg, assumed: word, context, scorer, torque_limit, noise: origin })
    }

    /// Rejects an expected sigma if the noise behind it is not stated.
    ///
    /// # Errors
    /// Names the joint, the keys and the option.
    pub fn require_noise(&self) -> Result<(), ToolError> {
        let silent = self.leg.joints.iter().zip(&self.context.noise).find(|(_, noise)| !(**noise > 0.0));
        let Some((joint, _)) = silent else { return Ok(()) };
        Err(ToolError::input(format!(
            "{}: joint `{}`: the noise of its logged torque is not stated, and sigma follows from it. State its standard \
             deviation at rest by --torque-noise-nm NM[,NM..] or by `current_noise_a` in the leg file, or a percentage by \
             --torque-noise or `torque_noise_percent`",
            self.leg.name, joint.name
        )))
    }

    /// Reads a motion from a file; the firmware must accept it, and its torque without margin must
    /// keep the limits.
    ///
    /// # Errors
    /// Describes the error, without the file's name.
    pub fn given(&self, given: &Excitation) -> Result<Candidate<N>, ToolError> {
        let (table, motion) = (given.table::<N>(&self.leg).map_err(ToolError::input)?, given.motion()?);
        let proof = self.context.configuration.prove(motion);
        proof.map_err(|error| ToolError::input(leg_error(&self.leg, error)))?;
        let demand = demand(&self.scorer, &self.context.configuration, &motion);
        for (joint, demand) in demand.iter().enumerate() {
            let most = demand.high_nm.max(-demand.low_nm);
            if !(most <= self.torque_limit[joint]) {
                return Err(ToolError::input(format!(
                    "joint {}: the motion needs {most:.1} N m by the {}, limit {:.1} N m",
                    self.leg.joints[joint].name, self.assumed, self.torque_limit[joint]
                )));
            }
            if demand.cut.by_nm > 0.0
                && let Some(obstacle) = demand.obstacle(joint, f64::INFINITY)
            {
                let inertia = f64::from(self.context.configuration.joints[joint].inertia.0);
                return Err(ToolError::input(obstacle.words(&self.leg, inertia, self.scorer.margin)));
            }
        }
        Ok(Candidate { table, motion, demand })
    }

    /// The best of 300 random motions, and whether it keeps the torque limits of a design. As many
    /// cycles as fit the duration; fewer where the limits slow the motion down.
    pub fn random(&self, duration_s: f64, cycles: u32) -> Option<(Rehearsal<N, B>, bool)> {
        let steady = duration_s - 2.0 * f64::from(BLEND_S);
        let period = Second((steady / f64::from(cycles)) as f32);
        let limits = self.context.configuration.envelope();
        let motion = random_excitation(&self.context.background.model, &limits, period, cycles)?;
        let table = table_of(&motion);
        // One tick of rounding must not remove a cycle.
        let fitting = ((steady + 0.01) / f64::from(table.period_s)) as u32;
        let table = ExcitationTable { cycles: cycles.min(fitting.max(1)), ..table };
        let demand = demand(&self.scorer, &self.context.configuration, &motion);
        let keeps = (0..N).all(|joint| demand[joint].is_within(self.torque_limit[joint]));
        Some((rehearse(&self.leg, &table).ok()?, keeps))
    }
}

fn table_of<const N: usize>(motion: &Periodic<N>) -> ExcitationTable<N> {
    let curve = motion.curve();
    ExcitationTable {
        period_s: curve.period().0,
        blend_s: motion.blend_ticks() as f32 / SERVO_RATE_HZ as f32,
        cycles: (motion.duration_ticks() - 2 * motion.blend_ticks()) / motion.period_ticks(),
        centre_rad: curve.centre_rad(),
        sine_rad: curve.sine_rad(),
        cosine_rad: curve.cosine_rad(),
    }
}
