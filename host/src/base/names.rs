//! Names in reports and files.

use scarab::ident::{Estimator, Plan};
use scarab::model::Parameter;

/// First word that `cargo sim` passes: without a command the main job runs.
pub const BY_CARGO: &str = "--by-cargo";

/// Name of a parameter in reports.
#[must_use]
pub fn parameter_name(joint: usize, parameter: Parameter) -> String {
    format!("{}{}", parameter.symbol(), joint + 1)
}

/// Name of the static friction of a joint.
#[must_use]
pub fn surplus_name(joint: usize) -> String {
    format!("FS{}", joint + 1)
}

/// Name of an estimator.
#[must_use]
pub const fn estimator_name(estimator: Estimator) -> &'static str {
    match estimator {
        Estimator::Robust => "robust",
        Estimator::Plain => "plain",
    }
}

/// Name of a plan.
#[must_use]
pub const fn plan_name(plan: Plan) -> &'static str {
    match plan {
        Plan::OneTime => "one-time",
        Plan::Sequential => "sequential",
    }
}

/// Name of half the difference of Coulomb friction between the directions.
#[must_use]
pub fn asymmetry_name(joint: usize) -> String {
    format!("FCA{}", joint + 1)
}
