//! Leg file for the other side of the body, or for a leaning trunk.
//!
//! **Side.** The drives of a left leg are mounted mirrored: the same flexion turns motor and
//! encoder the other way. Angles and torques stay anatomical. The frames keep their axes'
//! directions in space: a turn about z is unchanged by a mirror along z.
//!
//! Everything odd in z changes its sign: offsets along the axes, z of the centres of mass, the products XZ
//! and YZ. So do the drives' counts and currents (`scarab::servo::JointScale::mirrored`). Only legs with
//! parallel axes are mirrored; with another axis the motion itself would have to be mirrored.
//!
//! **Trunk.** The base frame is the trunk's. A trunk that leans forward by p turns gravity in that
//! frame about the hip's axis of flexion. The direction is that in which flexion turns the thigh:
//!
//! ```text
//! g -> Rot(flexion axis of the hip, p) g          for the default leg (9.81, 0, 0) -> 9.81 (cos p, sin p, 0)
//! ```
//!
//! Limits: one constant angle per run.

use nalgebra::{Rotation3, Unit, Vector3};
use scarab_base::error::ToolError;

use crate::formats::leg_file::{BodySide, LegFile};

/// Largest lean of a trunk, degrees.
pub(crate) const LARGEST_PITCH_DEG: f64 = 90.0;

/// Leg for this side of the body.
pub fn on_side(leg: &LegFile, side: BodySide) -> Result<LegFile, ToolError> {
    let mut turned = leg.clone();
    if side == leg.side {
        return Ok(turned);
    }
    if let Some(joint) = leg.joints.iter().find(|joint| joint.dh.alpha != 0.0) {
        return Err(ToolError::input(format!(
            "--side: {}: joint `{}` is not parallel to the one before it (alpha {}); only legs with parallel axes can be mirrored",
            leg.name, joint.name, joint.dh.alpha
        )));
    }
    turned.side = side;
    for joint in &mut turned.joints {
        joint.dh.d = 0.0 - joint.dh.d;
        for link in [&mut joint.truth, &mut joint.prior].into_iter().flatten() {
            // 0 - x keeps a zero without a sign.
            link.com[2] = 0.0 - link.com[2];
            link.inertia_com[2] = 0.0 - link.inertia_com[2];
            link.inertia_com[4] = 0.0 - link.inertia_com[4];
        }
    }
    Ok(turned)
}

/// Leg below a trunk that leans forward by `degrees`.
pub fn pitched(leg: &LegFile, degrees: f64) -> Result<LegFile, ToolError> {
    if !(-LARGEST_PITCH_DEG..=LARGEST_PITCH_DEG).contains(&degrees) {
        return Err(ToolError::input(format!(
            "--trunk-pitch {degrees}: degrees forward, from -{LARGEST_PITCH_DEG} to {LARGEST_PITCH_DEG}"
        )));
    }
    let mut leaning = leg.clone();
    let axis = flexion_axis(leg);
    leaning.gravity =
        (Rotation3::from_axis_angle(&axis, degrees.to_radians()) * Vector3::from(leg.gravity)).into();
    Ok(leaning)
}

/// Flexion axis of the hip in the base frame, all joints at their anatomical zero. A leg without a
/// joint named hip uses its first joint.
fn flexion_axis(leg: &LegFile) -> Unit<Vector3<f64>> {
    let hip = leg.joints.iter().position(|joint| joint.name == "hip").unwrap_or(0);
    let mut frame = Rotation3::identity();
    let mut direction = 1.0;
    for joint in leg.joints.iter().take(hip + 1) {
        let zero = joint.zero_offset_deg.to_radians();
        frame *= Rotation3::from_axis_angle(&Vector3::x_axis(), joint.dh.twist())
            * Rotation3::from_axis_angle(&Vector3::z_axis(), zero);
        direction = joint.direction as f64;
    }
    Unit::new_normalize(frame * Vector3::z() * direction)
}
