//! Physically consistent legs: from base values to full parameters of every link, and the cost of that.
//!
//! Base values found freely may belong to no possible leg. A closed-form completion can give a link an
//! impossible inertia, and noise can make a small friction negative. Reported, stored and used parameters
//! must be consistent.
//!
//! ```text
//! minimise  |R (K p - beta)|^2 + pull |N (p - p0)|^2_W^-1
//! over      p: every link's pseudo-inertia positive, IA, FC, FV >= 0, within what the prior allows
//! ```
//!
//! | symbol | meaning |
//! | --- | --- |
//! | p, p0 | the 14 N parameters; the prior's, or a neutral leg's |
//! | K, beta | base parameters' terms; base values found |
//! | R | weighted information factor of all rows: chi-square units |
//! | W, N | the prior's variances; projector (in their metric) on directions that torque does not show |
//!
//! The prior acts only in directions that torque does not show. Without constraints the optimum is the
//! closed-form completion: the base values stay exactly as found, however wrong the prior. Only constraints
//! that the null space cannot satisfy move them. The rise in chi-square then shows whether the data
//! contradict every consistent leg.
//!
//! - [`Limits`]: the convex set of allowed parameters;
//! - [`LegCost`]: the cost above as one triangular factor;
//! - [`Completion`]: its minimum by an interior-point method, in slices;
//! - [`FullSearch`]: for comparison, the beetle swarm over log-Cholesky coordinates of every link.

mod completion;
mod cost;
mod full_search;
mod interior;
mod limits;
mod pseudo_inertia;
#[cfg(test)]
mod tests;

pub use completion::{Completion, Effort};
pub use cost::LegCost;
pub use full_search::{FullObjective, FullSearch};
pub use limits::Limits;
