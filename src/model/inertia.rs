//! Mass, centre of mass and inertia of a body, and the ten parameters they become about a joint frame's origin.
//!
//! Drawings and tables give inertia about the centre of mass; torque is linear only in the inertia about the
//! joint's own origin. The parallel-axis theorem links the two.
//!
//! ```text
//! h = m c
//! I = I_c + m (c.c E - c c')
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | m, c | mass; centre of mass in the joint's frame | kg, m |
//! | I_c, I | inertia tensor about the centre of mass, about the frame's origin; tensor elements | kg m2 |
//! | h | first moment of mass: HX, HY, HZ | kg m |
//!
//! Source: Steiner's theorem. The paper's Eq. (4) swaps the two inertias' names and the two products of c.
//! Limits: nothing here asks whether such a body can exist; [`super::log_cholesky`] does.

use nalgebra::{Matrix3, Vector3};

use super::parameter::{JointParameters, Parameter};
use crate::real::{Real, is_finite};

/// Number of a link's inertial parameters, the first ones of a joint.
pub const INERTIAL_PARAMETERS: usize = 10;

/// XX XY XZ YY YZ ZZ HX HY HZ M about the joint frame's origin.
pub type InertialParameters<T> = [T; INERTIAL_PARAMETERS];

/// A rigid body as a drawing gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBody<T> {
    /// kg.
    pub mass: T,
    /// In the joint's frame, m.
    pub centre_of_mass: Vector3<T>,
    /// Tensor about the centre of mass, along the joint frame's axes, kg m2; symmetric.
    pub inertia: Matrix3<T>,
}

impl<T: Real> RigidBody<T> {
    /// The ten parameters about the joint frame's origin. Parameters of bodies fixed to one another add up.
    #[must_use]
    pub fn to_parameters(&self) -> InertialParameters<T> {
        let h = self.centre_of_mass * self.mass;
        let inertia = self.inertia + steiner(&self.centre_of_mass, &h);
        [
            inertia.m11,
            inertia.m12,
            inertia.m13,
            inertia.m22,
            inertia.m23,
            inertia.m33,
            h.x,
            h.y,
            h.z,
            self.mass,
        ]
    }

    /// The body with these parameters; `None` unless the mass is finite and more than zero.
    #[must_use]
    pub fn from_parameters(parameters: &InertialParameters<T>) -> Option<Self> {
        let [xx, xy, xz, yy, yz, zz, hx, hy, hz, mass] = *parameters;
        if mass <= T::zero() || !is_finite(mass) {
            return None;
        }
        let h = Vector3::new(hx, hy, hz);
        let centre_of_mass = h / mass;
        let about_origin = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Some(Self { mass, centre_of_mass, inertia: about_origin - steiner(&centre_of_mass, &h) })
    }
}

/// m (c.c E - c c') from c and h = m c.
fn steiner<T: Real>(c: &Vector3<T>, h: &Vector3<T>) -> Matrix3<T> {
    Matrix3::from_diagonal_element(c.dot(h)) - c * h.transpose()
}

/// The inertial part of a joint's parameters.
#[must_use]
pub fn inertial<T: Real>(parameters: &JointParameters<T>) -> InertialParameters<T> {
    let [xx, xy, xz, yy, yz, zz, hx, hy, hz, m, ..] = *parameters;
    [xx, xy, xz, yy, yz, zz, hx, hy, hz, m]
}

/// A joint's parameters from its link's inertia and its drive: rotor inertia (kg m2), Coulomb (N m), viscous
/// (N m s/rad), offset (N m).
#[must_use]
pub fn joint<T: Real>(link: &InertialParameters<T>, drive: &[T; 4]) -> JointParameters<T> {
    let [xx, xy, xz, yy, yz, zz, hx, hy, hz, m] = *link;
    let [ia, fc, fv, off] = *drive;
    [xx, xy, xz, yy, yz, zz, hx, hy, hz, m, ia, fc, fv, off]
}

/// Inertia tensor about the frame's origin, kg m2.
pub(super) fn tensor<T: Real>(parameters: &JointParameters<T>) -> Matrix3<T> {
    let [xx, xy, xz, yy, yz, zz, ..] = *parameters;
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// First moment of mass, kg m.
pub(super) fn first_moment<T: Real>(parameters: &JointParameters<T>) -> Vector3<T> {
    Vector3::new(
        parameters[Parameter::HX.index()],
        parameters[Parameter::HY.index()],
        parameters[Parameter::HZ.index()],
    )
}
