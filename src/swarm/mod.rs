//! The optimiser room: beetle antennae search, particle swarm and beetle swarm over a box, and nothing else.
//!
//! Why a room of its own: the searches know no leg. They see a cost over a box ([`Objective`]) and are judged on
//! test functions whose minimum is known ([`TestProblem`]) before they are let near a leg.
//!
//! | search | source | evaluations per iteration |
//! | --- | --- | --- |
//! | [`Bas`] | beetle antennae search, Eqs (21)-(26) of the exoskeleton paper | 3 |
//! | [`Pso`] | particle swarm (Kennedy, Eberhart, 1995), Eqs (18)-(20) | N |
//! | [`Bso`], [`BsoSettings::Paper`] | beetle swarm, Eqs (19)-(29), (29) corrected | 3 N |
//! | [`Bso`], [`BsoSettings::Adaptive`] | the default: whiskers that share a frame, learn a metric and leap | N + 2 min(N, D) |
//!
//! What all of them keep ([`Search`]): a budget counted in evaluations, so that a run can be cut into slices
//! anywhere, also inside an iteration, without changing a bit of its result; no evaluation outside the box;
//! a cost that is not finite drops the candidate; all randomness from the seed; plain data, no heap; a dimension
//! known at run time up to the capacity `D`.
//!
//! `docs/bso.md` describes the default for reuse: pseudocode, constants, costs, what each part is worth, where it fails.
//! This room uses [`crate::real`] and nothing else of the crate.
//!
//! Source of the equations: "Lower limb exoskeleton robots' dynamics parameters identification based on improved
//! beetle swarm optimization algorithm", section 3.3; referred to as "the paper" in this room.

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
