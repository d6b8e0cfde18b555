//! Sagittal plane of a leg: the geometry of two-link chains, and how the exoskeleton lies in it.
//!
//! ```text
//! a = [hip flexion, knee flexion]        joint angles, anatomical
//! p = [a_0, a_0 - a_1]                   directions of thigh and shank; the map is its own inverse
//! P = [T_0 + T_1, -T_1]                  joint torques T as generalised forces on p, and back
//! e(p) = [cos p, sin p]                  unit vector down a segment;  n(p) = e'(p) points forward
//! ```
//!
//! Axis 0 of the plane is the exoskeleton's thigh at its anatomical zero, axis 1 points forward, that is
//! where hip flexion moves the thigh. The origin is the exoskeleton's hip axis. At the anatomical zero of
//! both joints the leg is straight. m, rad, N m.

use super::description::WearerError;
use crate::conventions::{Anatomy, links_at_reference};
use crate::description::LegDescription;
use crate::maths::{sin_cos, sqrt};

/// Vector in the plane, or one value per joint, segment or cuff, proximal first.
pub(super) type Pair = [f64; 2];

/// Largest angle between the two axes, and between plane and gravity, rad: rounding of a leg file's numbers.
const LARGEST_TILT: f64 = 1e-6;

/// Joint angles or rates converted to those of the segments, or back: the map is its own inverse.
pub(super) fn convert_angles([hip, second]: Pair) -> Pair {
    [hip, hip - second]
}

/// Joint torques converted to generalised forces on the segments' angles, or back.
pub(super) fn convert_torques([first, second]: Pair) -> Pair {
    [first + second, -second]
}

/// Unit vectors along a segment and forward.
pub(super) fn directions(angle: f64) -> [Pair; 2] {
    let (sine, cosine) = sin_cos(angle);
    [[cosine, sine], [-sine, cosine]]
}

pub(super) fn dot(one: Pair, other: Pair) -> f64 {
    one[0] * other[0] + one[1] * other[1]
}

/// `along` times the first plus `forward` times the second of two vectors.
pub(super) fn combined([first, second]: [Pair; 2], [along, forward]: Pair) -> Pair {
    [along * first[0] + forward * second[0], along * first[1] + forward * second[1]]
}

/// Segment of a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LimbSegment {
    Thigh,
    Shank,
}

/// Two links in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TwoLinkChain {
    /// Position of the hip axis, m.
    pub(crate) hip: Pair,
    /// Distance of the knee axis from the hip axis, m.
    pub(crate) thigh: f64,
}

/// Point of a chain with its derivatives by the segments' angles, m and m/rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChainPoint {
    pub(crate) position: Pair,
    pub(crate) slope: [Pair; 2],
}

impl TwoLinkChain {
    /// Point fixed to a segment: `at` along the segment from its upper joint, and forward, m.
    pub(super) fn point(&self, segment: LimbSegment, at: Pair, angles: Pair) -> ChainPoint {
        let thigh = directions(angles[0]);
        let from_hip = |vector: Pair| [self.hip[0] + vector[0], self.hip[1] + vector[1]];
        let turned = |[e, n]: [Pair; 2]| combined([n, e], [at[0], -at[1]]);
        match segment {
            LimbSegment::Thigh => {
                ChainPoint { position: from_hip(combined(thigh, at)), slope: [turned(thigh), [0.0; 2]] }
            }
            LimbSegment::Shank => {
                let shank = directions(angles[1]);
                let (knee, beyond) = (combined(thigh, [self.thigh, 0.0]), combined(shank, at));
                ChainPoint {
                    position: from_hip([knee[0] + beyond[0], knee[1] + beyond[1]]),
                    slope: [combined(thigh, [0.0, self.thigh]), turned(shank)],
                }
            }
        }
    }
}

impl ChainPoint {
    /// Velocity at rates of the segments, m/s.
    pub(super) fn velocity(&self, rates: Pair) -> Pair {
        combined(self.slope, rates)
    }

    /// Generalised forces of a force (N) on the segments' angles, N m.
    pub(super) fn torques(&self, force: Pair) -> Pair {
        self.slope.map(|slope| dot(slope, force))
    }

    /// Inverse of the mass, 1/kg, that the point opposes to forces, summed over both directions; `inertia` is
    /// the matrix of the segments' angles, kg m^2.
    pub(super) fn mobility(&self, inertia: &[Pair; 2]) -> f64 {
        let [[a, b], [c, d]] = *inertia;
        let determinant = a * d - b * c;
        (0..2)
            .map(|axis| {
                let [x, y] = self.slope.map(|slope| slope[axis]);
                (d * x * x - (b + c) * x * y + a * y * y) / determinant
            })
            .sum()
    }
}

/// Exoskeleton's chain in its plane, with what converts its joint angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ExoskeletonPlane {
    pub(crate) chain: TwoLinkChain,
    /// Gravity's acceleration in the plane, m/s^2.
    pub(crate) gravity: Pair,
    pub(crate) anatomy: [Anatomy; 2],
}

impl ExoskeletonPlane {
    /// Plane of a leg of two joints with parallel horizontal axes, flexion positive at both.
    pub(super) fn from_leg<const N: usize>(leg: &LegDescription<N>) -> Result<Self, WearerError> {
        let [hip, knee] = leg.joints.first_chunk().filter(|_| N == 2).ok_or(WearerError::JointCount(N))?;
        let [first, second] = links_at_reference(&[*hip, *knee]);
        let tilt = first.axis.cross(&second.axis).norm();
        if !(tilt <= LARGEST_TILT) {
            return Err(WearerError::AxesNotParallel { tilt });
        }
        if !(hip.direction * knee.direction * first.axis.dot(&second.axis) < 0.0) {
            return Err(WearerError::KneeDirection);
        }
        let gravity = nalgebra::Vector3::from(leg.gravity);
        let sideways = gravity.dot(&first.axis);
        if !(sideways.abs() <= LARGEST_TILT * gravity.norm()) {
            return Err(WearerError::PlaneNotVertical { sideways });
        }
        let thigh = second.from_previous - first.axis * first.axis.dot(&second.from_previous);
        let length = sqrt(thigh.norm_squared());
        if !(length > LARGEST_TILT) {
            return Err(WearerError::NoThigh { length });
        }
        let (sine, cosine) = sin_cos(hip.zero_offset);
        let reference = thigh / length;
        let along = reference * cosine + first.axis.cross(&reference) * sine;
        let forward = (first.axis * hip.direction).cross(&along);
        Ok(Self {
            chain: TwoLinkChain { hip: [0.0; 2], thigh: length },
            gravity: [gravity.dot(&along), gravity.dot(&forward)],
            anatomy: [Anatomy::from_joint(hip), Anatomy::from_joint(knee)],
        })
    }

    /// Anatomical angles at joint (D-H) angles.
    pub(super) fn position(&self, angles: Pair) -> Pair {
        [0, 1].map(|joint| self.anatomy[joint].to_anatomical_angle(angles[joint]))
    }

    /// Anatomical rates or torques from joint ones, and back.
    pub(super) fn flipped(&self, values: Pair) -> Pair {
        [0, 1].map(|joint| self.anatomy[joint].flip(values[joint]))
    }
}
