//! The only place where the plant's conventions meet anybody else's.
//!
//! Two translations live here.
//! 1. **Frames.** Links are described in modified Denavit-Hartenberg frames. The plant wants, in the base
//!    (world) frame and at the reference pose (all joint angles 0): the unit vector of each axis, the vector from
//!    one joint's point to the next, the vector from the joint to the link's centre of mass, and the inertia
//!    tensor. With A(i) = A(i-1) Rx(alpha_i) the link's orientation at the reference pose, axis = A e_z,
//!    point = previous point + A(i-1) e_x a + axis d, everything of the link turned by A. At other poses a link
//!    has been turned about its own axis and all axes before it; no frame is carried along.
//! 2. **Signs.** Ports speak anatomical angles (flexion positive), the plant joint angles: joint angle =
//!    direction * anatomical angle + zero offset, torque likewise without the offset.

use crate::description::{DenavitHartenberg, JointDescription};
use crate::maths::sin_cos;
use crate::mechanism::RigidLink;
use nalgebra::{Matrix3, Vector3};

/// Links of a chain at its reference pose, in the world frame.
pub(crate) fn links_at_reference<const N: usize>(joints: &[JointDescription; N]) -> [RigidLink; N] {
    let mut orientation = Matrix3::identity();
    core::array::from_fn(|joint| {
        let description = &joints[joint];
        let DenavitHartenberg { alpha, a, d } = description.frame;
        let along = orientation * Vector3::x();
        orientation *= turn_about_x(alpha);
        let axis = orientation * Vector3::z();
        let body = &description.body;
        let [xx, xy, xz, yy, yz, zz] = body.inertia_com;
        let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        RigidLink {
            axis,
            from_previous: along * a + axis * d,
            to_centre: orientation * Vector3::from(body.com),
            mass: body.mass,
            inertia: orientation * inertia * orientation.transpose(),
            rotor_inertia: description.rotor_inertia,
        }
    })
}

fn turn_about_x(angle: f64) -> Matrix3<f64> {
    let (sine, cosine) = sin_cos(angle);
    Matrix3::new(1.0, 0.0, 0.0, 0.0, cosine, -sine, 0.0, sine, cosine)
}

/// Anatomical and joint (D-H) quantities of one joint, both ways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anatomy {
    direction: f64,
    zero_offset: f64,
}

impl Anatomy {
    /// From a joint's direction (+1 or -1) and zero offset.
    #[must_use]
    pub fn of(joint: &JointDescription) -> Self {
        Self { direction: joint.direction, zero_offset: joint.zero_offset }
    }

    /// Joint angle of an anatomical one, rad.
    #[must_use]
    pub fn to_joint_angle(&self, anatomical: f64) -> f64 {
        self.direction * anatomical + self.zero_offset
    }

    /// Anatomical angle of a joint's, rad.
    #[must_use]
    pub fn to_anatomical_angle(&self, joint: f64) -> f64 {
        self.direction * (joint - self.zero_offset)
    }

    /// Rates and torques change their sign with `direction`, the same way in both directions.
    #[must_use]
    pub fn flip(&self, rate_or_torque: f64) -> f64 {
        self.direction * rate_or_torque
    }
}
