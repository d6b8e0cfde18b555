//! From files of a leg and its recordings to a result.
//!
//! | step | items |
//! | --- | --- |
//! | describe the leg | [`LegFile`]; from a URDF [`Robot`] and [`leg_of_robot`] |
//! | read recordings | [`Recording`], with other columns and units by [`Import`] |
//! | identify and judge | [`replay`] |
//! | use the result | [`RunReport`], [`ModelFile`], [`predict`], [`compare_models`], [`urdf`] |
//! | other tables | [`regressor_table`], [`Excitation`] and [`MotionSamples`] |
//!
//! ```no_run
//! use scarab_identify::{Import, LegFile, Recording, Recordings, ReplayOptions, replay};
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
//!
//! Angles and torques outside are anatomical, in rad and N m: flexion positive. The hidden modules belong to
//! the other crates of this workspace and may change at any time.

#![expect(
    clippy::disallowed_methods,
    reason = "the tool runs on the host only and may use std's mathematics"
)]

#[doc(hidden)]
pub mod formats;
#[doc(hidden)]
pub mod leg;
#[doc(hidden)]
pub mod report;
#[doc(hidden)]
pub mod run;

pub use formats::excitation::Excitation;
pub use formats::leg_file::{JointFile, LegFile};
pub use formats::model_file::{BaseSet, ModelFile};
pub use formats::motion_samples::MotionSamples;
pub use formats::recording::import::{ColumnChoice, Import, UnitChoice};
pub use formats::recording::{JointSeries, Read, Recording};
pub use formats::robot::Robot;
pub use formats::urdf::text as urdf;
pub use leg::from_robot::{FromRobot, RobotOptions, leg as leg_of_robot};
pub use leg::placed_mass::PlacedMass;
pub use leg::setup::PriorChoice;
pub use leg::states::Angles;
pub use report::additional_torque::{AdditionalKind, AdditionalTorque};
pub use report::doubt::{CauseReport, DoubtReport};
pub use report::findings::FindingReport;
pub use report::series::Series;
pub use report::{BaseReport, ComparisonReport, FitReport, ParameterReport, RunReport, Source};
pub use run::compare_model::compare as compare_models;
pub use run::predict::table as predict;
pub use run::regressor::{RegressorOptions, table as regressor_table};
pub use run::replay::{Recordings, ReplayOptions, Replayed, replay};
pub use scarab::ident::{Estimator, Plan};
pub use scarab::model::Payload;
pub use scarab_base::error::{FileError, ToolError};
pub use scarab_base::number::Number;
