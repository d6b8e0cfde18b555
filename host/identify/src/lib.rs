//! From files of a leg and its recordings to a result.
//!
//! | module | contents |
//! | --- | --- |
//! | [`report`] | results as plain data: the JSON |
//! | [`formats`] | files: leg, model, motion, recording, URDF |
//! | [`leg`] | a leg file becomes the firmware's configuration, its prior and its plant |
//! | [`run`] | from a recording to parameters, verdict and prediction |
//!
//! ```no_run
//! use scarab_identify::formats::leg_file::LegFile;
//! use scarab_identify::formats::recording::{Recording, import::Import};
//! use scarab_identify::run::replay::{Recordings, ReplayOptions, replay};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let leg = &LegFile::load("my-leg.toml")?;
//! let read = Recording::read("walk.csv".as_ref(), &Import::plain(2))?;
//! let recordings = &Recordings { training: vec![read], ..Recordings::default() };
//! // Two thirds train, the rest validates.
//! let options = &ReplayOptions { split: Some(0.67), ..ReplayOptions::from_leg(leg) };
//! let found = replay(leg, recordings, options)?.run;
//! println!("{}: {:?} % of the held-out torque", found.verdict, found.validation[0].percent_of_rms.known());
//! for base in &found.base_parameters {
//!     println!("{}: {:?} +- {:?} {}", base.name, base.value.known(), base.sigma.known(), base.unit);
//! }
//! # Ok(())
//! # }
//! ```

#![expect(missing_docs, reason = "part of a program: names and units are stated where they are not obvious")]
#![expect(
    clippy::disallowed_methods,
    reason = "the tool runs on the host only and may use std's mathematics"
)]

pub mod formats;
pub mod leg;
pub mod report;
pub mod run;
