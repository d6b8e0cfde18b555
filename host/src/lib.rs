//! Scarab's host tool: simulated legs, recordings, traces and images. `cargo sim` runs it.
//!
//! Each module uses only those that stand above it; `tests/structure` holds the table.
//!
//! | module | contents |
//! | --- | --- |
//! | [`base`] | errors, numbers and their formatting, files that are written |
//! | [`report`] | results as plain data: the JSON |
//! | [`formats`] | files: leg, model, motion, recording, stored data of a board, trace, EDS, URDF |
//! | [`leg`] | a leg file becomes the firmware's configuration, its prior and its plant |
//! | [`client`] | CANopen master behind an slcan adapter |
//! | [`rig`] | firmware and simulated hardware put together, the bus included |
//! | [`run`] | one experiment each: identify, replay, monitor, design of a motion, motor stand, prediction |
//! | [`image`] | the flash image |
//! | [`faults`] | the fault catalogue, injected into the whole firmware |
//! | [`view`] | tables, figures and pages, with the live page's server; runs no experiment |
//! | [`cli`] | the command line |

#![expect(missing_docs, reason = "a program: names and units are stated where they are not obvious")]
#![expect(
    clippy::disallowed_methods,
    reason = "the tool runs on the host only and may use std's mathematics"
)]

pub mod base;
pub mod cli;
pub mod client;
pub mod faults;
pub mod formats;
pub mod image;
pub mod leg;
pub mod report;
pub mod rig;
pub mod run;
pub mod view;
