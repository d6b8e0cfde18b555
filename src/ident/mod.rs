//! Identification: from logged angles and currents to parameters, their uncertainty, and a verdict.
//!
//! ```text
//! q, tau 500 Hz -> smoothing: g, g', g'' -> regressor; both -> rows: one h, 50 Hz -> factor  (record)
//! factor -> selection: drops columns that the data do not determine, where allowed
//!        -> estimate: noise weights, least squares, covariance
//!        -> search: beetle swarm in the prior's box (bounds), against the constrained optimum (constrained)
//!        -> completion: fourteen parameters of every joint, each with its status
//! held-out motions -> residual, alignment (held_out): order in time, geometry errors
//!        -> verdict: accepted, or refused with reasons
//! scale: torque constants from two records, without and with a known mass
//! accepted -> baseline -> monitor of the residual in motion -> update: cause of a change, from gait
//! ```
//!
//! All code is generic over the scalar: the board runs it in `f32`, tests check it in `f64`.

pub mod alignment;
mod assembly;
pub mod baseline;
pub mod bounds;
pub mod choice;
pub mod completion;
pub mod consistent;
pub mod constrained;
pub mod estimate;
pub mod factor;
pub mod filters;
pub mod hampel;
pub mod held_out;
pub mod kernel;
pub mod monitor;
pub mod noise;
pub mod outliers;
pub mod packed;
mod record;
pub mod recorder;
pub mod residual;
pub mod reweighting;
pub mod row_model;
pub mod rows;
pub mod scale;
pub mod search;
pub mod selection;
pub mod smoothing;
pub mod solver;
pub mod stretch;
pub mod stribeck;
mod sum;
pub mod update;
pub mod verdict;
pub mod window;

pub use alignment::{Alignment, Direction, Misalignment, Misalignments};
pub use baseline::Baseline;
pub use bounds::{LinkPrior, parameter_box, prior_parameters, search_box};
pub use choice::{Choice, Constant, DriveChoice, Estimator};
pub use completion::{Status, complete, status};
pub use consistent::{Completion, Effort, FullObjective, FullSearch, LegCost, Limits};
pub use constrained::{ParameterBox, least_squares_in_box};
pub use estimate::{Estimate, Plan, Problem, Stage, noise};
pub use factor::Factor;
pub use filters::Filters;
pub use held_out::HeldOut;
pub use kernel::{Kernel, KernelError, LowPass};
pub use monitor::{Change, Monitor, MonitorSettings, ROWS_PER_BLOCK};
pub use outliers::Outliers;
pub use recorder::{
    LARGEST_STILL_SHARE, MotionWindow, Progress, Record, Recorder, RowModel, SAMPLE_RATE_HZ,
    SMOOTHING_BANDWIDTHS, TorqueSize,
};
pub use residual::{JointResidual, Residual};
pub use row_model::no_stribeck;
pub use rows::{DECIMATION, Ends, FilteredRows, RowFilter};
pub use scale::{ConstantRatio, torque_constant_ratio, widen};
pub use search::{SearchState, SwarmSearch};
pub use selection::Selection;
pub use smoothing::{Smoothed, Smoother};
pub use solver::{Consistency, Solver};
pub use stretch::Stretches;
pub use stribeck::StribeckFit;
pub use update::hypothesis::{DIRECTIONS, Hypothesis};
pub use update::{Cause, PAYLOAD_PARAMETERS, Update};
pub use verdict::{Evidence, Reason, Test, Thresholds, Unused, Verdict, VerdictBuilder};
