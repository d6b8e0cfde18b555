//! Bodies that can exist: from base values to full parameters of every link, and what that costs.
//!
//! Base values found freely may belong to no leg: a closed-form completion can give a link an impossible inertia,
//! and noise can make a small friction negative. What is reported, stored or driven with must be a leg.
//!
//! ```text
//! minimise  |R (K p - beta)|^2 + pull |N (p - p0)|^2_W^-1
//! over      p: every link's pseudo-inertia positive, IA, FC, FV >= 0, within what the prior allows
//! ```
//!
//! | symbol | meaning |
//! | --- | --- |
//! | p, p0 | the 14 N parameters; the prior's, or a neutral leg's |
//! | K, beta | base parameters' terms; values that were found |
//! | R | weighted information factor of all rows: chi-square units |
//! | W, N | the prior's variances; projector (in their metric) on what torque does not see |
//!
//! The prior pulls only where no torque speaks: without constraints the optimum is the closed-form completion and
//! the base values stay exactly as they were found, however wrong the prior. Only constraints that the null space
//! cannot satisfy move them, and the chi-square that costs says whether the data contradict every possible leg.
//!
//! - [`Limits`]: the convex set of what is allowed;
//! - [`LegCost`]: the cost above as one triangular factor;
//! - [`Completion`]: its minimum by an interior-point method, in slices;
//! - [`FullSearch`]: the beetle swarm over log-Cholesky coordinates of every link instead, for comparison.

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
