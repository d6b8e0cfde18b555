//! Detects that an accepted model no longer fits, and finds the cause.
//!
//! | file | content | source |
//! | --- | --- | --- |
//! | `baseline` | reference from the accepted identification | |
//! | `detection` | detects a change of the residual in motion | Page 1954; Lorden 1971; Siegmund 1985 |
//! | `update` | cause of the change, from gait alone | Aitken 1935; Akaike 1974 |

pub(crate) mod baseline;
pub(crate) mod detection;
pub(crate) mod update;
