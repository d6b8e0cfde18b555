//! Settings of the beetle swarm's two modes.
//!
//! Why so few settings: one set of constants serves every function, dimension and identification problem. The
//! ablation experiments' variables are settings; all other constants are beside the code that uses them.

use crate::real::Real;

use super::super::objective::{SwarmError, not_negative, positive};
use super::super::particles::InertiaWeight;

/// Choice of the beetles' rules.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BsoSettings<T> {
    /// Shared whisker frame, learned metric, retreat, restart: the default.
    Adaptive(AdaptiveSettings<T>),
    /// Eqs (19)-(29) of the paper as printed, (29) corrected; for comparison.
    Paper(PaperSettings<T>),
}

impl<T: Real> Default for BsoSettings<T> {
    fn default() -> Self {
        Self::Adaptive(AdaptiveSettings::default())
    }
}

impl<T: Real> BsoSettings<T> {
    /// The paper's rules with the paper's constants.
    pub fn paper() -> Self {
        Self::Paper(PaperSettings::default())
    }

    pub(super) fn check(&self) -> Result<(), SwarmError> {
        match self {
            Self::Adaptive(settings) => settings.check(),
            Self::Paper(settings) => settings.check(),
        }
    }
}

/// Constants of the adaptive mode. All lengths are shares of the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveSettings<T> {
    /// w of Eq. (19); default 0.8.
    pub inertia_weight: T,
    /// c1, pull towards the beetle's own best; default 1.4.
    pub individual_learning: T,
    /// c2, pull towards the swarm's best; default 1.4.
    pub global_learning: T,
    /// Largest speed per coordinate and move; default 0.2.
    pub velocity_limit: T,
    /// lambda of Eq. (29), share of the velocity in a move; default 0.2. With 0.4 the tails get longer.
    pub velocity_share: T,
    /// Longest whisker and longest step along one direction of the frame, in a leap longest step along a
    /// coordinate; default 0.5.
    pub step_limit: T,
    /// Directions of the frame (after the gradient's) that join two personal bests; default 12.
    pub pair_directions: usize,
    /// Rounds without progress before the swarm leaps or, in the end, is scattered
    /// again; default 8, at least 1.
    pub patience: u32,
    /// Failed leaps in a row that are allowed before the swarm is scattered again; default 4.
    pub leaps: u32,
    /// Part to disable, to measure its contribution; default none.
    pub without: Option<Part>,
}

/// Parts of the adaptive mode that can be disabled; the others are disabled through their settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Steps along the directions of the other beetles' whiskers.
    Sharing,
    /// The learned metric.
    Metric,
    /// Pause of the metric's learning where readings are not convex.
    ConvexityGate,
    /// The frame's first direction along the gradient.
    GradientDirection,
    /// Undoing of a bad move.
    Retreat,
    /// Trust in other beetles' whiskers that follows success; disabled it is 1.
    TrustAdaptation,
    /// Whiskers for the best beetles; disabled always for the same ones.
    Ranking,
    /// Moves for the best beetles; disabled all move in every round.
    BestMove,
    /// Whisker length that follows the steps; disabled it falls by 5 % per round.
    WhiskerAdaptation,
    /// Whiskers that do not get shorter at a kink.
    Kink,
    /// Whiskers of at least a share of the distance between personal bests.
    Distance,
    /// Newton's step along a direction; disabled it is one whisker downhill.
    Parabola,
}

impl<T: Real> Default for AdaptiveSettings<T> {
    fn default() -> Self {
        Self {
            inertia_weight: T::from_double(0.8),
            individual_learning: T::from_double(1.4),
            global_learning: T::from_double(1.4),
            velocity_limit: T::from_double(0.2),
            velocity_share: T::from_double(0.2),
            step_limit: T::from_double(0.5),
            pair_directions: 12,
            patience: 8,
            leaps: 4,
            without: None,
        }
    }
}

impl<T: Real> AdaptiveSettings<T> {
    fn check(&self) -> Result<(), SwarmError> {
        not_negative("inertia_weight", self.inertia_weight)?;
        not_negative("individual_learning", self.individual_learning)?;
        not_negative("global_learning", self.global_learning)?;
        not_negative("velocity_limit", self.velocity_limit)?;
        not_negative("velocity_share", self.velocity_share)?;
        positive("step_limit", self.step_limit)?;
        if self.patience == 0 { Err(SwarmError::Setting("patience")) } else { Ok(()) }
    }
}

/// Constants of the paper's mode (its section 4.1). Lengths are shares of the box; a whisker and a step are
/// also multiplied by the velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperSettings<T> {
    /// w of Eqs (19), (20); default 0.8 throughout.
    pub inertia_weight: InertiaWeight<T>,
    /// c1 of Eq. (19); default 1.4.
    pub individual_learning: T,
    /// c2 of Eq. (19); default 1.4.
    pub global_learning: T,
    /// Largest speed per coordinate and iteration; demanded but not given by the paper; default 0.2.
    pub velocity_limit: T,
    /// lambda of Eq. (29), share of the velocity in a move; not given by the paper; default 0.4.
    pub velocity_share: T,
    /// delta at the first iteration; default 1.
    pub first_step: T,
    /// e1 of Eq. (25), factor on delta per iteration; default 0.95.
    pub step_decay: T,
    /// e0 of Eq. (25), added to delta per iteration; default 0.005.
    pub step_offset: T,
    /// e2 of Eq. (26), delta over whisker length; default 10, not zero.
    pub step_per_whisker: T,
}

impl<T: Real> Default for PaperSettings<T> {
    fn default() -> Self {
        Self {
            inertia_weight: InertiaWeight::constant(T::from_double(0.8)),
            individual_learning: T::from_double(1.4),
            global_learning: T::from_double(1.4),
            velocity_limit: T::from_double(0.2),
            velocity_share: T::from_double(0.4),
            first_step: T::one(),
            step_decay: T::from_double(0.95),
            step_offset: T::from_double(0.005),
            step_per_whisker: T::from_double(10.0),
        }
    }
}

impl<T: Real> PaperSettings<T> {
    fn check(&self) -> Result<(), SwarmError> {
        not_negative("inertia_weight", self.inertia_weight.first)?;
        not_negative("inertia_weight", self.inertia_weight.last)?;
        not_negative("individual_learning", self.individual_learning)?;
        not_negative("global_learning", self.global_learning)?;
        not_negative("velocity_limit", self.velocity_limit)?;
        not_negative("velocity_share", self.velocity_share)?;
        not_negative("first_step", self.first_step)?;
        not_negative("step_decay", self.step_decay)?;
        not_negative("step_offset", self.step_offset)?;
        positive("step_per_whisker", self.step_per_whisker)
    }
}
