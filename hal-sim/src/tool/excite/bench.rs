//! What motions of one leg are reckoned with: the assumed leg, its limits, what scores and rehearses a motion.

use std::path::PathBuf;

use scarab::ident::Estimator;
use scarab::model::{PARAMETERS_PER_JOINT, Payload};
use scarab::motion::{ExcitationTable, Periodic};
use scarab::safety::Barrier;
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::Second;

use super::assumption::{Assumption, assumed};
use super::demand::demand;
use super::design::{BLEND_S, Candidate, DesignOptions, Frame};
use super::expectation::{Rehearsal, rehearse};
use super::file::Excitation;
use super::score::Scorer;
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::motions::random_excitation;
use crate::tool::pair::{Context, Pair};
use crate::tool::simulate::SimulationOptions;
use crate::tool::words::leg_error;

/// What is asked for.
#[derive(Clone, Debug)]
pub struct ExciteOptions {
    /// Duration, seed and effort of a design.
    pub design: DesignOptions,
    /// Looked at instead of designing one.
    pub given: Option<(PathBuf, Excitation)>,
    /// Instead of the leg file's.
    pub torque_noise_percent: Option<f64>,
    /// Known masses that the leg carries.
    pub carried: Vec<Payload<f64>>,
    /// How far off each base parameter may be, percent.
    pub margin_percent: f64,
    /// What is taken for the leg.
    pub assumption: Assumption,
}

/// What the noise was reckoned from.
#[derive(Clone, Copy, Debug)]
pub struct NoiseOrigin {
    /// Of each joint's mean absolute torque on the default motion; zero where only N m are stated.
    pub percent: f64,
    /// Whose torque: `truth` or `prior`.
    pub of: &'static str,
}

/// Everything that motions of one leg are reckoned with.
#[derive(Clone, Debug)]
pub struct Bench<const N: usize, const B: usize> {
    /// As it is assumed to be.
    pub leg: LegFile,
    /// `prior` or `truth`.
    pub assumed: &'static str,
    /// What the firmware and the plant are made from.
    pub context: Context<N, B>,
    /// What scores a curve.
    pub scorer: Scorer<N, B>,
    /// Of torque limit and current limit the lower, N m.
    pub torque_limit: [f64; N],
    /// Where the noise of the torque comes from.
    pub noise: NoiseOrigin,
}

impl<const N: usize, const B: usize> Bench<N, B> {
    /// For one leg.
    ///
    /// # Errors
    /// Where the leg cannot be worked with.
    pub fn new(leg: &LegFile, options: &ExciteOptions) -> Result<Self, ToolError> {
        let file = leg;
        let (leg, word) = assumed(leg, options.assumption)?;
        let simulation = SimulationOptions {
            torque_noise_percent: options.torque_noise_percent,
            estimator: Estimator::Plain,
            ..SimulationOptions::of_seed(1)
        };
        // Noise belongs to the sensors, which are there already: whoever will meet it has measured it at rest. So it is the
        // simulated leg's even where its torque is not believed.
        let simulated = file.joints.iter().all(|joint| joint.truth.is_some());
        let noise = if simulated {
            Context::<N, B>::new(file, &simulation)?.noise
        } else {
            Context::<N, B>::new(&leg, &simulation)?.noise
        };
        let percent = options.torque_noise_percent.unwrap_or(file.torque_noise_percent);
        let origin = NoiseOrigin { percent, of: if simulated { "truth" } else { word } };
        let leg = leg.with_torque_noise(&noise);
        let simulation = SimulationOptions { torque_noise_percent: None, ..simulation };
        let context = Context::<N, B>::new(&leg, &simulation)?;
        // A leg that the firmware does not take is refused before anything is searched.
        Pair::new(&leg, &context, simulation.seed)?;
        let model = context.background.model.clone();
        let mut parameters = context.background.truth.unwrap_or([[0.0; PARAMETERS_PER_JOINT]; N]);
        options.carried.iter().for_each(|payload| payload.add_to(&mut parameters));
        let values = model.base.project(&parameters);
        let scorer = Scorer::new(
            model,
            values,
            leg.bandwidth_hz,
            reference_noise(&context.noise),
            options.margin_percent / 100.0,
            context.configuration.joints.map(|joint| Barrier::new(&joint.limits())),
        )
        .ok_or_else(|| {
            ToolError::input(format!("{}: bandwidth_hz does not fit the device's filter", leg.name))
        })?;
        let torque_limit = core::array::from_fn(|joint| {
            let joint = &leg.joints[joint];
            joint.torque_limit_nm.min(joint.current_limit() * joint.torque_per_ampere)
        });
        Ok(Self { leg, assumed: word, context, scorer, torque_limit, noise: origin })
    }

    /// Refuses to expect a sigma where the noise that it follows from is not stated.
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

    /// What a design works within.
    #[must_use]
    pub fn frame(&self) -> Frame<'_, N, B> {
        Frame {
            leg: &self.leg,
            scorer: &self.scorer,
            configuration: &self.context.configuration,
            torque_limit: self.torque_limit,
        }
    }

    /// A run of the motion on the assumed leg.
    ///
    /// # Errors
    /// Where the drive stops.
    pub fn rehearse(&self, table: &ExcitationTable<N>) -> Result<Rehearsal<N, B>, ToolError> {
        rehearse(&self.leg, table)
    }

    /// A motion from a file: proved by the firmware, its torque without margin within the limits.
    ///
    /// # Errors
    /// In words, without the file's name.
    pub fn given(&self, given: &Excitation) -> Result<Candidate<N>, ToolError> {
        let (table, motion) = (given.table::<N>(&self.leg).map_err(ToolError::input)?, given.motion()?);
        let proof = self.context.configuration.prove(motion);
        proof.map_err(|error| ToolError::input(leg_error(&self.leg, error)))?;
        let demand = demand(&self.scorer, &self.context.configuration, &motion);
        for (joint, demand) in demand.iter().enumerate() {
            let most = demand.high_nm.max(-demand.low_nm);
            if !(most <= self.torque_limit[joint]) {
                return Err(ToolError::input(format!(
                    "joint {}: the motion takes {most:.1} N m by the {}, the limit is {:.1}",
                    self.leg.joints[joint].name, self.assumed, self.torque_limit[joint]
                )));
            }
            if demand.cut_nm > 0.0 {
                return Err(ToolError::input(format!(
                    "joint {}: too fast near an end of its range to stop there; the monitor would take {:.1} N m from it",
                    self.leg.joints[joint].name, demand.cut_nm
                )));
            }
        }
        Ok(Candidate { table, motion, demand })
    }

    /// The best of 300 random motions, as many cycles as fill a duration; fewer where the limits slow it down; and
    /// whether it keeps the limits of torque that a design keeps.
    #[must_use]
    pub fn random(&self, duration_s: f64, cycles: u32) -> Option<(Rehearsal<N, B>, bool)> {
        let steady = duration_s - 2.0 * f64::from(BLEND_S);
        let period = Second((steady / f64::from(cycles)) as f32);
        let limits = self.context.configuration.envelope();
        let motion = random_excitation(&self.context.background.model, &limits, period, cycles)?;
        let table = table_of(&motion);
        // A tick of rounding does not cost a cycle.
        let fitting = ((steady + 0.01) / f64::from(table.period_s)) as u32;
        let table = ExcitationTable { cycles: cycles.min(fitting.max(1)), ..table };
        let demand = demand(&self.scorer, &self.context.configuration, &motion);
        let keeps = (0..N).all(|joint| demand[joint].is_within(self.torque_limit[joint]));
        Some((self.rehearse(&table).ok()?, keeps))
    }
}

/// Noise to weigh the joints with, N m; where a motion is only checked, none need be stated.
fn reference_noise<const N: usize>(noise_nm: &[f64; N]) -> [f64; N] {
    noise_nm.map(|noise| if noise > 0.0 { noise } else { 1.0 })
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
