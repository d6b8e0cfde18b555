//! Accepts or refuses parameters, with reasons, from the motion identified from and from held-out motions.
//!
//! | file | content | source |
//! | --- | --- | --- |
//! | `residual` | residual of a held-out motion in order of time | Bartlett 1946 |
//! | `alignment` | wrong link lengths and encoder zeros | Rao 1948 |
//! | `held_out` | residual and alignment beside the recorder | |
//! | `verdict` | evidence and limits of every test | |
//! | `judgement` | judges a solver's result by all tests | |

pub(crate) mod alignment;
pub(crate) mod held_out;
pub(crate) mod judgement;
pub(crate) mod residual;
pub mod verdict;
