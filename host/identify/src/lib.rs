//! From files of a leg and its recordings to a result.
//!
//! | module | contents |
//! | --- | --- |
//! | [`report`] | results as plain data: the JSON |
//! | [`formats`] | files: leg, model, motion, recording, URDF |
//! | [`leg`] | a leg file becomes the firmware's configuration, its prior and its plant |
//! | [`run`] | from a recording to parameters, verdict and prediction |

#![expect(missing_docs, reason = "part of a program: names and units are stated where they are not obvious")]
#![expect(
    clippy::disallowed_methods,
    reason = "the tool runs on the host only and may use std's mathematics"
)]

pub mod formats;
pub mod leg;
pub mod report;
pub mod run;
