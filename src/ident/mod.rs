//! Identification: from logged angles and currents to parameters, their uncertainty, and a verdict.
//!
//! ```text
//! signal    q, tau 500 Hz -> outliers replaced -> g, g', g''
//! record    g, g', g'' -> regressor; with tau -> rows: one h, 50 Hz -> blocks -> factor of every joint
//! solve     factor -> columns dropped -> least squares -> beetle swarm -> fourteen parameters of every joint
//! judge     parameters, held-out motions -> residual in order of time, geometry errors -> verdict
//! monitor   accepted parameters -> baseline -> residual in motion -> alarm -> its cause
//! ```
//!
//! Each folder uses only those above it; `tests/structure` enforces the order. Inside this module an item is
//! named by its folder. Other modules use the re-exports below where one exists.
//!
//! All code is generic over the scalar: the board runs it in `f32`, tests check it in `f64`.

pub(crate) mod judge;
pub(crate) mod monitor;
pub mod record;
pub mod signal;
pub mod solve;

pub use judge::alignment::{Alignment, Direction, Misalignment, Misalignments};
pub use judge::held_out::HeldOut;
pub use judge::residual::{JointResidual, Residual};
pub use judge::verdict::{Evidence, Reason, Test, Thresholds, Unused, Verdict, VerdictBuilder};
pub use monitor::baseline::Baseline;
pub use monitor::detection::{Change, Monitor, MonitorSettings};
pub use monitor::update::hypothesis::Hypothesis;
pub use monitor::update::{Cause, PAYLOAD_PARAMETERS, Update};
pub use record::choice::{Choice, Constant, DriveChoice, Estimator};
pub use record::factor::Factor;
pub use record::motion_record::{Outliers, Record, Selection, TorqueSize};
pub use record::recorder::{
    Filters, LARGEST_STILL_SHARE, MotionWindow, Progress, Recorder, SAMPLE_RATE_HZ, SMOOTHING_BANDWIDTHS,
};
pub use record::row_model::{RowModel, no_stribeck};
pub use record::rows::{DECIMATION, Ends, FilteredRows, RowFilter};
pub use record::stretch::Stretches;
pub use record::stribeck::StribeckFit;
pub use signal::kernel::{Kernel, KernelError, LowPass};
pub use signal::smoothing::{Smoothed, Smoother};
pub use solve::bounds::{LinkPrior, parameter_box, prior_parameters};
pub use solve::completion::{Status, status};
pub use solve::consistent::{Completion, Effort, FullObjective, FullSearch, LegCost, Limits};
pub use solve::constrained::{ParameterBox, least_squares_in_box};
pub use solve::estimate::{Estimate, Plan, Problem, Stage, noise};
pub use solve::scale::{ConstantRatio, torque_constant_ratio};
pub use solve::search::{SearchState, SwarmSearch};
pub use solve::solver::Solver;
