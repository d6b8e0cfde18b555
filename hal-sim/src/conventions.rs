//! Conversion between the plant's conventions and those of its users; the only such module.
//!
//! Two translations:
//!
//! 1. **Frames.** Links are described in modified Denavit-Hartenberg frames. The plant needs them in the base
//!    (world) frame at the reference pose (all joint angles 0). Each link needs the axis' unit vector,
//!    vectors from the previous joint's point and to the centre of mass, and the inertia tensor. Let A(i) =
//!    A(i-1) Rx(alpha_i) be the link's orientation at the reference pose. Then axis = A e_z, point = previous
//!    point + A(i-1) e_x a + axis d, and A turns all other quantities of the link. At other poses a link has
//!    been turned about its own axis and all axes before it, so no frame needs to be stored.
//! 2. **Signs.** Ports use anatomical angles (flexion positive), the plant joint angles. Joint angle =
//!    direction * anatomical angle + zero offset; torques have no offset.

use crate::description::{DenavitHartenberg, JointDescription};
use crate::maths::sin_cos;
use nalgebra::{Matrix3, Vector3};

/// One link at the reference pose, in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RigidLink {
    /// Unit vector of the joint's axis.
    pub(crate) axis: Vector3<f64>,
    /// Vector from the previous joint's point (the base's origin for the first) to this joint's, m.
    pub(crate) from_previous: Vector3<f64>,
    /// Vector from the joint's point to the centre of mass, m.
    pub(crate) to_centre: Vector3<f64>,
    /// Mass, kg.
    pub(crate) mass: f64,
    /// Inertia tensor about the centre of mass, kg m^2.
    pub(crate) inertia: Matrix3<f64>,
    /// Rotor inertia at the joint, kg m^2.
    pub(crate) rotor_inertia: f64,
}

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

/// Conversion between anatomical and joint (D-H) quantities of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anatomy {
    direction: f64,
    zero_offset: f64,
}

impl Anatomy {
    /// Conversion from a joint's direction (+1 or -1) and zero offset.
    pub fn from_joint(joint: &JointDescription) -> Self {
        Self { direction: joint.direction, zero_offset: joint.zero_offset }
    }

    /// Joint angle for an anatomical angle, rad.
    pub fn to_joint_angle(&self, anatomical: f64) -> f64 {
        self.direction * anatomical + self.zero_offset
    }

    /// Anatomical angle for a joint angle, rad.
    pub fn to_anatomical_angle(&self, joint: f64) -> f64 {
        self.direction * (joint - self.zero_offset)
    }

    /// Converts a rate or torque, in either direction: the sign changes with `direction`.
    pub fn flip(&self, rate_or_torque: f64) -> f64 {
        self.direction * rate_or_torque
    }
}
