//! Modified Denavit-Hartenberg numbers of axes in space.
//!
//! ```text
//! T(i-1, i) = Rx(alpha) Tx(a) Rz(q) Tz(d)
//! z_i: joint axis, turned to at most 90 degrees from z_(i-1); direction = -1 where that reverses it
//! x_i: common normal from z_i to z_(i+1); the last x continues the one before
//! alpha_i, a_i: turn about, distance along x_(i-1)
//! d_i, zero: distance along, turn about z_i at position 0
//! ```
//!
//! The base frame is free, since torque depends on gravity in it but not on its position. The first joint's
//! frame at position 0 is taken, so the first `alpha`, `a`, `d` and zero are 0. Parallel axes have a common
//! normal anywhere: the one is taken for which `d` is 0, up to the first axis that is not parallel.
//! Without a common normal (one joint, coaxial axes) x points along gravity.
//!
//! Source: Craig, *Introduction to Robotics* (2005), 3.4.
//! Known limit: the common normal of axes that are almost parallel lies far away; see
//! [`DhJoint::angle_to_parallel`].

use nalgebra::{Matrix3, Vector3};

/// Axes closer than this to parallel are parallel but for rounding, rad.
pub(crate) const ROUNDING_RAD: f64 = 1e-10;
/// Lengths and angles below are rounding, m or rad.
const ROUNDING: f64 = 1e-12;

/// Axis of a joint while all joints are at 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    /// Unit vector.
    pub(crate) along: Vector3<f64>,
    /// Point on the axis, m.
    pub(crate) point: Vector3<f64>,
}

/// Joint of a chain in modified Denavit-Hartenberg numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DhJoint {
    /// Twist, rad.
    pub(crate) alpha: f64,
    /// Length, m.
    pub(crate) a: f64,
    /// Offset along the axis, m.
    pub(crate) d: f64,
    /// 1, or -1 where the frame's z axis is opposite to the joint's axis.
    pub(crate) direction: i64,
    /// D-H angle at position 0, rad.
    pub(crate) zero: f64,
    /// Axes x, y, z of the frame at position 0, as columns.
    pub(crate) frame: Matrix3<f64>,
    /// Origin of the frame at position 0, m.
    pub(crate) origin: Vector3<f64>,
    /// Angle from parallel to the axis before, rad; 0 for the first joint.
    pub(crate) angle_to_parallel: f64,
}

/// Chain of axes with gravity in its base frame.
#[derive(Clone, Debug)]
pub(crate) struct DhChain {
    pub(crate) joints: Vec<DhJoint>,
    /// Gravity's acceleration in the base frame, m/s^2.
    pub(crate) gravity: Vector3<f64>,
}

impl DhChain {
    /// Chain of these axes. Axes within `parallel` (rad) of parallel count as parallel. Axes and
    /// gravity are in one frame.
    pub(crate) fn from_axes(axes: &[Axis], gravity: &Vector3<f64>, parallel: f64) -> Self {
        let along = aligned(axes, parallel);
        let normals: Vec<_> = (1..axes.len()).map(|next| normal(&along, axes, next)).collect();
        let x = normals_along(&along, &normals, gravity);
        let origins = origins(&along, axes, &normals, &x);
        let mut joints = Vec::with_capacity(axes.len());
        for number in 0..axes.len() {
            let (z, own) = (along[number].z, x[number]);
            // The base frame is that of the first joint.
            let before = number.checked_sub(1).unwrap_or(number);
            let a = normals.get(before).filter(|_| number > 0).map_or(0.0, |normal| normal.length);
            let reached = origins[before] + x[before] * a;
            joints.push(DhJoint {
                alpha: tidy(angle(&along[before].z, &z, &x[before])),
                a: tidy(a),
                d: if number == 0 { 0.0 } else { tidy((origins[number] - reached).dot(&z)) },
                direction: along[number].direction,
                zero: tidy(angle(&x[before], &own, &z)),
                frame: Matrix3::from_columns(&[own, z.cross(&own), z]),
                origin: origins[number],
                angle_to_parallel: along[number].angle_to_parallel,
            });
        }
        let gravity = joints.first().map_or(*gravity, |first| first.frame.transpose() * gravity);
        // Rounding of a component would look like a tilted base.
        let gravity = gravity.map(|part| if part.abs() < ROUNDING * gravity.norm() { 0.0 } else { part });
        Self { joints, gravity }
    }
}

/// Axis of a frame.
#[derive(Clone, Copy, Debug)]
struct Aligned {
    z: Vector3<f64>,
    direction: i64,
    angle_to_parallel: f64,
    is_parallel: bool,
}

/// Turns every axis to at most 90 degrees from the one before.
fn aligned(axes: &[Axis], parallel: f64) -> Vec<Aligned> {
    let mut aligned: Vec<Aligned> = Vec::with_capacity(axes.len());
    for axis in axes {
        let own = axis.along.normalize();
        let next = match aligned.last() {
            None => Aligned { z: own, direction: 1, angle_to_parallel: 0.0, is_parallel: false },
            Some(before) => {
                let (sine, cosine) = (before.z.cross(&own).norm(), before.z.dot(&own));
                // A right angle keeps its sense, whatever its rounding.
                let direction = if cosine < -ROUNDING { -1 } else { 1 };
                let angle_to_parallel = sine.atan2(cosine.abs());
                let is_parallel = angle_to_parallel <= parallel.max(ROUNDING_RAD);
                let z = if is_parallel { before.z } else { own * direction as f64 };
                Aligned { z, direction, angle_to_parallel, is_parallel }
            }
        };
        aligned.push(next);
    }
    aligned
}

/// Common normal of an axis and the one before.
#[derive(Clone, Copy, Debug)]
struct Normal {
    /// Unit vector from the axis before to this one; either sign if they intersect, none if coaxial.
    along: Option<Vector3<f64>>,
    length: f64,
    /// Foot on the axis before; none for parallel axes, whose normal may be anywhere.
    foot: Option<Vector3<f64>>,
}

fn normal(along: &[Aligned], axes: &[Axis], next: usize) -> Normal {
    let (before, own) = (along[next - 1].z, along[next].z);
    let between = axes[next].point - axes[next - 1].point;
    if along[next].is_parallel {
        let across = between - before * between.dot(&before);
        let length = across.norm();
        return if length < ROUNDING {
            Normal { along: None, length: 0.0, foot: None }
        } else {
            Normal { along: Some(across / length), length, foot: None }
        };
    }
    let cross = before.cross(&own);
    let square = cross.norm_squared();
    let foot = axes[next - 1].point + before * (between.cross(&own).dot(&cross) / square);
    let unit = cross / square.sqrt();
    let length = between.dot(&unit);
    let sign = if length < -ROUNDING { -1.0 } else { 1.0 };
    let length = if length.abs() < ROUNDING { 0.0 } else { length.abs() };
    Normal { along: Some(unit * sign), length, foot: Some(foot) }
}

/// Axis x of every frame.
fn normals_along(along: &[Aligned], normals: &[Normal], gravity: &Vector3<f64>) -> Vec<Vector3<f64>> {
    let mut x: Vec<Vector3<f64>> = Vec::with_capacity(along.len());
    for number in 0..along.len() {
        let own = match (normals.get(number).and_then(|normal| normal.along), x.last()) {
            (Some(unit), None) => unit,
            (Some(unit), Some(before)) => {
                // Intersecting axes leave the sign free: the zero is within 90 degrees.
                let is_free = normals[number].length == 0.0;
                if is_free && unit.dot(before) < 0.0 { -unit } else { unit }
            }
            (None, Some(before)) => *before,
            (None, None) => across(&along[number].z, gravity),
        };
        x.push(own);
    }
    x
}

/// Unit vector across an axis, along gravity if possible.
fn across(z: &Vector3<f64>, gravity: &Vector3<f64>) -> Vector3<f64> {
    let pulled = gravity - z * gravity.dot(z);
    if pulled.norm() > 1e-6 * gravity.norm() {
        return pulled.normalize();
    }
    let least = z.map(f64::abs).imin();
    let mut other = Vector3::zeros();
    other[least] = 1.0;
    (other - z * other.dot(z)).normalize()
}

fn origins(along: &[Aligned], axes: &[Axis], normals: &[Normal], x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut origins: Vec<Option<Vector3<f64>>> =
        (0..axes.len()).map(|number| normals.get(number).and_then(|normal| normal.foot)).collect();
    // Parallel axes take the height at which the chain goes on.
    for number in (0..axes.len().saturating_sub(1)).rev() {
        if let (None, Some(next)) = (origins[number], origins[number + 1]) {
            let (z, point) = (along[number].z, axes[number].point);
            origins[number] = Some(point + z * (next - point).dot(&z));
        }
    }
    let mut found: Vec<Vector3<f64>> = Vec::with_capacity(axes.len());
    for (number, origin) in origins.into_iter().enumerate() {
        let own = origin.unwrap_or_else(|| match number.checked_sub(1) {
            None => axes[0].point,
            Some(before) => found[before] + x[before] * normals[before].length,
        });
        found.push(own);
    }
    found
}

/// Angle from one unit vector to another about an axis, rad.
fn angle(from: &Vector3<f64>, to: &Vector3<f64>, about: &Vector3<f64>) -> f64 {
    from.cross(to).dot(about).atan2(from.dot(to))
}

/// Replaces rounding by 0.
fn tidy(value: f64) -> f64 {
    if value.abs() < ROUNDING { 0.0 } else { value }
}
