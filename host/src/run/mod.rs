//! One experiment each: an identification, a replay, a design, a measurement.

pub mod added_mass;
pub mod analysis;
pub mod assist;
pub mod commission;
pub mod compare_model;
pub mod consistent;
pub mod disturbances;
pub mod excite;
pub mod identified;
pub mod identify;
pub mod information;
pub mod live;
pub mod logging_errors;
pub mod model_choice;
pub mod monitor;
pub mod motor;
pub mod predict;
pub mod regressor;
pub mod replay;
pub mod resample;
pub mod save_model;
pub mod scale;
pub mod shaking;
pub mod simulate;
pub mod trace;
pub mod watch;
