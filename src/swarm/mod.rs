//! Optimisers over a box: beetle antennae search, particle swarm and beetle swarm.
//!
//! Why a separate module: the searches are independent of the leg. Their input is a cost over
//! a box ([`Objective`]). Test functions with a known minimum ([`TestProblem`]) judge them
//! before they are applied to a leg.
//!
//! | search | source | evaluations per iteration |
//! | --- | --- | --- |
//! | [`Bas`] | beetle antennae search, Eqs (21)-(26) of the exoskeleton paper | 3 |
//! | [`Pso`] | particle swarm (Kennedy, Eberhart, 1995), Eqs (18)-(20) | N |
//! | [`Bso`], [`BsoSettings::Paper`] | beetle swarm, Eqs (19)-(29), (29) corrected | 3 N |
//! | [`Bso`], [`BsoSettings::Adaptive`] | default: shared frame, metric, leaps | 20 to 60 for N = 20 |
//!
//! Common contract ([`Search`]): the budget counts evaluations, so a run can be sliced anywhere, even inside
//! an iteration, with bit-identical results. No evaluation is outside the box. A candidate whose cost is not
//! finite is dropped. All randomness comes from the seed. All state is plain data without heap. The dimension
//! is known at run time, up to the capacity `D`.
//!
//! `docs/bso.md` describes the default for reuse: pseudocode, constants, costs, contribution of each part,
//! failures. This module uses [`crate::real`] and nothing else of the crate.
//!
//! Source of the equations: "Lower limb exoskeleton robots' dynamics parameters identification based on
//! improved beetle swarm optimization algorithm", section 3.3; called "the paper" in this module.

mod antennae_search;
mod beetle_swarm;
#[cfg(test)]
mod contract;
mod functions;
mod objective;
mod particle_swarm;
mod particles;
mod random;
mod rows;
mod search;

pub use antennae_search::{Bas, BasSettings};
pub use beetle_swarm::{AdaptiveSettings, Bso, BsoSettings, PaperSettings, Part};
pub use functions::{TestFunction, TestProblem};
pub use objective::{Objective, SwarmError};
pub use particle_swarm::{Pso, PsoSettings};
pub use particles::InertiaWeight;
pub use random::Random;
pub use search::{Best, Search};
