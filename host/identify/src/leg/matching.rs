//! Compares a model with a leg and describes the differences.
//!
//! A model of another leg predicts wrong torques, and its numbers do not show it. Everything that defines the
//! parameters' meaning is compared: side, names and order of the joints, lengths and axes, direction and
//! zero, torque constants, gravity. The board compares the fingerprint alone; here the differences are
//! described.

use nalgebra::Vector3;
use scarab_base::error::ToolError;

use crate::formats::leg_file::{BodySide, JointFile, LegFile};
use crate::formats::model_file::{ModelFile, StoredJoint};

/// Differences up to this size are rounding, in the unit of the compared value.
const ROUNDING: f64 = 1e-9;

/// Rejects a model of another leg.
///
/// # Errors
/// [`ToolError::Refused`] names the differences.
pub fn refuse_another_leg(model: &ModelFile, file: &str, leg: &LegFile) -> Result<(), ToolError> {
    let differences = differences(model, leg);
    if differences.is_empty() {
        return Ok(());
    }
    Err(ToolError::Refused(format!("{file}: not a model of this leg: {}", differences.join("; "))))
}

/// Differences between a model's leg and a leg; empty if they match.
pub(crate) fn differences(model: &ModelFile, leg: &LegFile) -> Vec<String> {
    let stored = &model.leg;
    let mut found = Vec::new();
    if plain(&stored.name) != plain(&leg.name) {
        found.push(format!("it is of `{}`, the leg is `{}`", stored.name, leg.name));
    }
    if stored.side != leg.side {
        let word = |side| if side == BodySide::Left { "left" } else { "right" };
        found.push(format!("it is of a {} leg, the leg is a {} one", word(stored.side), word(leg.side)));
    }
    let names = |names: Vec<&str>| names.join(", ");
    let (own, its) = (
        names(leg.joints.iter().map(|joint| joint.name.as_str()).collect()),
        names(stored.joints.iter().map(|joint| joint.name.as_str()).collect()),
    );
    if own != its {
        found.push(format!("its joints are {its}, the leg's are {own}"));
    }
    if stored.joints.len() == leg.joints.len() {
        for (number, (stored, joint)) in stored.joints.iter().zip(&leg.joints).enumerate() {
            found.extend(joint_differences(number, stored, joint));
        }
    }
    found.extend(gravity_difference(Vector3::from(stored.gravity), Vector3::from(leg.gravity)));
    found
}

/// Name of a leg without the options in it; their effects are compared directly.
fn plain(name: &str) -> &str {
    name.split(" --").next().unwrap_or(name)
}

fn joint_differences(number: usize, stored: &StoredJoint, joint: &JointFile) -> Vec<String> {
    let mut found = Vec::new();
    let mut compare = |what: &str, unit: &str, its: f64, own: f64| {
        if (its - own).abs() > ROUNDING {
            let share = if own * its == 0.0 {
                String::new()
            } else {
                format!(" ({:+.2} %)", 100.0 * (its / own - 1.0))
            };
            let values = format!("{its} {unit} in the model, {own} {unit} in the leg{share}");
            found.push(format!("{what} of joint `{}`: {values}", joint.name));
        }
    };
    let length = if number == 0 { "length `a` before" } else { "length `a` from the joint before" };
    compare(length, "m", stored.dh.a, joint.dh.a);
    compare("offset `d`", "m", stored.dh.d, joint.dh.d);
    compare("twist `alpha`", "rad", stored.dh.twist(), joint.dh.twist());
    compare("zero offset", "deg", stored.zero_offset_deg, joint.zero_offset_deg);
    compare("torque constant", "N m/A", stored.torque_per_ampere, joint.torque_per_ampere);
    if stored.direction != joint.direction {
        let (name, its, own) = (&joint.name, stored.direction, joint.direction);
        found.push(format!("direction of joint `{name}`: {its} in the model, {own} in the leg"));
    }
    found
}

fn gravity_difference(its: Vector3<f64>, own: Vector3<f64>) -> Option<String> {
    ((its - own).norm() > ROUNDING).then(|| {
        let turned = its.angle(&own).to_degrees();
        let (size, leg) = (its.norm(), own.norm());
        format!("gravity: {size:.4} m/s2 in the model, {leg:.4} m/s2 in the leg, turned by {turned:.2} deg")
    })
}
