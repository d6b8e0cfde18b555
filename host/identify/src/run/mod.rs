//! One experiment each: an identification, a replay, a design, a measurement.

pub(crate) mod added_mass;
pub mod analysis;
pub mod compare_model;
pub mod consistent;
pub mod disturbances;
pub mod information;
pub(crate) mod logging_errors;
pub mod model_choice;
pub mod predict;
pub mod progress;
pub mod regressor;
pub mod replay;
pub mod resample;
pub(crate) mod save_model;
pub mod scale;
