//! Options of a simulated run.

use scarab::ident::{Estimator, Plan};
use scarab::model::Payload;
use scarab_identify::formats::excitation::Excitation;
use scarab_identify::leg::setup::PriorChoice;

use crate::perturb::Perturbation;

/// Kind of simulated drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveModel {
    /// Ideal current with a lag.
    #[default]
    Ideal,
    /// Motor, bridge, shunts, counter and supply, under the board's current loops.
    Full,
}

impl DriveModel {
    /// Name in reports and options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ideal => "ideal",
            Self::Full => "full",
        }
    }
}

/// Options of a simulated run.
#[derive(Clone, Debug)]
pub struct SimulationOptions {
    /// Seed of noise, pushes and a wrong prior.
    pub seed: u64,
    /// Seed of the swarm.
    pub swarm_seed: u64,
    /// Replaces the noise of the leg file, percent.
    pub torque_noise_percent: Option<f64>,
    /// Ideal or complete drives.
    pub drive: DriveModel,
    /// One-time or sequential.
    pub plan: Plan,
    /// Prior for the search box.
    pub prior: PriorChoice,
    /// Known mass for a second run, which determines the torque constants.
    pub payload: Option<Payload<f64>>,
    /// Known mass that the leg carries all the time.
    pub load: Option<Payload<f64>>,
    /// Deliberate errors.
    pub perturbations: Vec<Perturbation>,
    /// Estimator; the robust one excludes disturbances and searches Stribeck friction by itself.
    pub estimator: Estimator,
    /// Whether curves are recorded.
    pub with_series: bool,
    /// Replaces the default motion; see [`crate::excite::run::check`].
    pub excitation: Option<Excitation>,
}

impl SimulationOptions {
    /// Options for the unchanged leg file, with both seeds equal.
    pub fn with_seed(seed: u64) -> Self {
        Self {
            seed,
            swarm_seed: seed,
            torque_noise_percent: None,
            drive: DriveModel::Ideal,
            plan: Plan::OneTime,
            prior: PriorChoice::Default,
            payload: None,
            load: None,
            perturbations: Vec::new(),
            estimator: Estimator::Robust,
            with_series: false,
            excitation: None,
        }
    }
}
