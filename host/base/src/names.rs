//! Names in reports and files.

use scarab::ident::{Estimator, Plan};
use scarab::leg::VALIDATION_MOTIONS;
use scarab::model::Parameter;

/// First word that `cargo sim` passes: without a command the main job runs.
pub const BY_CARGO: &str = "--by-cargo";

/// Names of the predicted motions, in the order of the leg's validation.
pub const VALIDATION_NAMES: [&str; VALIDATION_MOTIONS] = ["gait-6.5", "gait-3", "fourier"];

/// Name of a parameter in reports.
pub fn parameter_name(joint: usize, parameter: Parameter) -> String {
    format!("{}{}", parameter.symbol(), joint + 1)
}

/// Name of the static friction of a joint.
pub fn surplus_name(joint: usize) -> String {
    format!("FS{}", joint + 1)
}

/// Name of an estimator.
pub const fn estimator_name(estimator: Estimator) -> &'static str {
    match estimator {
        Estimator::Robust => "robust",
        Estimator::Plain => "plain",
    }
}

/// Name of a plan.
pub const fn plan_name(plan: Plan) -> &'static str {
    match plan {
        Plan::OneTime => "one-time",
        Plan::Sequential => "sequential",
    }
}

/// Name of half the difference of Coulomb friction between the directions.
pub fn asymmetry_name(joint: usize) -> String {
    format!("FCA{}", joint + 1)
}
