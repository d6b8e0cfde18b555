//! Scarab's host tool. `cargo sim` runs it.
//!
//! | module | contents |
//! | --- | --- |
//! | [`eds`], [`excitation_constant`] | files for other software: device description, motion as source |
//! | [`battery`] | cases by which the verdict of a replay is judged |
//! | [`live`] | sources of a live picture |
//! | [`view`] | tables, figures and pages, with the live page's server; runs no experiment |
//! | [`cli`] | the command line |

#![expect(missing_docs, reason = "part of a program: names and units are stated where they are not obvious")]
#![expect(
    clippy::disallowed_methods,
    reason = "the tool runs on the host only and may use std's mathematics"
)]

pub mod battery;
pub mod cli;
pub mod eds;
pub mod excitation_constant;
pub mod live;
pub mod view;
